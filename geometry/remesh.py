"""Make triangle meshes: of an implicit surface, or of another mesh with fewer vertices; and find points on them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import igl
import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

OFF_TARGET = 0.1
"""Share of the vertices asked for by which a collapsed mesh may have more or fewer."""

BRICK = 16
"""Grid points along each side of the bricks in which a field is evaluated."""


def closest_points(mesh: Mesh, positions: FloatArray) -> SurfacePoints:
    """Return the (p,) points of the surface closest to (p, 3) positions in space; unmatched where one is not finite.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> closest_points(triangle, np.array([[0.5, 0.25, 9.0]])).barycentric
    array([[0.25, 0.5 , 0.25]])
    """
    given = np.asarray(positions, dtype=np.float64)
    known = np.isfinite(given).all(axis=1)
    if not known.all():
        faces, weights = np.full(len(given), -1, dtype=np.int64), np.zeros((len(given), 3))
        if known.any():
            found = closest_points(mesh, given[known])
            faces[known], weights[known] = found.faces, found.barycentric
        return SurfacePoints(faces, weights)
    place = np.ascontiguousarray(given)
    _, face, closest = igl.point_mesh_squared_distance(place, mesh.vertices, mesh.faces)
    corners = [np.ascontiguousarray(mesh.vertices[mesh.faces[face, c]]) for c in range(3)]
    weights = np.asarray(igl.barycentric_coordinates(np.ascontiguousarray(closest), *corners))
    # A face without area has no barycentric coordinates: its nearest corner stands for it.
    wrong = ~(np.abs(weights.sum(axis=1) - 1.0) < 1e-6) | (weights < -1e-3).any(axis=1)
    if wrong.any():
        gap = np.stack([np.linalg.norm(corner[wrong] - closest[wrong], axis=1) for corner in corners], axis=1)
        weights[wrong] = np.eye(3)[gap.argmin(axis=1)]
    weights = np.clip(weights, 0.0, None)
    return SurfacePoints(face, weights / weights.sum(axis=1, keepdims=True))


def isosurface(
    field: Callable[[FloatArray], FloatArray], lower: ArrayLike, upper: ArrayLike, spacing: float, *, name: str = "mesh"
) -> Mesh:
    """Triangulate the zero set of a field by marching cubes on a regular grid.

    Parameters
    ----------
    field
        From (p, 3) positions to (p,) values, negative inside. It is asked brick by brick, for places near each other.
    lower, upper
        Two corners of a box; the surface is closed if it stays inside.
    spacing
        Edge length of the cubes, in the unit of the box.

    Raises
    ------
    InputError
        If the field has one sign on the whole grid.

    Examples
    --------
    >>> ball = isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.1)
    >>> round(ball.area / (4 * np.pi), 2), len(ball.boundary_edges)
    (1.0, 0)
    """
    low = np.asarray(lower, dtype=float)
    size = np.ceil((np.asarray(upper, dtype=float) - low) / spacing).astype(int) + 1
    ax, ay, az = (low[axis] + spacing * np.arange(size[axis]) for axis in range(3))
    z, y, x = np.meshgrid(az, ay, ax, indexing="ij")
    grid = np.stack([x, y, z], axis=3)
    values = np.empty(z.shape)
    # Brick by brick: a field made of many parts can leave out those that are far from a brick.
    for brick in product(*(range(0, count, BRICK) for count in z.shape)):
        here = tuple(slice(start, start + BRICK) for start in brick)
        places = grid[here]
        values[here] = field(places.reshape(-1, 3)).reshape(places.shape[:3])
    counts = (int(count) for count in size)
    vertices, faces, _ = igl.marching_cubes(values.ravel(), grid.reshape(-1, 3), *counts, 0.0)
    if not len(faces):
        raise InputError("the field has one sign on the whole grid", remedy="give a box around the surface")
    return Mesh(vertices, faces, name=name)


def decimate(mesh: Mesh, vertex_count: int) -> Mesh:
    """Collapse edges by quadric error until about `vertex_count` vertices are left.

    Boundary loops and manifoldness stay; vertices in no face go. The vertex count is met up to a few, and up to
    `OFF_TARGET` where there is a boundary: a collapse there takes one face only.

    Raises
    ------
    InputError
        If the mesh has fewer vertices than asked for, fewer than four are asked for, or the count cannot be met; or the
        mesh is not manifold, which collapsing edges may never end with.

    Source: Garland and Heckbert 1997, "Surface simplification using quadric error metrics".
    """
    in_use = len(np.unique(mesh.faces))
    if not 4 <= vertex_count <= in_use:
        raise InputError(
            f"{vertex_count} vertices asked of {mesh.name} with {in_use}",
            remedy="ask for fewer, at least 4",
        )
    pinched = len(igl.split_nonmanifold(np.ascontiguousarray(mesh.faces))[1]) - in_use
    if pinched:
        raise InputError(
            f"{mesh.name} is not manifold: {pinched} vertices join what only touches",
            remedy="repair it first, by nonrigid.geometry.clean.clean",
        )
    # Each collapse takes one vertex and two faces, or one face at a boundary.
    fewest, most = max(1, len(mesh.faces) - 2 * (in_use - vertex_count)), len(mesh.faces)
    small, face_count = _collapsed(mesh, fewest), fewest
    while abs(len(small.vertices) - vertex_count) > OFF_TARGET * vertex_count and most - fewest > 1:
        fewest, most = (face_count, most) if len(small.vertices) < vertex_count else (fewest, face_count)
        face_count = (fewest + most) // 2
        small = _collapsed(mesh, face_count)
    if abs(len(small.vertices) - vertex_count) > OFF_TARGET * vertex_count:
        raise InputError(
            f"{mesh.name} cannot be brought from {in_use} to {vertex_count} vertices: it ends with"
            f" {len(small.vertices)}",
            remedy="ask for more; boundary loops stay",
        )
    return small


def _collapsed(mesh: Mesh, face_count: int) -> Mesh:
    """Collapse edges until at most so many faces are left."""
    vertices, faces, _, _ = igl.qslim(np.asfortranarray(mesh.vertices), np.asfortranarray(mesh.faces), face_count)
    return Mesh(np.ascontiguousarray(vertices), np.ascontiguousarray(faces), name=mesh.name)
