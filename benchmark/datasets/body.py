"""Build the skin of a creature, and pose it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, diags_array, eye_array
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.datasets.anatomy import Anatomy, Bone, Flesh, Vector
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import isosurface


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """Hold the dense neutral skin of a creature and how much of it each bone carries.

    Parameters
    ----------
    anatomy
        With both sides written out.
    skin
        The dense neutral surface; all dense poses share its triangles.
    weights
        (n, bones) nonnegative; each row sums to one.
    """

    anatomy: Anatomy
    skin: Mesh
    weights: FloatArray

    def posed(self, pose: dict[str, Vector]) -> Mesh:
        """Return the skin with the bones turned, by linear blend skinning: v -> sum_b w_b (R_b v + t_b)."""
        rotations, translations = _motions(self.anatomy.bones, pose)
        moved = np.einsum("bxy,ny->nbx", rotations, self.skin.vertices) + translations
        return Mesh(np.einsum("nb,nbx->nx", self.weights, moved), self.skin.faces, name=self.skin.name)


def build_body(anatomy: Anatomy, vertex_count: int) -> Body:
    """Build the neutral skin of an anatomy with about `vertex_count` vertices.

    The flesh f_i (round cones about bones, and ellipsoids) melts into f = -k log sum_i exp(-f_i / k) with k the
    anatomy's `blend`; marching cubes triangulate f = 0. Each vertex first belongs to the bone of its nearest flesh;
    diffusion along the skin over the anatomy's `softness` then makes the weights smooth without reaching from one leg
    to the other.
    """
    anatomy = anatomy.both_sides()
    parts: tuple[Bone | Flesh, ...] = (*anatomy.bones, *anatomy.flesh)
    corners = np.concatenate([_box(part) for part in parts])
    lower, upper = corners.min(axis=0) - 3 * anatomy.blend, corners.max(axis=0) + 3 * anatomy.blend

    def field(places: FloatArray) -> FloatArray:
        total = np.full(len(places), 1e-30)
        for part in parts:
            low, high = _box(part) + 8 * anatomy.blend * np.array([[-1.0], [1.0]])
            near = np.arange(len(places))
            for axis in (2, 1, 0):
                here = places[near, axis]
                near = near[(here >= low[axis]) & (here <= high[axis])]
            total[near] += np.exp(np.minimum(-_distance(part, places[near]) / anatomy.blend, 300.0))
        return np.asarray(-anatomy.blend * np.log(total), dtype=np.float64)

    coarse = isosurface(field, lower, upper, 0.03)
    # The count goes with the inverse square of the spacing; a coarse try measures the factor for this surface.
    spacing = 0.03 * np.sqrt(len(coarse.vertices) / vertex_count)
    skin = isosurface(field, lower, upper, spacing, name=anatomy.name)
    number = {bone.name: place for place, bone in enumerate(anatomy.bones)}
    bone_of_part = np.array([number[part.name if isinstance(part, Bone) else part.bone] for part in parts])
    nearest = np.stack([_distance(part, skin.vertices) for part in parts]).argmin(axis=0)
    weights = _diffused(skin, bone_of_part[nearest], len(anatomy.bones), anatomy.softness)
    return Body(anatomy=anatomy, skin=skin, weights=weights)


def _distance(part: Bone | Flesh, places: FloatArray) -> FloatArray:
    """Return about the signed distance of (p, 3) places to a part, negative inside."""
    if isinstance(part, Bone):
        start, end = np.array(part.start), np.array(part.end)
        along = np.clip((places - start) @ (end - start) / np.sum((end - start) ** 2), 0.0, 1.0)
        gap = np.linalg.norm(places - start - along[:, None] * (end - start), axis=1)
        return np.asarray(gap - part.radii[0] - along * (part.radii[1] - part.radii[0]), dtype=np.float64)
    offset, radii = places - np.array(part.centre), np.array(part.radii)
    level = np.linalg.norm(offset / radii, axis=1)
    slope = np.linalg.norm(offset / radii**2, axis=1)
    depth = np.where(slope > 1e-9, level * (level - 1.0) / np.maximum(slope, 1e-9), -radii.min())
    return np.asarray(depth, dtype=np.float64)


def _box(part: Bone | Flesh) -> FloatArray:
    """(2, 3) lower and upper corner of a box about a part."""
    if isinstance(part, Bone):
        ends, reach = np.array([part.start, part.end]), max(part.radii)
        return np.stack([ends.min(axis=0) - reach, ends.max(axis=0) + reach])
    centre, radii = np.array(part.centre), np.array(part.radii)
    return np.stack([centre - radii, centre + radii])


def _diffused(skin: Mesh, bone: IntArray, bone_count: int, length: float) -> FloatArray:
    """Solve (I + t L) W = W0 with the graph Laplacian, whose solution stays between 0 and 1 on any triangulation."""
    n = len(skin.vertices)
    i, j = skin.edges.T
    adjacency = coo_array((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n)).tocsr()
    degree: FloatArray = np.bincount(np.r_[i, j], minlength=n).astype(np.float64)
    laplacian = diags_array(degree) - adjacency
    mean_square = float(np.mean(np.sum((skin.vertices[i] - skin.vertices[j]) ** 2, axis=1)))
    # With six neighbours at distance h the graph Laplacian is 3/2 h^2 times the continuous one.
    step = length**2 / (1.5 * mean_square)
    sharp = np.zeros((n, bone_count))
    sharp[np.arange(n), bone] = 1.0
    solver = splu(
        (eye_array(n) + step * laplacian).tocsc(),
        permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True},
    )  # fmt: skip
    smooth = np.clip(solver.solve(sharp), 0.0, None)
    return np.asarray(smooth / smooth.sum(axis=1, keepdims=True))


def _motions(bones: tuple[Bone, ...], pose: dict[str, Vector]) -> tuple[FloatArray, FloatArray]:
    """Return the (bones, 3, 3) rotations and (bones, 3) translations; parents stand before their children."""
    motion: dict[str, tuple[FloatArray, FloatArray]] = {"": (np.eye(3), np.zeros(3))}
    for bone in bones:
        carried, shift = motion[bone.parent]
        turn = Rotation.from_rotvec(pose.get(bone.name, (0.0, 0.0, 0.0)), degrees=True).as_matrix()
        joint = np.array(bone.start)
        motion[bone.name] = (carried @ turn, carried @ (joint - turn @ joint) + shift)
    return np.stack([motion[bone.name][0] for bone in bones]), np.stack([motion[bone.name][1] for bone in bones])
