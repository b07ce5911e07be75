"""Cut posed shapes by planes through their template."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.frame import canonical_frame
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import largest_piece
from nonrigid.geometry.points import SurfacePoints

KEEPS = (0.12, 0.85)
"""A plane serves if it keeps an area fraction of the template in this range; the real cuts keep 0.12 to 0.93."""

_TRIES = 200


def cut_planes(template: Mesh, count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Draw planes through points near the centroid of the template.

    Points and normals are drawn in the template's own frame, so that they move with it.

    Returns
    -------
    (count, 3) points, within a tenth of sqrt(area) of the area's centroid along each axis, in the unit of the mesh;
    (count, 3) unit normals, uniform over all directions.
    """
    generator = np.random.default_rng(seed)
    centroid, axes = canonical_frame(template)
    # Drawn plane by plane: fewer planes are the first of more planes.
    drawn = [(generator.uniform(-1.0, 1.0, size=3), generator.normal(size=3)) for _ in range(count)]
    offsets, normals = (np.array(part) for part in zip(*drawn, strict=True))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return centroid + 0.1 * np.sqrt(template.area) * offsets @ axes.T, normals @ axes.T


def serving_planes(template: Mesh, count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the first `count` of `cut_planes` that keep a fraction within `KEEPS` of the template's area.

    Raises
    ------
    InputError
        If two hundred planes hold too few of them.
    """
    truth = SurfacePoints.at_vertices(template, np.arange(len(template.vertices)))
    points, normals = cut_planes(template, _TRIES, seed)
    serving: list[int] = []
    for number in range(_TRIES):
        kept = _side(template, truth, template, points[number], normals[number])
        if kept.any():
            kept = largest_piece(template, kept)
        if KEEPS[0] <= template.face_areas[kept].sum() / template.area <= KEEPS[1]:
            serving.append(number)
        if len(serving) == count:
            return points[serving], normals[serving]
    raise InputError(
        f"{len(serving)} of {_TRIES} planes keep {KEEPS[0]:.0%} to {KEEPS[1]:.0%} of {template.name}, not {count}",
        remedy="change the seed, or ask for fewer planes",
    )


def cut_by_plane(
    mesh: Mesh, truth: SurfacePoints, template: Mesh, *, point: FloatArray, normal: FloatArray
) -> BoolArray:
    """Keep what lies on the normal's side of a plane through the template, carried over to a pose by the ground truth.

    A vertex of the pose is on the side on which its true point of the template is; a triangle is kept if all its
    corners are, so that the boundary follows the triangles. Of the pieces, joined through edges, the largest is kept.

    Parameters
    ----------
    mesh
        The pose, with n vertices and m faces.
    truth
        (n,) the points of the template they correspond to.

    Returns
    -------
    (m,) whether each face is kept.

    Raises
    ------
    InputError
        If nothing is left.
    """
    kept = _side(mesh, truth, template, point, normal)
    if not kept.any():
        raise InputError(f"the plane leaves nothing of {mesh.name}", remedy="move it towards the centroid")
    return largest_piece(mesh, kept)


def _side(mesh: Mesh, truth: SurfacePoints, template: Mesh, point: FloatArray, normal: FloatArray) -> BoolArray:
    kept_vertex = (truth.positions(template) - point) @ normal > 0
    return np.asarray(kept_vertex[mesh.faces].all(axis=1))
