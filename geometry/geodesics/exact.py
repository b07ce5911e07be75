"""Exact distances on the polyhedron."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import NonrigidError
from nonrigid.geometry.geodesics.manifold import check_manifold
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh


class MissingExtraError(NonrigidError, ImportError):
    """Report an optional package that is not installed, and the extra that brings it."""


@dataclass(frozen=True, eq=False)
class ExactGeodesics:
    """Measure exactly on the polyhedron, by the window propagation of Mitchell, Mount and Papadimitriou.

    It takes about a hundred times as long as "dijkstra". Needs the package pygeodesic, the extra `exact`.

    Raises
    ------
    InputError
        If the mesh is not an oriented manifold; the solver itself would crash on it.
    MissingExtraError
        If pygeodesic is not installed.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> ExactGeodesics(square).distances([1]).round(4)
    array([[1.    , 0.    , 1.    , 1.4142]])

    Source: Mitchell, Mount, Papadimitriou, "The discrete geodesic problem", SIAM J. Computing 16(4), 1987.
    """

    mesh: Mesh
    name: str = "exact"

    def __post_init__(self) -> None:
        check_manifold(self.mesh, self.name)
        _solver_class()

    def distances(self, sources: ArrayLike) -> FloatArray:
        """Return the (s, n) distances from `sources`, in the unit of the vertices; inf where there is no way."""
        numbers = checked_vertices(sources, len(self.mesh.vertices))
        component = self.mesh.component_of_vertex
        result = np.full((len(numbers), len(self.mesh.vertices)), np.inf)
        for row, source in enumerate(numbers):
            # Asked about a vertex it cannot reach, the solver reads memory that it never wrote.
            reachable = np.flatnonzero(component == component[source])
            result[row, reachable] = self._solver.geodesicDistances(np.array([source]), reachable)[0]
        return result

    @cached_property
    def _solver(self) -> Any:
        return _solver_class()(np.array(self.mesh.vertices), np.array(self.mesh.faces))


def _solver_class() -> Any:
    try:
        from pygeodesic.geodesic import PyGeodesicAlgorithmExact
    except ImportError as error:
        raise MissingExtraError(
            "exact geodesics need the package pygeodesic, which is not installed; "
            "install the extra: pip install 'nonrigid[exact]'"
        ) from error
    return PyGeodesicAlgorithmExact
