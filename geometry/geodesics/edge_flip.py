"""Distances of single pairs, by straightening a path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import potpourri3d
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics.manifold import check_manifold
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class EdgeFlip:
    """Measure pairs by flipping edges until an edge path is a locally shortest path.

    The length is an upper bound, on real meshes 0.01 to 0.2 % above the exact distance on average; near pairs are by
    far the cheapest.

    Raises
    ------
    InputError
        If the mesh is not an oriented manifold; the solver itself would crash on some such meshes.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> EdgeFlip(square).distance_pairs([1, 0], [3, 0]).round(4)
    array([1.4142, 0.    ])

    Source: Sharp, Crane, "You can find geodesic paths in triangle meshes by just flipping edges", ACM TOG 39(6), 2020.
    """

    mesh: Mesh
    name: str = "edgeflip"

    def __post_init__(self) -> None:
        check_manifold(self.mesh, self.name)

    def distance_pairs(self, a: ArrayLike, b: ArrayLike) -> FloatArray:
        """Return the (p,) distances between a[i] and b[i], in the unit of the vertices; inf where there is no way.

        Raises `InputError` if a number is not a vertex or the two lists differ in length.
        """
        n = len(self.mesh.vertices)
        first, second = checked_vertices(a, n, "first"), checked_vertices(b, n, "second")
        if len(first) != len(second):
            raise InputError(f"{len(first)} first and {len(second)} second vertices", remedy="give them in pairs")
        component = self.mesh.component_of_vertex
        joined = component[first] == component[second]
        result = np.where(joined, 0.0, np.inf)
        # In one direction only, so that the distance from a to b is the one from b to a.
        low, high = np.minimum(first, second), np.maximum(first, second)
        for pair in np.flatnonzero(joined & (first != second)):
            path = self._solver.find_geodesic_path(int(low[pair]), int(high[pair]))
            result[pair] = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        return result

    @cached_property
    def _solver(self) -> Any:
        return potpourri3d.EdgeFlipGeodesicSolver(np.array(self.mesh.vertices), np.array(self.mesh.faces))
