"""Draw a mesh into an array of pixels: in software, with no window and no graphics card."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.image import imsave
from numpy.typing import ArrayLike, NDArray

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh

Image = NDArray[np.uint8]
"""(h, w, 4) red, green, blue and opacity, 0 to 255; opacity 0 where nothing is drawn."""

PLAIN = (0.62, 0.70, 0.80)
"""Colour of a surface that has none of its own."""
_OVERSAMPLING = 2
_BLOCK = 2_000_000
"""Pixels of triangles that are worked on at a time, which bounds the memory."""
_LIGHT = np.array([0.35, 0.55, 0.76]) / np.linalg.norm([0.35, 0.55, 0.76])


@dataclass(frozen=True, kw_only=True)
class View:
    """Say from where a surface is looked at, without perspective.

    Parameters
    ----------
    azimuth, elevation
        Degrees: how far the eye goes round the axis `up`, and how far above the horizon.
    up
        The axis of the mesh that points up in the picture.
    centre, radius
        What the picture shows: the ball in the unit of the mesh that just fits into it. The mesh itself where None;
        give those of the full shape to draw parts at the same scale.
    """

    azimuth: float = 30.0
    elevation: float = 15.0
    up: Literal["x", "y", "z"] = "y"
    centre: tuple[float, float, float] | None = None
    radius: float | None = None

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation into the picture's axes: right, up, towards the eye."""
        turn, tilt = np.radians([self.azimuth, self.elevation])
        # The axes of the mesh that point right, up and to the eye at azimuth 0 follow each other in cyclic order.
        first = {"x": 2, "y": 0, "z": 1}[self.up]
        axes = np.eye(3)[[first, (first + 1) % 3, (first + 2) % 3]]
        around = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
        above = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        return np.asarray(above @ around @ axes)


def render(mesh: Mesh, colors: ArrayLike | None = None, *, view: View | None = None, size: int = 400) -> Image:
    """Draw a mesh, shaded smoothly; the inside, where a hole lets it be seen, is darker and grey.

    Parameters
    ----------
    mesh
        n vertices, m triangles.
    colors
        Red, green and blue between 0 and 1: (n, 3) for the vertices, (m, 3) for the triangles or (3,) for all.
    view
        From where; `View()` if not given.
    size
        Height and width in pixels.

    Raises
    ------
    InputError
        If the colours have another shape.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> image = render(triangle, (1, 0, 0), view=View(azimuth=0, elevation=0), size=40)
    >>> image.shape, int(image[..., 3].max()), int(image[0, 0, 3])
    ((40, 40, 4), 255, 0)
    """
    view = view or View()
    fine = size * _OVERSAMPLING
    corner_colors = _corner_colors(mesh, PLAIN if colors is None else colors)
    corners, normals = _in_picture(mesh, view, fine)
    nearest, face, weight = _visible(corners, fine)
    seen = np.flatnonzero(nearest)
    face, weight = face[seen], weight[seen]
    color = _shaded(
        np.einsum("pc,pcx->px", weight, corner_colors[face]), np.einsum("pc,pcx->px", weight, normals[face])
    )
    pixels = np.zeros((fine * fine, 4))
    pixels[seen, :3], pixels[seen, 3] = color, 1.0
    return _averaged(pixels.reshape(fine, fine, 4))


def position_colors(points: ArrayLike, mesh: Mesh) -> FloatArray:
    """Return (p, 3) colours that tell places of a surface apart: the coordinates of points within its bounding box.

    Points of a part that are mapped to the full shape, coloured so, show at a glance whether the map is right. Places
    that are NaN, as those of unmatched points, become grey.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> position_colors([[0.5, 0.5, 0.0]], square).round(2).tolist()
    [[0.55, 0.55, 0.15]]
    """
    places = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    share = (places - low) / np.where(high > low, high - low, 1.0)
    share = 0.15 + 0.8 * np.clip(share, 0.0, 1.0)
    return np.asarray(np.where(np.isfinite(share), share, 0.6))


