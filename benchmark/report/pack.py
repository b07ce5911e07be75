"""Pack surfaces and matches for a page's script: few bytes, as text."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.matched_points import MatchedPoints
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

_SHORT = 65535
ERROR_STEP = 1e-4
"""Unit of packed errors, in sqrt(full area)."""


def pack_surface(mesh: Mesh) -> dict[str, Any]:
    """Return a surface with its coordinates rounded to 1/65535 of its bounding box: enough to look at."""
    low = mesh.vertices.min(axis=0)
    size = np.ptp(mesh.vertices, axis=0)
    share = np.divide(mesh.vertices - low, size, out=np.zeros_like(mesh.vertices), where=size > 0)
    wide = len(mesh.vertices) > _SHORT
    return {
        "vertices": _text(np.rint(share * _SHORT), np.uint16),
        "faces": _text(mesh.faces, np.uint32 if wide else np.uint16),
        "wide": wide,
        "low": low.tolist(),
        "size": size.tolist(),
    }


def pack_points(
    points: SurfacePoints, rows: IntArray | None = None, errors: FloatArray | None = None
) -> dict[str, Any]:
    """Return points of a surface, for the listed vertices of the part or for all of them.

    Weights are rounded to 1/255, errors to `ERROR_STEP` and at most 6.5534; 65535 is not known.
    """
    wide = max(int(points.faces.max(initial=0)), 0 if rows is None else int(rows.max(initial=0))) > _SHORT
    whole = np.uint32 if wide else np.uint16
    packed: dict[str, Any] = {
        "faces": _text(points.faces, whole),
        "weights": _text(np.rint(points.barycentric[:, :2] * 255), np.uint8),
        "wide": wide,
    }
    if rows is not None:
        packed["rows"] = _text(rows, whole)
    if errors is not None:
        steps = np.rint(np.clip(errors / ERROR_STEP, 0, _SHORT - 1))
        packed["errors"] = _text(np.where(np.isnan(errors), _SHORT, steps), np.uint16)
    return packed


def pack_truth(points: SurfacePoints) -> dict[str, Any]:
    """Return ground truth, of those vertices that have some."""
    rows = np.flatnonzero(points.matched)
    return pack_points(points[rows], None if len(rows) == len(points) else rows)


def pack_matches(found: MatchedPoints) -> dict[str, Any]:
    """Return the matches of a run with their errors."""
    return pack_points(found.points, found.rows, found.errors)


def pack_matrix(values: FloatArray) -> dict[str, Any]:
    """Return a matrix in single precision."""
    return {"rows": values.shape[0], "columns": values.shape[1], "values": _text(values, np.float32)}


def place_colours(mesh: Mesh) -> NDArray[np.uint8]:
    """Return (n, 3) colours by place: nearby points have similar ones, distant points different ones.

    Lightness runs along the longest principal axis, blue to yellow along the second, green to red along the third, in
    CIE L*a*b*: readers who confuse red and green still tell two of three axes apart.
    """
    weight = mesh.vertex_areas / mesh.area
    centred = mesh.vertices - weight @ mesh.vertices
    axes = np.linalg.eigh((centred * weight[:, None]).T @ centred)[1][:, ::-1]
    along = centred @ axes
    share = (along - along.min(axis=0)) / np.maximum(np.ptp(along, axis=0), 1e-300)
    lab = np.stack([35 + 55 * share[:, 0], 110 * share[:, 2] - 55, 130 * share[:, 1] - 65], axis=1)
    return _srgb(lab)


def pack_colours(mesh: Mesh) -> str:
    """Return `place_colours` as text."""
    return _text(place_colours(mesh), np.uint8)


def broadside(mesh: Mesh) -> tuple[int, int, int]:
    """Return the axes that point to the eye, up and to the side where a surface shows itself best.

    One looks along the thinnest side of the bounding box. Files have up along z or y; where both are left, bodies are
    longer than high.
    """
    size = np.ptp(mesh.vertices, axis=0)
    thin = int(np.argmin(size))
    up = {0: 1 if size[1] < size[2] else 2, 1: 2, 2: 1}[thin]
    return thin, up, 3 - thin - up


def first_view(mesh: Mesh) -> list[float]:
    """Return the (3, 3) turn, row by row, from which a surface is seen first: broadside, a little from above."""
    _, up, across = broadside(mesh)
    rows = np.zeros((3, 3))
    rows[0, across] = rows[1, up] = 1.0
    rows[2] = np.cross(rows[0], rows[1])
    tilt = Rotation.from_euler("yx", [25, 12], degrees=True).as_matrix()
    return [float(value) for value in (tilt @ rows).ravel()]


def _srgb(lab: FloatArray) -> NDArray[np.uint8]:
    """Convert CIE L*a*b* (D65) to 8-bit sRGB, clipped to what a screen shows."""
    y = (lab[:, 0] + 16) / 116
    f = np.stack([y + lab[:, 1] / 500, y, y - lab[:, 2] / 200], axis=1)
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29)) * [0.9505, 1.0, 1.089]
    matrix = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    linear = np.clip(xyz @ matrix.T, 0, 1)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * shown), dtype=np.uint8)


def _text(values: NDArray[Any], kind: type[Any]) -> str:
    return base64.b64encode(values.astype(np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")
