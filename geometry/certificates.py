"""Which distances on a part are surely those on the whole."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics.dijkstra import DijkstraGeodesics
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh

TIE = 1e-9  # a shortest path that touches the boundary equals its own bound, up to rounding
BLOCK_ELEMENTS = 1 << 16  # keeps the two arrays of the inner loop inside a second-level cache


def certified_pairs(mesh: Mesh, distances: ArrayLike, sources: ArrayLike, *, margin: float = 0.0) -> BoolArray:
    r"""Tell for which pairs of samples on a part no shortcut through the missing surface can exist.

    A path of the complete surface that leaves the part at b and comes back at b' is at least as long as the chord
    between them. So the distance on the part is the distance on the whole wherever

    .. math:: d(x, x') \le \min_{b, b' \in \partial N} d(x, b) + \|b - b'\| + d(b', x').

    All boundary vertices are used, none is sampled away: leaving some out would raise the bound and certify too much.
    A path may also leave through the inside of a boundary edge; a `margin` of twice the longest boundary edge makes the
    test strict there too. The proof needs exact distances: those along mesh edges are upper bounds, on both sides, and
    certify pairs whose distance on the whole is shorter by as much as they are too long. On a surface without boundary
    every finite distance is certified.

    Parameters
    ----------
    mesh
        The part.
    distances
        (s, n) distances from the sources to all vertices; or (s, s) distances among the sources, and then the
        distances to the boundary are measured here, by "dijkstra". A square (n, n) array is read in the first way. In
        the unit of the vertices.
    sources
        (s,) vertex numbers.
    margin
        Length that is taken from the bound, in the unit of the vertices.

    Returns
    -------
    certified
        (s, s) symmetric.

    Raises
    ------
    InputError
        If the shape of `distances` is neither (s, n) nor (s, s), or a source is no vertex.

    Examples
    --------
    A long strip of paper, bent into a ring with a gap: across the gap the distance on the part is no evidence.

    >>> angle = np.repeat(np.linspace(0.2, 6.0, 40), 3)
    >>> ring = np.c_[np.cos(angle), np.sin(angle), np.tile([0.0, 0.1, 0.2], 40)]
    >>> quads = np.array([[k, k + 1, k + 4, k + 3] for k in range(117) if k % 3 != 2])
    >>> strip = Mesh(ring, np.r_[quads[:, :3], quads[:, [0, 2, 3]]])
    >>> samples = np.array([1, 4, 118])
    >>> certified_pairs(strip, DijkstraGeodesics(strip).distances(samples), samples)
    array([[ True,  True, False],
           [ True,  True, False],
           [False, False,  True]])
    """
    numbers = checked_vertices(sources, len(mesh.vertices))
    table = np.asarray(distances, dtype=np.float64)
    s, n = len(numbers), len(mesh.vertices)
    boundary = mesh.boundary_vertices
    if table.shape == (s, n):
        between, to_boundary = table[:, numbers], table[:, boundary]
    elif table.shape == (s, s):
        between, to_boundary = table, _to_boundary(mesh, numbers)
    else:
        raise InputError(
            f"distances have shape {table.shape}; with {s} sources on {n} vertices they should be {(s, n)} or {(s, s)}",
            remedy="give one row of distances a source",
        )
    between = np.maximum(between, between.T)
    if not len(boundary):
        return np.isfinite(between)
    points = mesh.vertices[boundary]
    chords = cdist(points, points)
    bound = _min_plus(_min_plus(to_boundary, chords), np.ascontiguousarray(to_boundary.T)) - margin
    np.fill_diagonal(bound, np.inf)
    return np.asarray(np.isfinite(between) & (between <= np.minimum(bound, bound.T) * (1.0 + TIE)))


def _to_boundary(mesh: Mesh, sources: ArrayLike) -> FloatArray:
    if not len(mesh.boundary_vertices):
        return np.empty((np.size(sources), 0))
    return DijkstraGeodesics(mesh).distances(sources)[:, mesh.boundary_vertices]


def _min_plus(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return min_k a[i, k] + b[k, j]: (s, k) and (k, t) give (s, t)."""
    result = np.full((len(a), b.shape[1]), np.inf)
    rows = max(1, BLOCK_ELEMENTS // max(b.shape[1], 1))
    for first in range(0, len(a), rows):
        part, mine = a[first : first + rows], result[first : first + rows]
        buffer = np.empty_like(mine)
        for k in range(len(b)):
            np.add(part[:, k, None], b[k], out=buffer)
            np.minimum(mine, buffer, out=mine)
    return result
