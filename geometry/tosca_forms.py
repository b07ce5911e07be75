"""Read the two forms besides OFF in which TOSCA is distributed: `.mat` files, and `.vert` with `.tri` files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError

_FIELDS = ("X", "Y", "Z", "TRIV")


def read_mat(path: Path) -> tuple[FloatArray, IntArray]:
    """Read a MATLAB file with a structure of the fields X, Y, Z (n coordinates) and TRIV (m triangles from 1).

    Returns
    -------
    (n, 3) vertices in the file's unit, and (m, 3) faces, 0-based.

    Raises
    ------
    InputError
        If the file is no MATLAB file, holds no such structure, or names vertices it has not.

    Source: A. Bronstein, M. Bronstein, R. Kimmel, "Numerical geometry of non-rigid shapes", 2008 (the TOSCA data set).
    """
    try:
        content = loadmat(path, struct_as_record=True)
    # SciPy reports damage of all kinds: bad magic, zlib errors, sizes that do not fit, and version 7.3 files.
    except Exception as error:
        raise InputError(
            f"the file cannot be read as MATLAB data: {error}", file=path, remedy="copy it again, or save it as OFF"
        ) from error
    surfaces = [value for name, value in sorted(content.items()) if _is_surface(value)]
    if len(surfaces) != 1:
        raise InputError(
            f"{len(surfaces)} structures with the fields {', '.join(_FIELDS)}, not 1",
            file=path,
            remedy="save the mesh as one structure `surface`",
        )
    try:
        x, y, z, triangles = (np.asarray(surfaces[0][field].item(), dtype=np.float64) for field in _FIELDS)
    except (ValueError, TypeError) as error:
        raise InputError(
            f"the structure does not hold one table of numbers a field: {error}",
            file=path,
            remedy="save the mesh as one structure `surface` with full numeric arrays",
        ) from error
    x, y, z = x.ravel(), y.ravel(), z.ravel()
    if not (x.shape == y.shape == z.shape and triangles.ndim == 2 and triangles.shape[1] == 3):
        raise InputError(
            f"X, Y, Z, TRIV have the shapes {x.shape}, {y.shape}, {z.shape}, {triangles.shape}",
            file=path,
            remedy="give n numbers each, and one row of three vertex numbers a triangle",
        )
    return np.column_stack([x, y, z]), _from_one(triangles, len(x), path, "triangle")


def read_vert_tri(path: Path) -> tuple[FloatArray, IntArray]:
    """Read `name.vert` (x y z a row) and `name.tri` beside it (three vertex numbers a row, from 1).

    Returns
    -------
    (n, 3) vertices in the file's unit, and (m, 3) faces, 0-based.

    Raises
    ------
    InputError
        If a file is missing, has a row of another length, or names vertices that are not there.
    """
    partner = path.with_suffix(".tri")
    if not partner.is_file():
        raise InputError("there is no such file, but a .vert", file=partner, remedy="add the triangles")
    vertices = _rows(path)
    return vertices, _from_one(_rows(partner), len(vertices), partner, "row")


def _is_surface(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.names is not None and set(_FIELDS) <= set(value.dtype.names)


def _rows(path: Path) -> FloatArray:
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    rows = [(number, line.split()) for number, line in enumerate(lines, start=1) if line.strip()]
    for number, row in rows:
        if len(row) != 3:
            raise InputError(f"{len(row)} columns, not 3", file=path, row=number, remedy="mend this row")
    try:
        return np.array([row for _, row in rows], dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(f"not a table of numbers: {error}", file=path, remedy="copy the file again") from None


def _from_one(numbers: FloatArray, count: int, path: Path, kind: str) -> IntArray:
    wrong = np.flatnonzero(~((numbers >= 1) & (numbers <= count) & (numbers == np.round(numbers))).all(axis=1))
    if len(wrong):
        row = numbers[wrong[0]]
        zero = " (the file looks 0-based)" if (numbers == 0).any() else ""
        raise InputError(
            f"{kind} {wrong[0] + 1} names the vertices {row.tolist()}, but numbers run from 1 to {count}{zero}",
            file=path,
            row=int(wrong[0]) + 1,
            remedy="add 1 to every number" if zero else "use the two files that belong together",
        )
    return numbers.astype(np.int64) - 1
