"""Shapes in several poses with the truth between them, from which parts can be made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.cache import Arrays, content_hash
from nonrigid.geometry.frame import canonical_priority
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points, decimate

DIGITS = 6
"""Coordinates are rounded to this many digits after the point of a mesh whose area is one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PosedShape:
    """Hold a complete shape in a pose, and for each of its n vertices the point of the template it corresponds to.

    Parameters
    ----------
    mesh
        The pose, with a triangulation of its own.
    truth, mirrored
        (n,) points of the template, and those of the left-right mirrored map; None where that is not known.
    """

    mesh: Mesh
    truth: SurfacePoints
    mirrored: SurfacePoints | None


class PosedClass(Protocol):
    """Offer a template and poses of it; picklable, so that parts can be made in other processes."""

    @property
    def name(self) -> str:
        """Name of the class."""
        ...

    @property
    def key(self) -> str:
        """Text that differs whenever the template or a pose does; part of the cache's keys."""
        ...

    @property
    def pose_names(self) -> tuple[str, ...]:
        """Names of the poses."""
        ...

    @property
    def has_mirrored(self) -> bool:
        """Whether the left-right mirrored map is known."""
        ...

    def template(self) -> Mesh:
        """Return the shape to which all poses correspond."""
        ...

    def posed(self, pose: str) -> PosedShape:
        """Return a pose, by its name."""
        ...


def remeshed(dense: Mesh, vertices: int, seed: int) -> Mesh:
    """Return a decimation that shares neither triangulation nor numbering with that of another pose.

    Where a limb moves rigidly the dense triangles are the same in both poses and would collapse in the same order.
    Hence each dense vertex first slides towards the centre of a random triangle beside it, staying on the dense
    surface. What is random goes by the shape, not by the order of the vertices of `dense`.
    """
    dense = _in_canonical_order(dense)
    generator = np.random.default_rng(seed)
    face = np.empty(len(dense.vertices), dtype=np.int64)
    order = generator.permutation(3 * len(dense.faces))
    face[dense.faces.ravel()[order]] = order // 3
    centre = dense.vertices[dense.faces[face]].mean(axis=1)
    share = generator.uniform(0.0, 0.5, size=(len(face), 1))
    small = decimate(Mesh(dense.vertices + share * (centre - dense.vertices), dense.faces, name=dense.name), vertices)
    number = generator.permutation(len(small.vertices))
    corners = np.argsort(number)[small.faces]
    digits = DIGITS - round(0.5 * float(np.log10(dense.area)))
    return Mesh(small.vertices[number].round(digits), corners[generator.permutation(len(corners))], name=dense.name)


def through_dense(mesh: Mesh, dense: Mesh, neutral: Mesh) -> FloatArray:
    """Carry the vertices of a remeshed pose over to the neutral pose by dense meshes with the same triangles.

    The closest point of the dense pose, and on the dense neutral surface the point with the same triangle and weights.

    Returns
    -------
    (n, 3) positions on `neutral`.
    """
    return closest_points(dense, mesh.vertices).positions(neutral)


def shape_arrays(shape: PosedShape) -> Arrays:
    """Return a posed shape as arrays for the cache; see `shape_from_arrays`."""
    arrays: Arrays = {"vertices": shape.mesh.vertices, "faces": shape.mesh.faces}
    for role, points in (("truth", shape.truth), ("mirrored", shape.mirrored)):
        if points is not None:
            arrays |= {f"{role} faces": points.faces, f"{role} weights": points.barycentric}
    return arrays


def shape_from_arrays(arrays: Arrays, name: str) -> PosedShape:
    """Return the posed shape that `shape_arrays` took apart."""
    points = {
        role: SurfacePoints(arrays[f"{role} faces"], arrays[f"{role} weights"])
        for role in ("truth", "mirrored")
        if f"{role} faces" in arrays
    }
    mesh = Mesh(arrays["vertices"], arrays["faces"], name=name)
    return PosedShape(mesh=mesh, truth=points["truth"], mirrored=points.get("mirrored"))


def seed_of(*parts: object) -> int:
    """Return a seed that differs with every part."""
    return int(content_hash(*parts)[:15], 16)


def _in_canonical_order(mesh: Mesh) -> Mesh:
    order = np.argsort(canonical_priority(mesh), kind="stable")
    faces = np.argsort(order)[mesh.faces]
    start = faces.argmin(axis=1)
    faces = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    return Mesh(mesh.vertices[order], faces[np.lexsort(faces.T[::-1])], name=mesh.name)
