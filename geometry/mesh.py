"""The triangle mesh as it was read: checked, ordered, immutable."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nonrigid.geometry.arrays import FloatArray, IntArray, frozen
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, eq=False)
class Mesh:
    """Hold the vertices and triangles of a surface exactly as given, in their own order.

    Ground truth refers to the numbers of vertices and faces in the file, so a `Mesh` is never repaired in place: see
    `nonrigid.geometry.clean` for the derived view on which solvers run.

    Parameters
    ----------
    vertices
        (n, 3) coordinates, in the unit of the file.
    faces
        (m, 3) vertex numbers, 0-based.
    name
        Shown in messages and tables; it changes no result.
    file
        The file it was read from, for messages; None where there is none.

    Raises
    ------
    InputError
        If there are no faces, a coordinate is not finite, or an index is out of range.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]])
    >>> triangle.area, triangle.vertices.shape
    (1.0, (3, 3))
    """

    vertices: FloatArray
    faces: IntArray
    name: str = field(default="mesh", kw_only=True)
    file: Path | None = field(default=None, kw_only=True)

    def __init__(
        self, vertices: ArrayLike, faces: ArrayLike, *, name: str = "mesh", file: str | PathLike[str] | None = None
    ) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "file", None if file is None else Path(file))
        object.__setattr__(self, "vertices", _checked_vertices(vertices))
        object.__setattr__(self, "faces", _checked_faces(faces, len(self.vertices)))

    @property
    def source(self) -> str:
        """What messages call it: its file where it has one, else its name."""
        return self.name if self.file is None else str(self.file)

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) triangle areas, in the squared unit of the vertices."""
        return frozen(np.asarray(0.5 * np.linalg.norm(self._cross, axis=1)))

    @cached_property
    def area(self) -> float:
        """Total area, in the squared unit of the vertices."""
        return float(self.face_areas.sum())

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) a third of the area of the incident triangles; sums to `area`."""
        share = np.repeat(self.face_areas / 3.0, 3)
        return frozen(np.asarray(np.bincount(self.faces.ravel(), share, len(self.vertices)), dtype=np.float64))

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """(n, 3) area-weighted unit normals; zero where a vertex has no area."""
        normals = np.zeros_like(self.vertices)
        for corner in range(3):
            np.add.at(normals, self.faces[:, corner], self._cross)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return frozen(np.asarray(np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)))

    @cached_property
    def edges(self) -> IntArray:
        """(e, 2) undirected edges, smaller vertex number first, each once."""
        return self._edges_and_counts[0]

    @cached_property
    def boundary_edges(self) -> IntArray:
        """(b, 2) undirected edges that exactly one triangle uses."""
        edges, counts = self._edges_and_counts
        return frozen(np.asarray(edges[counts == 1]))

    @cached_property
    def boundary_vertices(self) -> IntArray:
        """Sorted numbers of the vertices on the boundary."""
        return frozen(np.unique(self.boundary_edges))

    @cached_property
    def boundary_loops(self) -> tuple[IntArray, ...]:
        """Sorted vertices of each connected piece of the boundary; loops that meet in a vertex are one."""
        members, ends = np.unique(self.boundary_edges, return_inverse=True)
        i, j = ends.reshape(-1, 2).T
        graph = coo_array((np.ones(len(i)), (i, j)), shape=(len(members), len(members)))
        piece = connected_components(graph, directed=False)[1] if len(members) else members
        return tuple(frozen(members[piece == number]) for number in np.unique(piece))

    @cached_property
    def component_of_vertex(self) -> IntArray:
        """(n,) number of the connected component (through shared vertices) each vertex lies in."""
        i, j = self.edges.T
        n = len(self.vertices)
        graph = coo_array((np.ones(len(i)), (i, j)), shape=(n, n))
        return frozen(np.array(connected_components(graph, directed=False)[1], dtype=np.int64))

    def transformed(
        self, *, rotation: ArrayLike | None = None, translation: ArrayLike = 0.0, scale: float = 1.0
    ) -> Mesh:
        """Return the mesh with vertices `scale * rotation @ v + translation`, faces and name unchanged."""
        turned = self.vertices if rotation is None else self.vertices @ np.asarray(rotation, dtype=float).T
        return Mesh(scale * turned + np.asarray(translation, dtype=float), self.faces, name=self.name, file=self.file)

    @cached_property
    def _cross(self) -> FloatArray:
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def _edges_and_counts(self) -> tuple[IntArray, IntArray]:
        directed = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
        return frozen(edges), counts.astype(np.int64)


def _checked_vertices(vertices: ArrayLike) -> FloatArray:
    array = _table(vertices, "vertices").astype(np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"vertices have shape {array.shape}, not (n, 3)", remedy="give one row of x y z a vertex")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InputError(
            f"{len(bad)} vertices are not finite, the first is vertex {bad[0]} (0-based)",
            remedy="remove or mend these vertices",
        )
    return frozen(array)


def _checked_faces(faces: ArrayLike, vertex_count: int) -> IntArray:
    array = _table(faces, "faces")
    if array.size == 0:
        raise InputError("the mesh has no faces", remedy="give a triangle mesh, not a point cloud")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"faces have shape {array.shape}, not (m, 3)", remedy="triangulate the mesh first")
    wrong = ~((array >= 0) & (array < vertex_count) & (array == np.floor(array)))
    bad = np.flatnonzero(wrong.any(axis=1))
    if len(bad):
        raise InputError(
            f"face {bad[0]} (0-based) names vertex {array[bad[0]][wrong[bad[0]]][0]} of {vertex_count}",
            remedy="vertex numbers run from 0 to the number of vertices less one",
        )
    return frozen(array.astype(np.int64))


def _table(rows: ArrayLike, name: str) -> NDArray[np.integer | np.floating]:
    """Return a copy as an array of numbers."""
    try:
        array = np.array(rows)
    except ValueError as error:
        raise InputError(f"{name} are rows of different lengths", remedy="give three numbers a row") from error
    if array.dtype.kind not in "biuf":
        raise InputError(f"{name} are of type {array.dtype}", remedy="give numbers")
    return array
