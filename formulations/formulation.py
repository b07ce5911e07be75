"""What a matching method takes and gives: a pair of surfaces in, problems one by one, a correspondence out."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.cache import Cache
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.surface import Surface

LARGEST_PART = 1.1
"""Area of a part, in units of the full area, above which a pair is refused: poses stretch areas by a few per cent."""

SMALLEST_PART = 1e-3
"""Area of a part, in units of the full area, below which a pair is refused: mostly its unit of length is another."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pair:
    """Hold a partial surface and the full one, in the unit in which the full one has area 1.

    Everything a formulation reads off `part` and `full` is in that unit. Vertex numbers are those of the repaired views
    (`Surface.mesh`); a `Correspondence` is in the numbers of the files.
    """

    part: Surface
    full: Surface
    scale: float

    @classmethod
    def of(cls, part: Mesh, full: Mesh, *, cache: Cache | Literal["default"] | None = "default") -> Pair:
        """Return the pair of two meshes in one common unit, scaled so that the full one has area 1.

        Raises
        ------
        InputError
            If a mesh cannot be repaired into one connected surface, or the part's area exceeds the full one's by more
            than a tenth or is less than a thousandth of it.

        Examples
        --------
        >>> full = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> part = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0]], [[0, 1, 2]])
        >>> pair = Pair.of(part, full, cache=None)
        >>> pair.full.area, pair.part.area, pair.scale
        (1.0, 0.5, 0.25)
        """
        whole, piece = Surface(full, cache=cache), Surface(part, cache=cache)
        ratio = piece.area / whole.area
        if not SMALLEST_PART <= ratio <= LARGEST_PART:
            raise InputError(
                f"the part {part.name} has {ratio:.3g} times the area of the full surface {full.name}",
                remedy="give the part first and the full surface second, both in the same unit of length",
            )
        scale = float(1.0 / np.sqrt(whole.area))
        return cls(part=piece.scaled(scale), full=whole.scaled(scale), scale=scale)

    @property
    def kept_area(self) -> float:
        """Area of the part over the area of the full surface."""
        return self.part.area / self.full.area


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Name, for some vertices of the part, the point of the full surface that each is.

    Parameters
    ----------
    part_vertices
        (m,) vertex numbers of the part, as in its file, each at most once.
    points
        (m,) points of the full surface, with face numbers as in its file.
    confidence
        (m,) between 0 and 1, larger is surer; comparable within one correspondence only.

    Raises
    ------
    InputError
        If lengths disagree or a part vertex stands twice.
    """

    part_vertices: IntArray
    points: SurfacePoints
    confidence: FloatArray

    def __post_init__(self) -> None:
        lengths = {len(self.part_vertices), len(self.points), len(self.confidence)}
        if len(lengths) > 1:
            raise InputError(f"a correspondence has columns of lengths {sorted(lengths)}", remedy="give equal lengths")
        if len(np.unique(self.part_vertices)) < len(self.part_vertices):
            raise InputError("a part vertex is matched twice", remedy="keep one match a vertex")

    def __len__(self) -> int:
        return len(self.part_vertices)

    @classmethod
    def between_vertices(
        cls, pair: Pair, part_vertices: ArrayLike, full_vertices: ArrayLike, confidence: ArrayLike | None = None
    ) -> Correspondence:
        """Return the correspondence of vertices of the repaired views, in the numbers of the files.

        Parameters
        ----------
        part_vertices, full_vertices
            (m,) each.
        confidence
            (m,) between 0 and 1; all 1 unless given.

        Raises
        ------
        InputError
            If lengths disagree, or a number is not that of a vertex.
        """
        part = checked_vertices(part_vertices, len(pair.part.mesh.vertices), "part")
        full = checked_vertices(full_vertices, len(pair.full.mesh.vertices), "full")
        sure = np.ones(len(part)) if confidence is None else np.asarray(confidence, dtype=float)
        if not len(part) == len(full) == len(sure):
            raise InputError(
                f"{len(part)} vertices of the part, {len(full)} of the full surface, {len(sure)} confidences",
                remedy="give one of each a match",
            )
        points = pair.full.clean_view.to_raw(SurfacePoints.at_vertices(pair.full.mesh, full))
        raw, first = np.unique(pair.part.clean_view.raw_of_vertex[part], return_index=True)
        return cls(raw, points[first], sure[first])

    @classmethod
    def of_every_vertex(cls, pair: Pair, points: SurfacePoints, confidence: FloatArray) -> Correspondence:
        """Return the correspondence of all vertices of the part's repaired view, in the numbers of the files.

        Where the repair split a vertex in several, its first copy speaks for it.
        """
        raw, first = np.unique(pair.part.clean_view.raw_of_vertex, return_index=True)
        return cls(raw, pair.full.clean_view.to_raw(points)[first], confidence[first])

    def view_vertices(self, pair: Pair) -> tuple[IntArray, IntArray]:
        """Return matched vertices of the repaired views: a point between vertices stands for its nearest corner."""
        part = pair.part.clean_view.vertex_of_raw[self.part_vertices]
        full = pair.full.clean_view.from_raw(self.points).nearest_corner(pair.full.mesh)
        known = (part >= 0) & (full >= 0)
        return part[known], full[known]

    def dense(self, vertex_count: int) -> SurfacePoints:
        """Return one point for each vertex of the part, unmatched where there is none: the form of a `.corr` file.

        Raises
        ------
        InputError
            If a matched vertex is not one of `vertex_count`.
        """
        checked_vertices(self.part_vertices, vertex_count, "part")
        faces, weights = np.full(vertex_count, -1, dtype=np.int64), np.zeros((vertex_count, 3))
        faces[self.part_vertices], weights[self.part_vertices] = self.points.faces, self.points.barycentric
        return SurfacePoints(faces, weights)


class Solved(Protocol):
    """Give a formulation the values of a solved problem; `nonrigid.solvers` sends a `Solution`."""

    @property
    def values(self) -> Mapping[str, FloatArray]:
        """Variable name -> array."""

    @property
    def objective(self) -> float:
        """Objective in the formulation's own sense."""

    def __getitem__(self, name: str) -> FloatArray: ...


Stages: TypeAlias = Generator[Problem, Solved, Correspondence]


@runtime_checkable
class Formulation(Protocol):
    """State a matching method: a frozen dataclass of hyper-parameters that generates problems.

    `stages` yields problems, is sent each one's solution, and returns the correspondence. It never learns which backend
    solved a problem.
    """

    def stages(self, pair: Pair) -> Stages:
        """Generate the method's problems for a pair."""
