"""The check that stands before solvers which crash on surfaces that are not manifolds."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nonrigid.geometry.arrays import IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh

FLAT = 1e-14  # a triangle with less area than this, against its longest edge squared, has no interior left to cross


def check_manifold(mesh: Mesh, method: str) -> None:
    """Raise `InputError` unless the surface is an oriented manifold, with or without boundary, of proper triangles.

    That is: no triangle names a vertex twice or has no area, every edge is used by one triangle or by two of opposite
    direction, the triangles at each vertex form one fan, and every vertex is in a triangle. It may have several
    components. `method` is named in the message.

    Examples
    --------
    >>> check_manifold(Mesh(np.eye(3), [[0, 1, 2]]), "exact")
    >>> check_manifold(Mesh(np.eye(3), [[0, 1, 2], [2, 1, 0], [1, 2, 0]]), "exact")
    Traceback (most recent call last):
    nonrigid.geometry.errors.InputError: mesh cannot be measured by the method 'exact': 3 edges are used by more than...
    """
    for count, fault in _faults(mesh):
        if count:
            raise InputError(
                f"{mesh.name} cannot be measured by the method {method!r}: {count} {fault}",
                remedy="use the method 'dijkstra', or nonrigid.geometry.clean, which mends all but flat triangles",
            )


def _faults(mesh: Mesh) -> tuple[tuple[int, str], ...]:
    faces, n = mesh.faces, len(mesh.vertices)
    twice = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    sides = mesh.vertices[faces] - mesh.vertices[np.roll(faces, 1, axis=1)]
    flat = mesh.face_areas <= FLAT * np.einsum("fcx,fcx->fc", sides, sides).max(axis=1)
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge = np.minimum(tails, heads) * n + np.maximum(tails, heads)
    edge_uses = np.unique(edge, return_counts=True)[1]
    directed_uses = np.unique(tails * n + heads, return_counts=True)[1]
    fans = _fans_of_vertex(mesh, edge)
    return (
        (int(twice.sum()), "triangles name a vertex twice"),
        (int((flat & ~twice).sum()), "triangles have no area"),
        (int((edge_uses > 2).sum()), "edges are used by more than two triangles"),
        (int((directed_uses > 1).sum()), "edges are used twice in the same direction"),
        (int((fans > 1).sum()), "vertices join several fans of triangles"),
        (int((fans == 0).sum()), "vertices are in no triangle"),
    )


def _fans_of_vertex(mesh: Mesh, edge: IntArray) -> IntArray:
    """(n,) number of fans: classes of corners at the vertex that are joined across edges."""
    corners = np.arange(mesh.faces.size)
    after = corners - corners % 3 + (corners + 1) % 3  # wraps inside each triangle, as 3 divides its first corner
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(edge[order][1:] == edge[order][:-1])
    first, second = order[same], order[same + 1]
    i, j = np.concatenate([first, after[first]]), np.concatenate([after[second], second])
    count, fan = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(len(corners),) * 2), directed=False)
    vertex_of_fan = np.empty(count, dtype=np.int64)
    vertex_of_fan[fan] = mesh.faces.ravel()
    return np.bincount(vertex_of_fan, minlength=len(mesh.vertices)).astype(np.int64)
