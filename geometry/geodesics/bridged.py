"""Shortest paths that may also cross what was cut out of a surface: an estimate of how far apart points were before."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.frame import canonical_priority, farthest
from nonrigid.geometry.geodesics.dijkstra import DijkstraGeodesics, surface_segments, symmetric_graph
from nonrigid.geometry.mesh import Mesh

BULGE = 1.15
"""Length of a way over a missing patch, in units of the straight line across: patches of bodies are curved."""

ENDS = 64
"""Vertices of a boundary loop, far from one another, between which bridges go; a loop with fewer has all of them."""


@dataclass(frozen=True, eq=False)
class BridgedGeodesics(DijkstraGeodesics):
    """Measure along edges, virtual edges, and bridges between vertices of the same boundary loop.

    A hole makes ways longer; most of what it adds goes away when ways may cross it, at `BULGE` times the straight line.
    A surface without boundary has the distances of `DijkstraGeodesics`. They estimate distances on the surface that a
    part was cut from, and may be shorter or longer than those; how well is measured in docs/bridges.md.

    Source: this package.

    Examples
    --------
    >>> ring = np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6])
    >>> vertices = np.vstack([np.c_[ring, np.zeros(12)], np.c_[ring, 0.1 * np.ones(12)]])
    >>> quads = [(i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i) for i in range(12)]
    >>> band = Mesh(vertices, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    >>> float(DijkstraGeodesics(band).distances([0])[0, 6].round(3)), float(BridgedGeodesics(band).distances([0])[0, 6])
    (3.106, 2.3)
    """

    name: str = "bridged"

    @cached_property
    def graph(self) -> csr_array:
        """The (n, n) symmetric graph of lengths."""
        ends, lengths = surface_segments(self.mesh)
        bridges, spans = _bridges(self.mesh)
        return symmetric_graph(np.vstack([ends, bridges]), np.concatenate([lengths, spans]), len(self.mesh.vertices))


def _bridges(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Return the (b, 2) ends of the bridges, and their (b,) lengths."""
    pairs = [np.empty((0, 2), dtype=np.int64)]
    priority = canonical_priority(mesh)
    for loop in mesh.boundary_loops:
        kept = _spread(mesh.vertices[loop], priority[loop])
        i, j = np.triu_indices(len(kept), 1)
        pairs.append(np.sort(np.stack([loop[kept[i]], loop[kept[j]]], axis=1), axis=1))
    ends = np.vstack(pairs)
    return ends, BULGE * np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)


def _spread(places: FloatArray, priority: FloatArray) -> IntArray:
    """Return the numbers of at most `ENDS` points far from one another, begun with the one farthest from the mean.

    Priorities decide between points that are equally far: those of a round hole all are.
    """
    if len(places) <= ENDS:
        return np.arange(len(places))
    chosen = [farthest(np.linalg.norm(places - places.mean(axis=0), axis=1), priority)]
    nearest = np.full(len(places), np.inf)
    while len(chosen) < ENDS:
        nearest = np.minimum(nearest, np.linalg.norm(places - places[chosen[-1]], axis=1))
        chosen.append(farthest(nearest, priority))
    return np.array(chosen)
