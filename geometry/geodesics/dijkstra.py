"""Shortest paths on the edges of a mesh and one virtual edge across each interior edge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class DijkstraGeodesics:
    """Measure along edges and virtual edges: fast, and never shorter than the true distance.

    Every path of the graph is a path on the surface, so the result is an upper bound of the geodesic distance (on
    scanned and remeshed bodies it is 1.4 to 2.5 % long on average).

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> DijkstraGeodesics(square).distances([1]).round(4)
    array([[1.    , 0.    , 1.    , 1.4142]])
    """

    mesh: Mesh
    name: str = "dijkstra"

    @cached_property
    def graph(self) -> csr_array:
        """The (n, n) symmetric graph of lengths, see `virtual_edge_graph`."""
        return virtual_edge_graph(self.mesh)

    def distances(self, sources: ArrayLike) -> FloatArray:
        """Return the (s, n) distances from `sources`, in the unit of the vertices; inf where there is no way."""
        numbers = checked_vertices(sources, len(self.mesh.vertices))
        return np.asarray(dijkstra(self.graph, directed=True, indices=numbers), dtype=np.float64)


def virtual_edge_graph(mesh: Mesh) -> csr_array:
    """Return the (n, n) symmetric graph of edge lengths, with a virtual edge across each interior edge.

    The two triangles at an edge that exactly two triangles use are unfolded into a plane. Where the straight segment
    between the two opposite corners crosses the shared edge, it is a path on the surface, and its length joins the
    graph. Where two paths join the same vertices, the shorter one stays. Lengths are in the unit of the vertices.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> graph = virtual_edge_graph(square)
    >>> graph.nnz, round(float(graph[1, 3]), 4)
    (12, 1.4142)
    """
    return symmetric_graph(*surface_segments(mesh), len(mesh.vertices))


def surface_segments(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Return the (s, 2) ends of all edges and virtual edges, and their (s,) lengths in the unit of the vertices."""
    edges = mesh.edges
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    ends, across = _virtual_edges(mesh)
    return np.vstack([edges, ends]), np.concatenate([lengths, across])


def _virtual_edges(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Return the (v, 2) opposite corners that see each other across an edge, and the (v,) unfolded lengths."""
    a, b, c, d = _hinges(mesh)
    shared = mesh.vertices[b] - mesh.vertices[a]
    base = np.linalg.norm(shared, axis=1)
    shared = np.divide(shared, base[:, None], out=np.zeros_like(shared), where=base[:, None] > 0)
    left, left_height = _planar(mesh.vertices[c] - mesh.vertices[a], shared)
    right, right_height = _planar(mesh.vertices[d] - mesh.vertices[a], shared)
    height = left_height + right_height
    good = (base > 0) & (height > 0) & (c != d)
    crossing = left + (right - left) * np.divide(left_height, height, out=np.zeros_like(height), where=height > 0)
    good &= (crossing >= 0) & (crossing <= base)
    ends = np.sort(np.stack([c, d], axis=1)[good], axis=1)
    return ends, np.hypot(right - left, height)[good]


def _planar(offset: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Split offsets from an edge's first end into the part along the edge and the height over it."""
    along = np.einsum("ex,ex->e", offset, axis)
    return along, np.linalg.norm(offset - along[:, None] * axis, axis=1)


def _hinges(mesh: Mesh) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return ends a, b and opposite corners c, d of each edge of exactly two triangles, whatever their winding."""
    faces = mesh.faces
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    opposite = faces[:, [2, 0, 1]].ravel()
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, opposite = edges[order], opposite[order]
    first = np.flatnonzero(np.r_[True, (edges[1:] != edges[:-1]).any(axis=1)])
    hinge = first[np.diff(np.r_[first, len(edges)]) == 2]
    return edges[hinge, 0], edges[hinge, 1], opposite[hinge], opposite[hinge + 1]


def symmetric_graph(ends: IntArray, lengths: FloatArray, count: int) -> csr_array:
    """Return the (count, count) graph of (e, 2) edges and their (e,) lengths, both directions of each.

    Of parallel edges the shortest stays, never their sum.
    """
    ends, lengths = ends[ends[:, 0] != ends[:, 1]], lengths[ends[:, 0] != ends[:, 1]]
    order = np.lexsort((lengths, ends[:, 1], ends[:, 0]))
    ends, lengths = ends[order], lengths[order]
    shortest = np.r_[True, (ends[1:] != ends[:-1]).any(axis=1)]
    # csgraph works on 32-bit indices: wider ones would be copied at every call.
    i, j = ends[shortest].T.astype(np.int32)
    w = lengths[shortest]
    return csr_array((np.r_[w, w], (np.r_[i, j], np.r_[j, i])), shape=(count, count))