def framing(mesh: Mesh, view: View) -> View:
    """Return the view with the ball around `mesh` filled in, for drawing several meshes at one scale."""
    x, y, z = ((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2).tolist()
    radius = float(np.linalg.norm(mesh.vertices - (x, y, z), axis=1).max())
    return View(azimuth=view.azimuth, elevation=view.elevation, up=view.up, centre=(x, y, z), radius=radius)


def save_png(image: Image, path: Path | str) -> None:
    """Write an image as a PNG file, whole or not at all."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} does not exist", file=path, remedy="create it first")
    temporary = path.with_name(f".{path.name}.part")
    try:
        imsave(temporary, np.ascontiguousarray(image), format="png")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _corner_colors(mesh: Mesh, colors: ArrayLike) -> FloatArray:
    given = np.asarray(colors, dtype=np.float64)
    if given.shape == (3,):
        return np.broadcast_to(given, (len(mesh.faces), 3, 3))
    if given.shape == (len(mesh.vertices), 3):
        return np.asarray(given[mesh.faces])
    if given.shape == (len(mesh.faces), 3):
        return np.repeat(given[:, None, :], 3, axis=1)
    raise InputError(
        f"colors have shape {given.shape}, but {mesh.name} has {len(mesh.vertices)} vertices and"
        f" {len(mesh.faces)} faces",
        remedy="give one row of red, green, blue a vertex or a face, or one for all",
    )


def _in_picture(mesh: Mesh, view: View, fine: int) -> tuple[FloatArray, FloatArray]:
    """(m, 3, 3) corners in pixels (depth grows towards the eye), and the (m, 3, 3) normals there."""
    framed = framing(mesh, view)
    centre = np.array(framed.centre if view.centre is None else view.centre)
    radius = framed.radius if view.radius is None else view.radius
    scale = 0.48 * fine / (radius or 1.0)
    place = (mesh.vertices - centre) @ view.rotation.T * scale
    place = place * [1, -1, 1] + [fine / 2, fine / 2, 0]
    return place[mesh.faces], (mesh.vertex_normals @ view.rotation.T)[mesh.faces]


def _visible(corners: FloatArray, fine: int) -> tuple[NDArray[np.bool_], IntArray, FloatArray]:
    """Of each pixel: whether a triangle covers its centre, the nearest such triangle, and barycentric weights in it."""
    depth = np.full(fine * fine, -np.inf)
    face = np.zeros(fine * fine, dtype=np.int64)
    weight = np.zeros((fine * fine, 3))
    low = np.clip(np.ceil(corners[:, :, :2].min(axis=1) - 0.5), 0, fine).astype(np.int64)
    high = np.clip(np.floor(corners[:, :, :2].max(axis=1) - 0.5) + 1, 0, fine).astype(np.int64)
    extent = np.maximum(high - low, 0)
    counts = extent.prod(axis=1)
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        before = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, before + _BLOCK, side="right")))
        chosen = np.arange(start, stop)
        owner = np.repeat(chosen, counts[chosen])
        place = np.arange(len(owner)) - np.repeat(ends[chosen] - counts[chosen] - before, counts[chosen])
        x = low[owner, 0] + place % np.maximum(extent[owner, 0], 1)
        y = low[owner, 1] + place // np.maximum(extent[owner, 0], 1)
        inside, bary, near = _covering(corners, owner, x + 0.5, y + 0.5)
        pixel, owner = (y * fine + x)[inside], owner[inside]
        np.maximum.at(depth, pixel, near)
        front = near == depth[pixel]
        face[pixel[front]], weight[pixel[front]] = owner[front], bary[front]
        start = stop
    return np.isfinite(depth), face, weight


def _covering(
    corners: FloatArray, owner: IntArray, x: FloatArray, y: FloatArray
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Tell which places lie in their triangles; of those, the barycentric weights and the depth."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    inverse = np.divide(1.0, doubled, out=np.zeros_like(doubled), where=doubled != 0)
    dx, dy, scale = x - a[owner, 0], y - a[owner, 1], inverse[owner]
    second = (dx * (c - a)[owner, 1] - dy * (c - a)[owner, 0]) * scale
    third = (dy * (b - a)[owner, 0] - dx * (b - a)[owner, 1]) * scale
    inside = (second >= 0) & (third >= 0) & (second + third <= 1) & (scale != 0)
    second, third, owner = second[inside], third[inside], owner[inside]
    weight = np.stack([1 - second - third, second, third], axis=1)
    return inside, weight, np.einsum("pc,pc->p", weight, corners[owner, :, 2])


def _shaded(color: FloatArray, normal: FloatArray) -> FloatArray:
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    back = normal[:, 2] < 0
    normal = np.where(back[:, None], -normal, normal)
    # A light above the eye's right shoulder, and some that comes from everywhere and more from above.
    strength = 0.38 + 0.08 * normal[:, 1] + 0.58 * np.clip(normal @ _LIGHT, 0.0, None)
    base = np.where(back[:, None], 0.45 * color + 0.25 * color.mean(axis=1, keepdims=True), color)
    gloss = 0.12 * np.clip(normal @ _LIGHT, 0.0, None) ** 24 * ~back
    return np.asarray(np.clip(base * strength[:, None] + gloss[:, None], 0.0, 1.0))


def _averaged(pixels: FloatArray) -> Image:
    """Average squares of pixels, so that outlines are smooth; colours count by their opacity."""
    size = len(pixels) // _OVERSAMPLING
    squares = pixels.reshape(size, _OVERSAMPLING, size, _OVERSAMPLING, 4)
    opacity = squares[..., 3].mean(axis=(1, 3))
    color = (squares[..., :3] * squares[..., 3:]).mean(axis=(1, 3))
    color = np.divide(color, opacity[..., None], out=np.zeros_like(color), where=opacity[..., None] > 0)
    return np.round(255 * np.concatenate([color, opacity[..., None]], axis=-1)).astype(np.uint8)
