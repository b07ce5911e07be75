"""Where in a triangle a feature vector fits best: from vertices to points between them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

_BLOCK = 4096
"""Pairs of query and triangle that are measured at a time: three rows of features each are in memory."""


def closest_feature_points(queries: FloatArray, features: FloatArray, mesh: Mesh, nearest: IntArray) -> SurfacePoints:
    """Return, for each query, the point of the triangles around a vertex whose interpolated features are nearest.

    Features are linear on each triangle, so that a triangle of the mesh is a triangle in feature space, and the nearest
    point of it has a closed form.

    Parameters
    ----------
    queries
        (q, d) feature vectors.
    features
        (n, d) of the vertices of `mesh`.
    nearest
        (q,) for each query the vertex whose features are nearest.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> found = closest_feature_points(np.array([[0.1, 0.4, 0.0]]), square.vertices, square, np.array([0]))
    >>> found.positions(square).round(12)
    array([[0.1, 0.4, 0. ]])
    """
    corner = csr_array(
        (np.ones(mesh.faces.size), (mesh.faces.ravel(), np.repeat(np.arange(len(mesh.faces)), 3))),
        shape=(len(mesh.vertices), len(mesh.faces)),
    )
    count = np.diff(corner.indptr)[nearest]
    query = np.repeat(np.arange(len(nearest)), count)
    within = np.arange(len(query)) - np.repeat(np.cumsum(count) - count, count)
    face = corner.indices[corner.indptr[nearest][query] + within].astype(np.int64)
    weights, squared = np.empty((len(query), 3)), np.empty(len(query))
    for start in range(0, len(query), _BLOCK):
        rows = slice(start, start + _BLOCK)
        weights[rows], squared[rows] = _in_triangle(queries[query[rows]], features[mesh.faces[face[rows]]])
    # The lowest face wins among equals up to rounding, such as the two at an edge.
    order = np.lexsort((face, squared, query))
    best = order[np.searchsorted(query[order], np.arange(len(nearest)))]
    return SurfacePoints(face[best], weights[best])


def _in_triangle(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return barycentric weights, (p, 3), and squared distances of the points of triangles nearest to (p, d) points."""
    first, second, offset = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = _dot(first, first), _dot(first, second), _dot(second, second)
    ap, bp, pp = _dot(first, offset), _dot(second, offset), _dot(offset, offset)
    area = aa * bb - ab * ab
    flat = area <= 1e-14 * aa * bb
    u = np.where(flat, -1.0, (bb * ap - ab * bp) / np.where(flat, 1.0, area))
    v = np.where(flat, -1.0, (aa * bp - ab * ap) / np.where(flat, 1.0, area))
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    along_a, along_b = _clip(ap, aa), _clip(bp, bb)
    along_c = _clip(bp - ap - ab + aa, aa - 2.0 * ab + bb)
    zero = np.zeros_like(u)
    choices = np.array([[u, v], [along_a, zero], [zero, along_b], [1.0 - along_c, along_c]])
    x, y = choices[:, 0], choices[:, 1]
    squared = pp - 2.0 * (x * ap + y * bp) + x * x * aa + 2.0 * x * y * ab + y * y * bb
    squared[0] = np.where(inside, squared[0], np.inf)
    best = squared.argmin(axis=0)
    rows = np.arange(len(points))
    x, y = x[best, rows], y[best, rows]
    return np.stack([1.0 - x - y, x, y], axis=1), np.maximum(squared[best, rows], 0.0)


def _clip(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    positive = denominator > 0.0
    return np.clip(np.where(positive, numerator / np.where(positive, denominator, 1.0), 0.0), 0.0, 1.0)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("pd,pd->p", a, b))
