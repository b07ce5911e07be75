"""Build the skin of a creature, and pose it."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.sparse import coo_array, diags_array, eye_array
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.datasets.anatomy import Anatomy, Bone, Cone, Ellipsoid, Flesh, Pose
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import isosurface

_CORE = 0.05
"""Share of each bone's skin, where it carries most, that goes rigidly with it."""

_ROUNDS = 20
"""Rounds of relaxation; lengths change little after ten."""

_REACH = 9.0
"""Flesh is left out where it is farther than so many times its blend: it would add less than e^-9."""


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

    def posed(self, pose: Pose) -> Mesh:
        """Return the skin with the bones turned.

        Linear blend skinning, v -> sum_b w_b (R_b v + t_b), squeezes skin at bent joints. It is only the start: the
        core of each bone's skin goes with the bone, and the rest relaxes to be as rigid as possible.

        Source: Sorkine and Alexa 2007, "As-rigid-as-possible surface modeling".
        """
        rotations, translations = _motions(self.anatomy.bones, pose)
        moved = np.einsum("bxy,ny->nbx", rotations, self.skin.vertices) + translations
        start = np.einsum("nb,nbx->nx", self.weights, moved)
        held, bone = _cores(self.weights)
        start[held] = moved[held, bone]
        relaxation = igl.ARAPData()
        relaxation.max_iter = _ROUNDS
        vertices, faces = np.array(self.skin.vertices), np.array(self.skin.faces)
        igl.arap_precomputation(vertices, faces, 3, held.astype(np.int32), relaxation)
        placed = igl.arap_solve(np.asfortranarray(start[held]), relaxation, np.asfortranarray(start))
        return Mesh(placed, self.skin.faces, name=self.skin.name)


def build_body(anatomy: Anatomy, vertex_count: int) -> Body:
    """Build the neutral skin of an anatomy with about `vertex_count` vertices.

    The flesh, at distance f_i (round cones and ellipsoids), melts into the surface sum_i exp(-f_i / k_i) = 1, where k_i
    is the `blend` of each; marching cubes triangulate it. Each vertex first belongs to the bone of its nearest flesh;
    diffusion along the skin over the anatomy's `softness` then makes the weights smooth without reaching from one leg
    to the other.
    """
    anatomy = anatomy.both_sides()
    parts: tuple[Bone | Flesh, ...] = (*(bone for bone in anatomy.bones if any(bone.radii)), *anatomy.flesh)
    reach = np.array([_REACH * _blend(part, anatomy) for part in parts])
    boxes = np.stack([_box(part) for part in parts]) + reach[:, None, None] * np.array([[-1.0], [1.0]])
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)

    def field(places: FloatArray) -> FloatArray:
        near = (boxes[:, 0] <= places.max(axis=0)) & (boxes[:, 1] >= places.min(axis=0))
        total = np.full(len(places), 1e-30)
        for number in np.flatnonzero(near.all(axis=1)):
            part = parts[number]
            total += np.exp(np.minimum(-_distance(part, places) / _blend(part, anatomy), 300.0))
        return np.asarray(-np.log(total), dtype=np.float64)

    coarse = isosurface(field, lower, upper, 0.03)
    # The count goes with the inverse square of the spacing; a coarse try measures the factor for this surface.
    spacing = 0.03 * np.sqrt(len(coarse.vertices) / vertex_count)
    skin = isosurface(field, lower, upper, spacing, name=anatomy.name)
    number = {bone.name: place for place, bone in enumerate(anatomy.bones)}
    bone_of_part = np.array([number[part.name if isinstance(part, Bone) else part.bone] for part in parts])
    nearest = np.stack([_distance(part, skin.vertices) for part in parts]).argmin(axis=0)
    weights = _diffused(skin, bone_of_part[nearest], len(anatomy.bones), anatomy.softness)
    return Body(anatomy=anatomy, skin=skin, weights=weights)


def _cores(weights: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the vertices that go rigidly with a bone, and these bones."""
    owner, share = weights.argmax(axis=1), weights.max(axis=1)
    core = np.zeros(len(weights), dtype=bool)
    for bone in np.unique(owner):
        mine = owner == bone
        core |= mine & (share >= np.quantile(share[mine], 1.0 - _CORE))
    return np.flatnonzero(core), owner[core]


def _blend(part: Bone | Flesh, anatomy: Anatomy) -> float:
    return anatomy.blend if isinstance(part, Bone) else part.blend or anatomy.blend


def _distance(part: Bone | Flesh, places: FloatArray) -> FloatArray:
    """Return about the signed distance of (p, 3) places to a part, negative inside."""
    if isinstance(part, Bone | Cone):
        start, end = np.array(part.start), np.array(part.end)
        along = np.clip((places - start) @ (end - start) / np.sum((end - start) ** 2), 0.0, 1.0)
        gap = _length(places - start - along[:, None] * (end - start))
        return np.asarray(gap - part.radii[0] - along * (part.radii[1] - part.radii[0]), dtype=np.float64)
    offset, radii = (places - np.array(part.centre)) @ _turn(part), np.array(part.radii)
    level = _length(offset / radii)
    slope = _length(offset / radii**2)
    depth = np.where(slope > 1e-9, level * (level - 1.0) / np.maximum(slope, 1e-9), -radii.min())
    return np.asarray(depth, dtype=np.float64)


def _length(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", rows, rows)))


def _box(part: Bone | Flesh) -> FloatArray:
    """(2, 3) lower and upper corner of a box about a part."""
    if isinstance(part, Bone | Cone):
        ends, reach = np.array([part.start, part.end]), max(part.radii)
        return np.stack([ends.min(axis=0) - reach, ends.max(axis=0) + reach])
    centre = np.array(part.centre)
    reach = np.linalg.norm(_turn(part) * np.array(part.radii), axis=1)
    return np.stack([centre - reach, centre + reach])


def _turn(part: Ellipsoid) -> FloatArray:
    return np.asarray(Rotation.from_rotvec(part.turn, degrees=True).as_matrix(), dtype=np.float64)


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


def _motions(bones: tuple[Bone, ...], pose: Pose) -> tuple[FloatArray, FloatArray]:
    """Return the (bones, 3, 3) rotations and (bones, 3) translations; parents stand before their children."""
    motion: dict[str, tuple[FloatArray, FloatArray]] = {"": (np.eye(3), np.zeros(3))}
    for bone in bones:
        carried, shift = motion[bone.parent]
        turn = Rotation.from_rotvec(pose.get(bone.name, (0.0, 0.0, 0.0)), degrees=True).as_matrix()
        joint = np.array(bone.start)
        motion[bone.name] = (carried @ turn, carried @ (joint - turn @ joint) + shift)
    return np.stack([motion[bone.name][0] for bone in bones]), np.stack([motion[bone.name][1] for bone in bones])
