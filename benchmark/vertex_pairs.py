"""Distances between given pairs of vertices, from no more sources than these pairs need."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import dijkstra

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.cache import default_cache
from nonrigid.geometry.errors import UnknownNameError
from nonrigid.geometry.geodesics import EdgeFlip, make_geodesics, virtual_edge_graph
from nonrigid.geometry.mesh import Mesh

METRICS = ("dijkstra", "edgeflip", "exact", "heat")
"""The ways of measuring; all but "dijkstra" need a clean mesh."""

_NEAR = 0.1
"""Radius of the first Dijkstra pass over sqrt(area): most errors are below it, and such a ball is 3 % of the area."""
_BLOCK = 128
"""Sources at a time, which bounds the memory that their rows take."""


def check_metric(name: str) -> str:
    """Return the name, or raise `UnknownNameError` if it is not one of `METRICS`."""
    if name not in METRICS:
        raise UnknownNameError("geodesics", name, METRICS)
    return name


def vertex_pair_distances(
    mesh: Mesh, a: IntArray, b: IntArray, *, geodesics: str = "dijkstra", up_to: FloatArray | None = None
) -> FloatArray:
    """Return the (k,) distances along `mesh` between vertices a[i] and b[i], in its unit; inf where no way joins them.

    The slow ways, all but "dijkstra", are kept in the cache of derived geometry. With (k,) lengths `up_to` a greater
    distance may be given as inf, which saves most of the time where these are small; the slow ways pay no heed to it.

    Raises
    ------
    UnknownNameError
        If `geodesics` is not one of `METRICS`.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> vertex_pair_distances(square, np.array([1, 0]), np.array([3, 1])).round(4)
    array([1.4142, 1.    ])
    """
    check_metric(geodesics)
    if not len(a):
        return np.zeros(0)
    if geodesics == "dijkstra":
        return _by_dijkstra(mesh, a, b, np.full(len(a), np.inf) if up_to is None else up_to)
    key = ("vertex pair distances", geodesics, mesh.vertices, mesh.faces, a, b)
    stored = default_cache().fetch(key, lambda: {"distances": _by_geodesics(mesh, a, b, geodesics)})
    return np.asarray(stored["distances"], dtype=np.float64)


def _by_geodesics(mesh: Mesh, a: IntArray, b: IntArray, method: str) -> FloatArray:
    if method == "edgeflip":
        pairs, place = np.unique(np.sort(np.stack([a, b], axis=1), axis=1), axis=0, return_inverse=True)
        return np.asarray(EdgeFlip(mesh).distance_pairs(pairs[:, 0], pairs[:, 1])[place.ravel()], dtype=np.float64)
    solver = make_geodesics(mesh, method)
    a, b = _fewer_first(a, b)
    sources, row = np.unique(a, return_inverse=True)
    found = np.empty(len(a))
    for start in range(0, len(sources), _BLOCK):
        mine = np.flatnonzero((row >= start) & (row < start + _BLOCK))
        found[mine] = solver.distances(sources[start : start + _BLOCK])[row[mine] - start, b[mine]]
    return found


def _by_dijkstra(mesh: Mesh, a: IntArray, b: IntArray, up_to: FloatArray) -> FloatArray:
    a, b = _fewer_first(a, b)
    graph = virtual_edge_graph(mesh)
    found = np.full(len(a), np.inf)
    reached, near = -np.inf, _NEAR * np.sqrt(mesh.area)
    for most in (np.minimum(up_to, near), up_to):
        left = np.flatnonzero(np.isinf(found) & (most > reached))
        sources, row = np.unique(a[left], return_inverse=True)
        need = np.full(len(sources), -np.inf)
        np.maximum.at(need, row, most[left])
        order = np.argsort(need, kind="stable")  # sources that need go equally far share a block
        place = np.argsort(order)[row]
        for start in range(0, len(sources), _BLOCK):
            block, mine = order[start : start + _BLOCK], np.flatnonzero((place >= start) & (place < start + _BLOCK))
            rows = dijkstra(graph, directed=True, indices=sources[block], limit=float(need[block[-1]]))
            found[left[mine]] = rows[place[mine] - start, b[left[mine]]]
        reached = near
    return found


def _fewer_first(a: IntArray, b: IntArray) -> tuple[IntArray, IntArray]:
    """Put the side with fewer distinct vertices first: it gives the sources."""
    return (a, b) if len(np.unique(a)) <= len(np.unique(b)) else (b, a)
