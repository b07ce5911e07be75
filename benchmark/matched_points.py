"""Keep what the page of a pair shows of a run: its matches with their errors, and its functional map."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
from zipfile import BadZipFile

import numpy as np

from nonrigid.benchmark.protocol import Score
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.points import SurfacePoints

MAP_VARIABLE = "C"
"""What formulations call their functional map: the variable that holds its matrix."""

LARGEST_MAP = 200
"""Rows or columns beyond which a matrix is not kept for the report."""


class Valued(Protocol):
    """Give the values of a solved problem's variables."""

    @property
    def values(self) -> Mapping[str, FloatArray]:
        """Variable name -> array."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MatchedPoints:
    """Hold the matches of one run.

    Parameters
    ----------
    rows
        (p,) the vertices of the part that have a match.
    points
        (p,) the points of the full shape that they are matched to.
    errors
        (p,) geodesic errors on the side that the score chose, fractions of sqrt(full area), NaN where a vertex has no
        ground truth; None where none has.
    functional_map
        The last functional map of the run; None where its method has none.
    """

    rows: IntArray
    points: SurfacePoints
    errors: FloatArray | None = None
    functional_map: FloatArray | None = None


def matched_points(
    dense: SurfacePoints, scored: Score | None = None, solutions: Sequence[Valued] = ()
) -> MatchedPoints:
    """Return the matches among one point a vertex of the part, with their errors where they were scored.

    Examples
    --------
    >>> found = matched_points(SurfacePoints([-1, 4], [[0, 0, 0], [1, 0, 0]]))
    >>> found.rows, found.points.faces
    (array([1]), array([4]))
    """
    rows = np.flatnonzero(dense.matched)
    errors = None if scored is None else scored.errors_of(rows)
    return MatchedPoints(rows=rows, points=dense[rows], errors=errors, functional_map=_functional_map(solutions))


def write_points(path: Path, found: MatchedPoints) -> None:
    """Write matches as a NumPy archive in single precision, whole or not at all."""
    arrays = {
        "rows": found.rows.astype(np.int32),
        "faces": found.points.faces.astype(np.int32),
        "barycentric": found.points.barycentric.astype(np.float32),
    }
    for name, values in (("errors", found.errors), ("functional_map", found.functional_map)):
        if values is not None:
            arrays[name] = values.astype(np.float32)
    memory = io.BytesIO()
    np.savez(memory, **arrays)  # type: ignore[arg-type]
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(memory.getvalue())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_points(path: Path) -> MatchedPoints:
    """Read what `write_points` wrote; raise `InputError` where it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return MatchedPoints(
            rows=arrays["rows"].astype(np.int64),
            points=SurfacePoints(arrays["faces"], arrays["barycentric"]),
            errors=_wide(arrays.get("errors")),
            functional_map=_wide(arrays.get("functional_map")),
        )
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(
            f"cannot be read ({error})", file=path, remedy="delete its run and run the plan again"
        ) from None


def _functional_map(solutions: Sequence[Valued]) -> FloatArray | None:
    found = [solution.values[MAP_VARIABLE] for solution in solutions if MAP_VARIABLE in solution.values]
    small = [values for values in found if values.ndim == 2 and max(values.shape) <= LARGEST_MAP]
    return small[-1] if small else None


def _wide(values: FloatArray | None) -> FloatArray | None:
    return None if values is None else values.astype(np.float64)
