"""Distances along a surface, by the method the user names."""

from __future__ import annotations

from nonrigid.geometry.errors import UnknownNameError
from nonrigid.geometry.geodesics.dijkstra import DijkstraGeodesics, virtual_edge_graph
from nonrigid.geometry.geodesics.protocol import Geodesics
from nonrigid.geometry.mesh import Mesh

__all__ = ["DijkstraGeodesics", "Geodesics", "make_geodesics", "virtual_edge_graph"]

METHODS = {"dijkstra": DijkstraGeodesics}


def make_geodesics(mesh: Mesh, method: str) -> Geodesics:
    """Return the solver called `method` for `mesh`."""
    if method not in METHODS:
        raise UnknownNameError("geodesic method", method, METHODS)
    return METHODS[method](mesh)
