"""Spread samples over a surface, the same ones in whatever order and frame its vertices come."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.sparse.csgraph import dijkstra

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.frame import canonical_priority, farthest
from nonrigid.geometry.geodesics.dijkstra import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh


def farthest_points(
    mesh: Mesh,
    count: int,
    *,
    metric: Literal["euclidean", "geodesic"] = "euclidean",
    start: int | None = None,
) -> IntArray:
    """Choose `count` vertices, each the farthest from those before it.

    The first is `start`, or else the vertex farthest from the area-weighted centroid. Among vertices whose distance is
    within 1e-9 of the largest, relatively, the one with the largest `canonical_priority` is taken, so mirror-symmetric
    shapes give the same samples in every frame and vertex order. A shape that a rotation maps onto itself gives
    samples equal up to such a rotation.

    Parameters
    ----------
    metric
        "euclidean": straight distances; "geodesic": shortest paths on `virtual_edge_graph`.

    Returns
    -------
    samples
        (count,) vertex numbers in the order chosen; a shorter prefix is the answer for a smaller count.

    Raises
    ------
    InputError
        If `count` is not in 1 ... n, or `start` is not a vertex.

    Examples
    --------
    >>> strip = Mesh([[0, 0, 0], [1, 0, 0], [4, 0, 0], [0, 1, 0]], [[0, 1, 3], [1, 2, 3]])
    >>> farthest_points(strip, 3)
    array([2, 3, 1])

    Source: Hochbaum and Shmoys (1985); Gonzalez (1985).
    """
    n = len(mesh.vertices)
    if not 1 <= count <= n:
        raise InputError(f"{count} samples of {n} vertices", remedy=f"ask for 1 to {n}")
    if start is not None and not 0 <= start < n:
        raise InputError(f"start vertex {start} of {n}", remedy=f"vertex numbers run from 0 to {n - 1}")
    if metric == "euclidean":
        distances_from = _euclidean(mesh)
    elif metric == "geodesic":
        distances_from = _geodesic(mesh)
    else:
        raise UnknownNameError("metric", metric, ("euclidean", "geodesic"))
    priority = canonical_priority(mesh)
    samples = np.empty(count, dtype=np.int64)
    samples[0] = farthest(_centroid_distances(mesh), priority) if start is None else start
    cover = np.full(n, np.inf)
    radius = np.inf
    for k in range(count - 1):
        np.minimum(cover, distances_from(int(samples[k]), radius), out=cover)
        cover[samples[k]] = -1.0  # below every distance: twin vertices at one place are each taken once
        samples[k + 1] = farthest(cover, priority)
        radius = cover[samples[k + 1]]
    return samples


def _centroid_distances(mesh: Mesh) -> FloatArray:
    weights = mesh.vertex_areas / (mesh.area or 1.0)
    return np.asarray(np.linalg.norm(mesh.vertices - weights @ mesh.vertices, axis=1))


def _euclidean(mesh: Mesh) -> Callable[[int, float], FloatArray]:
    # Columns, and differences rather than the expanded square: the latter loses half of the digits.
    x, y, z = np.ascontiguousarray((mesh.vertices - mesh.vertices.mean(axis=0)).T)

    def distances_from(source: int, radius: float) -> FloatArray:
        return np.asarray(np.sqrt((x - x[source]) ** 2 + (y - y[source]) ** 2 + (z - z[source]) ** 2))

    return distances_from


def _geodesic(mesh: Mesh) -> Callable[[int, float], FloatArray]:
    graph = virtual_edge_graph(mesh)

    def distances_from(source: int, radius: float) -> FloatArray:
        # Nothing farther than the cover radius can lower the cover: stopping there changes no sample.
        return np.asarray(dijkstra(graph, directed=True, indices=np.array([source]), limit=radius)[0])

    return distances_from
