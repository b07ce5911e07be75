"""Read meshes from files exactly as stored, and write them back without loss."""

from __future__ import annotations

import re
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.tosca_forms import read_mat, read_vert_tri

_Row = tuple[int, str]
"""A line's 1-based number in its file, and its text without comments."""

_LARGEST_NUMBER = 2**62
"""What stands for a vertex number that does not fit into 64 bits."""


def read_mesh(path: str | PathLike[str]) -> Mesh:
    """Read a triangle mesh from an OFF, OBJ, PLY, TOSCA `.mat` or `.vert` (with its `.tri`) file, chosen by its suffix.

    Vertices and faces keep the order and the numbers of the file: nothing is merged, split, dropped or triangulated,
    because ground truth refers to these numbers. Unreferenced vertices stay. Colours, normals and texture coordinates
    are ignored.

    Returns
    -------
    Mesh
        (n, 3) vertices in the file's unit, (m, 3) faces, named after the file without its suffix; `file` is the path.

    Raises
    ------
    InputError
        If the file is missing, has another suffix, is no such file, is cut short, holds a face that is no triangle, a
        coordinate that is no finite number or a vertex number out of range. It names the file and, where there is one,
        the 1-based line.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "corner.off")
    ...     write_off(Mesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]]), path)
    ...     read_mesh(path).name
    'corner'
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"the suffix {path.suffix!r} is none of {', '.join(sorted(_READERS))}",
            file=path,
            remedy="convert the mesh to one of these formats",
        )
    if not path.is_file():
        raise InputError("there is no such file", file=path, remedy="check the path")
    try:
        vertices, faces = reader(path)
        return Mesh(vertices, faces, name=path.stem, file=path)
    except InputError as error:
        raise error.at(path) from error
    except OSError as error:
        raise InputError(f"the file cannot be read: {error}", file=path, remedy="check its permissions") from error


def write_off(mesh: Mesh, path: str | PathLike[str]) -> None:
    """Write a mesh as an OFF file that `read_mesh` reads back bit for bit.

    Coordinates are written with as many digits as a double needs (at most 17).

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "corner.off")
    ...     write_off(Mesh([[0, 0, 0], [0.1, 0, 0], [0, 2, 0]], [[0, 1, 2]]), path)
    ...     print(path.read_text())
    OFF
    3 1 0
    0.0 0.0 0.0
    0.1 0.0 0.0
    0.0 2.0 0.0
    3 0 1 2
    <BLANKLINE>
    """
    lines = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")


def _read_off(path: Path) -> tuple[FloatArray, IntArray]:
    rows = _content_rows(path)
    if not rows:
        raise InputError("the file is empty", remedy="export the mesh again")
    row, header = rows.pop(0)
    found = re.fullmatch(r"(?:ST)?C?N?OFF\b\s*(.*)", header)
    if found is None or found[1].upper().startswith("BINARY"):
        raise InputError(
            f"this is no text OFF file: it starts with {header[:20]!r}", row=row, remedy="export it as ASCII OFF"
        )
    if not found[1] and not rows:
        raise InputError("the file ends before the numbers of vertices and faces", remedy="export the mesh again")
    row, counts = (row, found[1]) if found[1] else rows.pop(0)
    try:
        n, m = (int(word) for word in counts.split()[:2])
    except ValueError:
        raise InputError(
            f"expected the numbers of vertices and faces, found {counts[:40]!r}", row=row, remedy="export it again"
        ) from None
    if n < 0 or m < 0 or len(rows) < n + m:
        raise InputError(
            f"cut short: {n} vertex rows and {m} face rows were promised, {len(rows)} rows in all were found",
            remedy="copy or export the file again",
        )
    return _coordinates(rows[:n]), _triangles(rows[n : n + m], n)


def _content_rows(path: Path) -> list[_Row]:
    text = path.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff")
    lines = [line.partition("#")[0].strip() for line in text.split("\n")]
    return [(number, line) for number, line in enumerate(lines, start=1) if line]


def _coordinates(rows: list[_Row]) -> FloatArray:
    """Parse the first three numbers of each row: all at once, and row by row where that fails, to find the culprit."""
    vertices = _table(rows, 3)
    if vertices is not None and np.isfinite(vertices).all():
        return vertices
    parsed = np.empty((len(rows), 3))
    for i, (row, line) in enumerate(rows):
        try:
            parsed[i] = [float(word) for word in line.split()[:3]] if len(line.split()) >= 3 else np.nan
        except ValueError:
            parsed[i] = np.nan
        if not np.isfinite(parsed[i]).all():
            raise InputError(
                f"vertex {i} (0-based) is not three finite numbers: {line[:60]!r}", row=row, remedy="mend this row"
            )
    return parsed


def _triangles(rows: list[_Row], vertex_count: int) -> IntArray:
    table = _table(rows, 4)
    if table is not None and (table[:, 0] == 3).all() and (table == np.floor(table)).all():
        faces = table[:, 1:].astype(np.int64)
    else:
        faces = np.array([_triangle(row, line) for row, line in rows], dtype=np.int64).reshape(-1, 3)
    _check_range(faces, [row for row, _ in rows], vertex_count)
    return faces


def _triangle(row: int, line: str) -> list[int]:
    words = line.split()
    if words[0].isdecimal() and words[0] != "3":
        raise InputError(f"a face with {words[0]} corners", row=row, remedy="triangulate the mesh first")
    try:
        corners = [_number(word) for word in words[1:4]]
    except ValueError:
        corners = []
    if words[0] != "3" or len(corners) != 3:
        raise InputError(f"not a triangle `3 a b c`: {line[:60]!r}", row=row, remedy="mend this row")
    return corners


def _number(word: str) -> int:
    """Return the whole number of a word; one too large for a vertex number as the largest that is not."""
    return min(max(int(word), -_LARGEST_NUMBER), _LARGEST_NUMBER)


def _check_range(faces: IntArray, row_of_face: list[int], vertex_count: int) -> None:
    bad = np.flatnonzero(((faces < 0) | (faces >= vertex_count)).any(axis=1))
    if len(bad):
        face = faces[bad[0]]
        number = face[(face < 0) | (face >= vertex_count)][0]
        raise InputError(
            f"face {bad[0]} (0-based) names vertex {number}, but there are {vertex_count} vertices (0-based numbers)",
            row=row_of_face[bad[0]],
            remedy="mend this row or the numbers of the whole file",
        )


def _table(rows: list[_Row], columns: int) -> FloatArray | None:
    """Parse rows that all hold `columns` numbers, fast; None where they do not."""
    words = [line.split() for _, line in rows]
    if any(len(row) != columns for row in words):
        return None
    try:
        return np.array([float(word) for row in words for word in row]).reshape(-1, columns)
    except ValueError:
        return None


def _read_obj(path: Path) -> tuple[FloatArray, IntArray]:
    """Read `v` and `f` lines alone: trimesh would split vertices along seams of the texture."""
    rows = _content_rows(path)
    vertex_rows = [(row, line[1:].strip()) for row, line in rows if line.split()[0] == "v"]
    seen, faces, face_rows = 0, [], []
    for row, line in rows:
        kind, *words = line.split()
        seen += kind == "v"
        if kind != "f":
            continue
        if len(words) != 3:
            raise InputError(f"a face with {len(words)} corners", row=row, remedy="triangulate the mesh first")
        try:
            numbers = [_number(word.partition("/")[0]) for word in words]
        except ValueError:
            raise InputError(f"not a triangle `f a b c`: {line[:60]!r}", row=row, remedy="mend this row") from None
        faces.append([number + seen if number < 0 else number - 1 for number in numbers])  # negative: counted back
        face_rows.append(row)
    if not vertex_rows:
        raise InputError("no line starts with `v`: this is no OBJ mesh", remedy="export the mesh again")
    triangles = np.array(faces, dtype=np.int64).reshape(-1, 3)
    _check_range(triangles, face_rows, len(vertex_rows))
    return _coordinates(vertex_rows), triangles


def _read_ply(path: Path) -> tuple[FloatArray, IntArray]:
    import trimesh  # a second to load, and few read PLY

    header = path.read_bytes()[:65536].partition(b"end_header")[0].decode("ascii", errors="replace")
    if not header.startswith("ply"):
        raise InputError(f"this is no PLY file: it starts with {header[:20]!r}", row=1, remedy="export it as PLY")
    promised = {kind: int(count) for kind, count in re.findall(r"^element\s+(\w+)\s+(\d+)", header, flags=re.M)}
    try:
        loaded: Any = trimesh.load(path, file_type="ply", process=False, maintain_order=True)
        vertices, faces = np.array(loaded.vertices, dtype=np.float64), np.array(loaded.faces, dtype=np.int64)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"the PLY file cannot be parsed: {error}", remedy="export it again") from error
    for kind, rows in (("vertex", vertices), ("face", faces)):
        if len(rows) != promised.get(kind, 0):
            raise InputError(
                f"the header promises {promised.get(kind, 0)} of `{kind}`, the file gives {len(rows)}: it is cut short,"
                " or has faces that are no triangles",
                remedy="triangulate the mesh and export it again",
            )
    return vertices, faces


_READERS: dict[str, Callable[[Path], tuple[FloatArray, IntArray]]] = {
    ".off": _read_off,
    ".obj": _read_obj,
    ".ply": _read_ply,
    ".mat": read_mat,
    ".vert": read_vert_tri,
}
