"""Which way round a map lays a surface down: patches that it turns over are found, and turned back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray

NEIGHBOURS = 24
"""Neighbours by which the sense at a point is read; of 1,000 samples of half a surface they reach 0.06 far."""

TURNED = -0.1
"""Sense below which a point is taken to be turned over; between this and 0 nothing can be said."""

_JOINED = 8
"""Nearest neighbours through which patches hang together."""

_ENOUGH = 5
"""Neighbours that must be the right way round, and count, for them to say where a point goes."""

_COUNTS = 0.05
"""Weight at which a neighbour counts among these."""

_NORMAL = 0.03
"""Length, in units of sqrt(full area), that a difference 1 of unit normals is worth."""


@dataclass(frozen=True, eq=False)
class Orientation:
    """Hold points of the part with their neighbours, and where they may go on the full surface.

    The two sides of a limb look alike and lie at equal distances from all that is far away. So a map may be right at
    both ends of a limb, and exchange front and back in between. It shows in that patch's orientation: it is laid down
    as its mirror image, while the rest is not. A map that mirrors everything is one of the two that a symmetric surface
    has, and is left alone.

    Parameters
    ----------
    places, normals
        (n, 3) of the points of the part, in units of sqrt(full area), and unit vectors.
    near, weight
        (n, k) the nearest of these points to each, and how much each counts: less where it is far, and nothing on the
        other side of a thin limb.
    on_part
        (n, k) complex coordinates of these neighbours in the tangent plane.
    vertices, outward
        (m, 3) of the full surface: vertices, in the same unit, and unit normals.

    Examples
    --------
    >>> import trimesh
    >>> from nonrigid.geometry.mesh import Mesh
    >>> ball = trimesh.creation.icosphere(subdivisions=3)
    >>> limb = Mesh(ball.vertices * [5, 1, 0.8], ball.faces)
    >>> found = Orientation.of(Pair.of(limb, limb), np.arange(642))
    >>> mirrored = cKDTree(limb.vertices).query(limb.vertices * [1, -1, 1])[1]
    >>> patch = np.where(np.abs(limb.vertices[:, 0]) < 2.5, mirrored, np.arange(642))
    >>> [float(found.turned_over(images).mean().round(1)) for images in (mirrored, patch, found.turned_back(patch))]
    [0.0, 0.5, 0.0]

    Source: this package. How to ask functional maps to keep orientation: Ren, Poulenard, Wonka, Ovsjanikov, "Continuous
    and orientation-preserving correspondences via functional maps", SIGGRAPH Asia 2018.
    """

    places: FloatArray
    normals: FloatArray
    near: IntArray
    weight: FloatArray
    on_part: NDArray[np.complex128]
    vertices: FloatArray
    outward: FloatArray

    @classmethod
    def of(cls, pair: Pair, points: IntArray) -> Orientation:
        """Return that of (n,) vertices of the part, spread evenly, at least two of them."""
        part, full = pair.part.mesh, pair.full.mesh
        places, normals = part.vertices[points], part.vertex_normals[points]
        ranks = np.arange(2, min(NEIGHBOURS + 1, len(points)) + 1)
        gap, near = (np.asarray(found) for found in cKDTree(places).query(places, k=ranks))
        facing = np.maximum(np.einsum("nkx,nx->nk", normals[near], normals), 0.0)
        # The farthest counts nothing: it may be one of several equally far, of which others were left out.
        weight = facing * (1.0 - np.square(gap / np.maximum(gap[:, -1:], 1e-300)))
        on_part = _tangent(places[near] - places[:, None], normals)
        return cls(places, normals, near, weight, on_part, full.vertices, full.vertex_normals)

    def sense(self, images: IntArray) -> FloatArray:
        """Return (n,) the sense in which each point's surroundings are laid down, 1 to -1: positive with most of them.

        With u and v the neighbours' complex coordinates in the two tangent planes, a patch that is only turned about
        has a large |sum conj(u) v|, and one that is turned over has a large |sum u v|. The sense is the difference of
        the two over the largest that either can be, averaged with the neighbours'.

        Parameters
        ----------
        images
            (n,) vertices of the full surface.
        """
        u, at = self.on_part, self.vertices[images]
        v = _tangent(at[self.near] - at[:, None], self.outward[images])
        length, far = np.abs(u), np.abs(v)
        v = v * np.minimum(1.0, 2.0 * length / np.maximum(far, 1e-300))  # an image far away must not outvote the rest
        most = np.maximum((self.weight * length * np.abs(v)).sum(axis=1), 1e-300)
        about, over = np.abs((self.weight * u.conj() * v).sum(axis=1)), np.abs((self.weight * u * v).sum(axis=1))
        alone = (about - over) / most
        around = (self.weight * alone[self.near]).sum(axis=1) / np.maximum(self.weight.sum(axis=1), 1e-300)
        sense = 0.5 * (alone + around)
        return np.asarray(sense * np.sign(sense.sum()))

    def turned_over(self, images: IntArray) -> BoolArray:
        """Return (n,) which points lie in patches that are laid down the other way round than the rest."""
        return np.asarray(self.sense(images) < TURNED)

    def turned_back(self, images: IntArray) -> IntArray:
        """Return images among which patches that were turned over are laid down anew, from their rims inwards.

        With a patch goes what lies around it and has no clear sense. Each point next to some that are the right way
        round goes where the rigid motion puts it that takes those to their images, normals and all, and then to the
        vertex nearest in place and normal; then it counts as right. A patch without such a rim stays as it is.

        Parameters
        ----------
        images
            (n,) vertices of the full surface.
        """
        sense, images = self.sense(images), images.copy()
        right = sense > 0.0
        left = self._patches(~right, sense < TURNED)
        while left.any():
            weight = self.weight * right[self.near]
            rim = np.flatnonzero(left & ((weight > _COUNTS).sum(axis=1) >= _ENOUGH))
            if not len(rim):
                break
            place, normal = self._moved(rim, weight[rim], images)
            images[rim] = self._targets.query(np.hstack([place, _NORMAL * normal]))[1]
            right[rim], left[rim] = True, False
        return images

    @cached_property
    def _targets(self) -> cKDTree:
        return cKDTree(np.hstack([self.vertices, _NORMAL * self.outward]))

    def _patches(self, among: BoolArray, seeds: BoolArray) -> BoolArray:
        """Return which points hang together with a seed through points `among` which it is."""
        near, points = self.near[:, :_JOINED], np.arange(len(among))
        joined = among[:, None] & among[near] & (self.weight[:, :_JOINED] > 0.0)
        row, column = np.nonzero(joined)
        graph = csr_array((np.ones(len(row)), (row, near[row, column])), shape=(len(points), len(points)))
        patch = connected_components(graph, directed=False)[1]
        return np.asarray(among & np.isin(patch, patch[seeds]))

    def _moved(self, points: IntArray, weight: FloatArray, images: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return (r, 3) where rigid motions of neighbours put points, and how their normals are turned."""
        near, share = self.near[points], weight / weight.sum(axis=1, keepdims=True)
        centre = np.einsum("nk,nkx->nx", share, self.places[near])
        target = np.einsum("nk,nkx->nx", share, self.vertices[images[near]])
        offsets, aims = self.places[near] - centre[:, None], self.vertices[images[near]] - target[:, None]
        moments = (share[:, None] * offsets.transpose(0, 2, 1)) @ aims
        normals, outward = self.normals[near], self.outward[images[near]]
        moments += _NORMAL**2 * (share[:, None] * normals.transpose(0, 2, 1)) @ outward
        left, _, right = np.linalg.svd(moments)
        turn = right.transpose(0, 2, 1) @ left.transpose(0, 2, 1)
        place = target + np.einsum("nxy,ny->nx", turn, self.places[points] - centre)
        return place, np.einsum("nxy,ny->nx", turn, self.normals[points])


def _tangent(offsets: FloatArray, normals: FloatArray) -> NDArray[np.complex128]:
    """Return (n, k) complex coordinates of (n, k, 3) offsets in planes with the given normals, counter-clockwise."""
    across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    along = np.cross(normals, across)
    real, imaginary = (np.einsum("nkx,nx->nk", offsets, axis) for axis in (across, along))
    return np.asarray(real + 1j * imaginary)
