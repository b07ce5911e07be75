"""Distances along a surface, by the method the user names."""

from __future__ import annotations

from collections.abc import Callable

from nonrigid.geometry.errors import UnknownNameError
from nonrigid.geometry.geodesics.bridged import BridgedGeodesics
from nonrigid.geometry.geodesics.dijkstra import DijkstraGeodesics, virtual_edge_graph
from nonrigid.geometry.geodesics.edge_flip import EdgeFlip
from nonrigid.geometry.geodesics.exact import ExactGeodesics
from nonrigid.geometry.geodesics.heat import HeatGeodesics
from nonrigid.geometry.geodesics.manifold import check_manifold
from nonrigid.geometry.geodesics.protocol import Geodesics
from nonrigid.geometry.mesh import Mesh

__all__ = [
    "METHODS",
    "BridgedGeodesics",
    "DijkstraGeodesics",
    "EdgeFlip",
    "ExactGeodesics",
    "Geodesics",
    "HeatGeodesics",
    "check_manifold",
    "make_geodesics",
    "virtual_edge_graph",
]

METHODS: dict[str, Callable[[Mesh], Geodesics]] = {
    "dijkstra": DijkstraGeodesics,
    "bridged": BridgedGeodesics,
    "heat": HeatGeodesics,
    "exact": ExactGeodesics,
}


def make_geodesics(mesh: Mesh, method: str) -> Geodesics:
    """Return the solver for `mesh` that `method` names: "dijkstra", "bridged", "heat" or "exact".

    Raises
    ------
    UnknownNameError
        If there is no such method.
    InputError
        If the method needs an oriented manifold and the mesh is none ("exact").

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> make_geodesics(square, "dijkstra").distances([0]).shape
    (1, 4)
    """
    if method not in METHODS:
        raise UnknownNameError("geodesic method", method, METHODS)
    return METHODS[method](mesh)
