"""Shortest paths that may also cross what was cut out of a surface: an estimate of how far apart points were before."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.geodesics.dijkstra import symmetric_graph, virtual_edges
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh

BULGE = 1.15
"""Length of a way over a missing patch, in units of the straight line across: patches of bodies are curved."""

ENDS = 64
"""Vertices of a boundary loop, far from one another, between which bridges go; a loop with fewer has all of them."""


@dataclass(frozen=True, eq=False)
class BridgedGeodesics:
    """Measure along edges, virtual edges, and bridges between vertices of the same boundary loop.

    A hole makes ways longer, up to twice between the ends of a torn body; most of what it adds goes away when ways may
    cross it, at `BULGE` times the straight line. A surface without boundary has the distances of `DijkstraGeodesics`.
    What these distances are better for is estimating those of the surface that a part was cut from: on the
    parts measured, docs/bridges.md.

    Examples
    --------
    >>> from nonrigid.geometry.geodesics.dijkstra import DijkstraGeodesics
    >>> ring = np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6])
    >>> vertices = np.vstack([np.c_[ring, np.zeros(12)], np.c_[ring, 0.1 * np.ones(12)]])
    >>> quads = [(i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i) for i in range(12)]
    >>> band = Mesh(vertices, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    >>> float(DijkstraGeodesics(band).distances([0])[0, 6].round(3)), float(BridgedGeodesics(band).distances([0])[0, 6])
    (3.106, 2.3)
    """

    mesh: Mesh
    name: str = "bridged"

    @cached_property
    def graph(self) -> csr_array:
        """The (n, n) symmetric graph of lengths."""
        mesh = self.mesh
        lengths = np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)
        ends, across = virtual_edges(mesh)
        bridges, spans = _bridges(mesh)
        return symmetric_graph(
            np.vstack([mesh.edges, ends, bridges]), np.concatenate([lengths, across, spans]), len(mesh.vertices)
        )

    def distances(self, sources: ArrayLike) -> FloatArray:
        """Return the (s, n) distances from `sources`, in the unit of the vertices; inf where there is no way."""
        numbers = checked_vertices(sources, len(self.mesh.vertices))
        return np.asarray(dijkstra(self.graph, directed=True, indices=numbers), dtype=np.float64)


def boundary_loops(mesh: Mesh) -> list[IntArray]:
    """Return the vertices of each connected piece of the boundary, ascending.

    Examples
    --------
    >>> boundary_loops(Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]))
    [array([0, 1, 2, 3])]
    """
    edges, members = mesh.boundary_edges, mesh.boundary_vertices
    i, j = edges.T
    graph = coo_array((np.ones(len(edges)), (i, j)), shape=(len(mesh.vertices), len(mesh.vertices)))
    piece = connected_components(graph, directed=False)[1][members]
    return [members[piece == number] for number in np.unique(piece)]


def _bridges(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Return the (b, 2) ends of the bridges, and their (b,) lengths."""
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for loop in boundary_loops(mesh):
        kept = _spread(mesh.vertices[loop])
        i, j = np.triu_indices(len(kept), 1)
        pairs.append(np.sort(np.stack([loop[kept[i]], loop[kept[j]]], axis=1), axis=1))
    ends = np.vstack(pairs)
    return ends, BULGE * np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)


def _spread(places: FloatArray) -> IntArray:
    """Return the numbers of at most `ENDS` points far from one another, begun with the one farthest from the mean."""
    if len(places) <= ENDS:
        return np.arange(len(places))
    chosen = [int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmax())]
    nearest = np.full(len(places), np.inf)
    while len(chosen) < ENDS:
        nearest = np.minimum(nearest, np.linalg.norm(places - places[chosen[-1]], axis=1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)
