"""Read and write correspondences and ground truth in the forms the SHREC'16 community uses.

| suffix | row | numbering |
| --- | --- | --- |
| `.baryc_gt`, `.baryc_gt_sym` | triangle b1 b2 b3 | triangles from 1, written as floats |
| `.corr` | triangle b1 b2 b3, or `-1 0 0 0` for unmatched | triangles from 1 |
| `.vts` | vertex | from 1, perhaps written as floats |
| `.map` | vertex, or -1 for unmatched | from 0 |

There is one row a vertex of the part, in the order of its file. Weights have no unit.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

WEIGHT_TOLERANCE = 1e-3
"""How far weights may be from summing to one, or below zero, before the file is refused; smaller slips are mended."""


def read_baryc(path: Path | str, *, full: Mesh | None = None, expected_rows: int | None = None) -> SurfacePoints:
    """Read SHREC'16 ground truth: `triangle b1 b2 b3` a row, triangles counted from 1 and written as floats.

    Parameters
    ----------
    path
        A `.baryc_gt` or `.baryc_gt_sym` file.
    full
        The full shape; where given, triangles beyond it are refused.
    expected_rows
        The number of vertices of the part; where given, any other number of rows is refused.

    Raises
    ------
    InputError
        Naming file and row, for a wrong number of columns or rows, a word that is no number, triangle 0 or one beyond
        the mesh, or weights that do not sum to one.

    Source: the data files of the SHREC'16 track (Cosmo et al. 2016, Partial Matching of Deformable Shapes).
    """
    return _weighted(Path(path), full, expected_rows, unmatched=False)


def read_corr(path: Path | str, *, full: Mesh | None = None, expected_rows: int | None = None) -> SurfacePoints:
    """Read a SHREC'16 submission: as `read_baryc`, with the row `-1 0 0 0` for an unmatched vertex."""
    return _weighted(Path(path), full, expected_rows, unmatched=True)


def read_vts(path: Path | str, full: Mesh, *, expected_rows: int | None = None) -> SurfacePoints:
    """Read one vertex of `full` a row, counted from 1; raise `InputError` as `read_baryc` does."""
    return _vertices(Path(path), full, expected_rows, first=1)


def read_vertices(path: Path | str, mesh: Mesh, *, expected_rows: int | None = None) -> IntArray:
    """Return the (r,) 0-based vertices of `mesh` that the rows of a `.vts` file name; raise as `read_vts` does."""
    return _numbers(Path(path), mesh, expected_rows, first=1)[0]


def read_map(path: Path | str, full: Mesh, *, expected_rows: int | None = None) -> SurfacePoints:
    """Read one vertex of `full` a row, counted from 0, -1 for unmatched; raise `InputError` as `read_baryc` does."""
    return _vertices(Path(path), full, expected_rows, first=0)


def read_truth(path: Path | str, full: Mesh, *, expected_rows: int | None = None) -> SurfacePoints:
    """Read ground truth or a correspondence in the form its suffix tells.

    Raises
    ------
    InputError
        For an unknown suffix, and as the reader of that form does.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"no correspondence form has the suffix {path.suffix!r}",
            file=path,
            remedy=f"use one of {', '.join(sorted(_READERS))}",
        )
    return reader(path, full, expected_rows)


def write_corr(path: Path | str, points: SurfacePoints) -> None:
    """Write a SHREC'16 submission, whole or not at all.

    Each row is `triangle b1 b2 b3`, triangles counted from 1, or `-1 0 0 0` for an unmatched point.
    """
    rows = zip(points.faces, points.barycentric, strict=True)
    write_text(
        path, "".join(f"{f + 1} {b[0]:.17g} {b[1]:.17g} {b[2]:.17g}\n" if f >= 0 else "-1 0 0 0\n" for f, b in rows)
    )


def write_baryc(path: Path | str, points: SurfacePoints) -> None:
    """Write ground truth in the SHREC'16 form, whole or not at all.

    Raises
    ------
    InputError
        If a point is unmatched: this form has no word for that.
    """
    _require_matched(points, path)
    rows = zip(points.faces, points.barycentric, strict=True)
    write_text(path, "".join(f"{f + 1:.7e} {b[0]:.16e} {b[1]:.16e} {b[2]:.16e}\n" for f, b in rows))


def write_vts(path: Path | str, points: SurfacePoints, full: Mesh) -> None:
    """Write the nearest corner of each point, counted from 1, whole or not at all; refuse unmatched points."""
    _require_matched(points, path)
    write_text(path, "".join(f"{v + 1}\n" for v in points.nearest_corner(full)))


def write_map(path: Path | str, points: SurfacePoints, full: Mesh) -> None:
    """Write the nearest corner of each point, counted from 0, -1 for unmatched, whole or not at all."""
    write_text(path, "".join(f"{v}\n" for v in points.nearest_corner(full)))


def write_text(path: Path | str, text: str) -> None:
    """Write a text file so that a reader sees the old file or the new one, never half of it."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} does not exist", file=path, remedy="create it first")
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _weighted(path: Path, full: Mesh | None, expected_rows: int | None, *, unmatched: bool) -> SurfacePoints:
    table = _table(path, 4, expected_rows)
    triangle = _whole_numbers(path, table[:, 0], "triangle")
    none = (triangle == -1) if unmatched else np.zeros(len(triangle), dtype=bool)
    _check_range(path, triangle, none, "triangle", 1, None if full is None else len(full.faces), full)
    weights = np.where(none[:, None], 0.0, table[:, 1:])
    total = weights.sum(axis=1)
    wrong = np.flatnonzero(~none & (np.abs(total - 1.0) > WEIGHT_TOLERANCE))
    if len(wrong):
        raise InputError(
            f"barycentric weights sum to {total[wrong[0]]:.6g}, not 1",
            file=path,
            row=int(wrong[0]) + 1,
            remedy="write the three weights of the triangle's corners",
        )
    wrong = np.flatnonzero((weights < -WEIGHT_TOLERANCE).any(axis=1))
    if len(wrong):
        raise InputError(
            f"a barycentric weight is {weights[wrong[0]].min():.6g}, below 0",
            file=path,
            row=int(wrong[0]) + 1,
            remedy="name the triangle that the point lies in",
        )
    return SurfacePoints(np.where(none, -1, triangle - 1), weights)


