"""Images of neighbours taken together: near by, a deforming surface moves almost as a rigid body does."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points

NEIGHBOURS = 120
"""Largest number of neighbours that a motion is fitted to: at 10,000 vertices they reach 0.06 of sqrt(area) far."""

ROUNDS = 4
"""How often a motion is fitted; in the second and later ones, neighbours that do not move with the rest count less."""

SUPPORTS = 10_000
"""Vertices of a full surface that are enough for its parts' motions; those of finer ones are thinned to samples."""

_BLOCK = 4096
"""Points at a time: a few hundred numbers of each are in memory."""


def moved_together(pair: Pair, images: SurfacePoints, *, reach: float, tolerance: float) -> SurfacePoints:
    """Return images of all vertices of the part, each moved to where those of its neighbours put it, on the surface.

    Parameters
    ----------
    images
        (n,) points of the full surface, one a vertex of the part.
    reach, tolerance
        In units of sqrt(full area); see `locally_rigid`.

    Returns
    -------
    (n,) points of the full surface, the closest to where `locally_rigid` puts them.
    """
    mesh = pair.part.mesh
    enough = int(np.ceil(SUPPORTS * pair.kept_area))
    fine = len(mesh.vertices) > 2 * enough
    among = np.sort(pair.part.samples(enough)) if fine else np.arange(len(mesh.vertices))
    places = images.positions(pair.full.mesh)
    moved = locally_rigid(mesh.vertices, mesh.vertex_normals, places, among=among, reach=reach, tolerance=tolerance)
    return closest_points(pair.full.mesh, moved)


def locally_rigid(
    points: FloatArray,
    normals: FloatArray,
    images: FloatArray,
    *,
    among: IntArray,
    reach: float,
    tolerance: float,
) -> FloatArray:
    """Return (n, 3) where the rigid motion that takes the neighbours of each point to their images puts it.

    The motion of p is the minimum of sum_q w(q) |R (q - p) + t - y(q)|^2 over orthogonal R and over t, which has a
    closed form; p goes to t. The weights are exp(-(|q - p| / reach)^2), less that of the farthest neighbour, times
    max(0, n(p).n(q)), so that the other side of a thin limb does not count, and, from the second of `ROUNDS` fits on,
    divided by 1 + (r(q) / tolerance)^2 with the residual r(q) of the fit before (Cauchy's loss).

    R may be a reflection: an intrinsic map may exchange left and right.

    Parameters
    ----------
    points, normals, images
        (n, 3) each; images in the unit of the points.
    among
        (m,) points that count as neighbours, spread evenly.
    reach, tolerance
        In the unit of the points.

    Examples
    --------
    >>> across = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    >>> plane = np.c_[across, np.zeros(25)]
    >>> up = np.tile([0.0, 0.0, 1.0], (25, 1))
    >>> images = plane + [7.0, 0.0, 0.0]
    >>> images[12] += [0.0, 0.9, 0.0]  # one is off
    >>> moved = locally_rigid(plane, up, images, among=np.arange(25), reach=1.5, tolerance=0.1)
    >>> bool(np.abs(moved - plane - [7.0, 0.0, 0.0]).max() < 0.01)
    True

    Source: rigid moving least squares, Schaefer, McPhail and Warren, "Image deformation using moving least squares",
    SIGGRAPH 2006, section 2.3; the loss is this package's choice.
    """
    ranks = np.arange(1, min(NEIGHBOURS, len(among)) + 1)
    gap, near = (np.asarray(found) for found in cKDTree(points[among]).query(points, k=ranks))
    near = among[near]
    weight = np.exp(-np.square(gap / reach))
    weight -= weight[:, -1:]  # the farthest may be one of several equally far, of which others were left out
    moved = np.empty_like(points)
    for start in range(0, len(points), _BLOCK):
        rows = slice(start, start + _BLOCK)
        facing = np.einsum("nkx,nx->nk", normals[near[rows]], normals[rows])
        sure = weight[rows] * np.maximum(facing, 0.0) + 1e-12
        offsets = (points[near[rows]] - points[rows, None]).transpose(0, 2, 1)
        targets = images[near[rows]].transpose(0, 2, 1)
        moved[rows] = _moved(np.ascontiguousarray(offsets), np.ascontiguousarray(targets), sure, tolerance)
    return moved


def _moved(offsets: FloatArray, images: FloatArray, weight: FloatArray, tolerance: float) -> FloatArray:
    """Return (n, 3) where motions of (n, 3, k) offsets to their images put the offset zero."""
    share = weight
    for _ in range(ROUNDS):
        share = share / share.sum(axis=1, keepdims=True)
        centre, target = (offsets @ share[:, :, None])[:, :, 0], (images @ share[:, :, None])[:, :, 0]
        moments = (offsets * share[:, None]) @ images.transpose(0, 2, 1) - centre[:, :, None] * target[:, None]
        left, _, right = np.linalg.svd(moments)
        turn = right.transpose(0, 2, 1) @ left.transpose(0, 2, 1)
        moved = target - (turn @ centre[:, :, None])[:, :, 0]
        apart = images - turn @ offsets
        apart -= moved[:, :, None]
        share = weight / (1.0 + np.einsum("nxk,nxk->nk", apart, apart) / tolerance**2)
    return np.asarray(moved)