def _vertices(path: Path, full: Mesh, expected_rows: int | None, *, first: int) -> SurfacePoints:
    vertex, none = _numbers(path, full, expected_rows, first=first)
    try:
        return SurfacePoints.at_vertices(full, np.where(none, -1, vertex))
    except InputError as error:
        raise error.at(path) from None


def _numbers(path: Path, full: Mesh, expected_rows: int | None, *, first: int) -> tuple[IntArray, BoolArray]:
    """Return the 0-based vertices that the rows name, and which rows say "unmatched"."""
    vertex = _whole_numbers(path, _table(path, 1, expected_rows)[:, 0], "vertex")
    none = (vertex == -1) if first == 0 else np.zeros(len(vertex), dtype=bool)
    _check_range(path, vertex, none, "vertex", first, len(full.vertices), full)
    return vertex - first, none


def _table(path: Path, columns: int, expected_rows: int | None) -> FloatArray:
    try:
        lines = path.read_text(encoding="utf-8-sig").split("\n")
    except FileNotFoundError:
        raise InputError("there is no such file", file=path, remedy="check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read as text ({error})", file=path, remedy="give a text file") from None
    while lines and not lines[-1].strip():
        lines.pop()
    rows = [line.split() for line in lines]
    for number, row in enumerate(rows, start=1):
        if len(row) != columns:
            raise InputError(f"{len(row)} columns, not {columns}", file=path, row=number, remedy=_remedy(columns))
    if expected_rows is not None and len(rows) != expected_rows:
        raise InputError(
            f"{len(rows)} rows, but the part has {expected_rows} vertices",
            file=path,
            remedy="use the file that belongs to this part, one row a vertex; files of training and test sets bear the"
            " same names, and must not be mixed",
        )
    try:
        table = np.array(rows, dtype=np.float64).reshape(-1, columns)
    except ValueError:
        number, word = next((n, w) for n, row in enumerate(rows, start=1) for w in row if not _is_number(w))
        raise InputError(f"{word!r} is not a number", file=path, row=number, remedy=_remedy(columns)) from None
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        raise InputError("a value is not finite", file=path, row=int(bad[0]) + 1, remedy=_remedy(columns))
    return table


def _whole_numbers(path: Path, values: FloatArray, kind: str) -> IntArray:
    bad = np.flatnonzero(values != np.round(values))
    if len(bad):
        raise InputError(
            f"{kind} {values[bad[0]]:g} is not a whole number",
            file=path,
            row=int(bad[0]) + 1,
            remedy=f"the first column numbers a {kind}",
        )
    return values.astype(np.int64)


def _check_range(
    path: Path, numbers: IntArray, none: np.ndarray, kind: str, first: int, count: int | None, full: Mesh | None
) -> None:
    low = np.flatnonzero(~none & (numbers < first))
    if len(low):
        zero = first == 1 and numbers[low[0]] == 0
        raise InputError(
            f"{kind} {numbers[low[0]]} in a file that counts from {first}"
            + (": the file looks 0-based" if zero else ""),
            file=path,
            row=int(low[0]) + 1,
            remedy="add 1 to every number" if zero else f"number each {kind} from {first} on",
        )
    if count is None or full is None:
        return
    high = np.flatnonzero(numbers - first >= count)
    if len(high):
        raise InputError(
            f"{kind} {numbers[high[0]]}, but {full.name} has {count} (counted from {first})",
            file=path,
            row=int(high[0]) + 1,
            remedy="use the full shape that this file was made for, with its rows in file order",
        )


def _require_matched(points: SurfacePoints, path: Path | str) -> None:
    if not points.matched.all():
        raise InputError(
            f"{np.count_nonzero(~points.matched)} points are unmatched, which this form cannot say",
            file=path,
            row=int(np.flatnonzero(~points.matched)[0]) + 1,
            remedy="write .corr or .map",
        )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _remedy(columns: int) -> str:
    return "write one vertex number a row" if columns == 1 else "write `triangle b1 b2 b3` in each row"


_READERS: dict[str, Callable[[Path, Mesh, int | None], SurfacePoints]] = {
    ".baryc_gt": lambda path, full, rows: read_baryc(path, full=full, expected_rows=rows),
    ".baryc_gt_sym": lambda path, full, rows: read_baryc(path, full=full, expected_rows=rows),
    ".corr": lambda path, full, rows: read_corr(path, full=full, expected_rows=rows),
    ".vts": lambda path, full, rows: read_vts(path, full, expected_rows=rows),
    ".map": lambda path, full, rows: read_map(path, full, expected_rows=rows),
}
