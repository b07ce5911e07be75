"""Draw a whole data set on one sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nonrigid.benchmark.datasets.protocols import Dataset, PairSpec
from nonrigid.benchmark.render import PLAIN, Image, View, framing, position_colors, render
from nonrigid.geometry.errors import InputError, UnknownNameError

_CAPTION = 16
"""Height in pixels of the line under each picture."""
_DPI = 100


def contact_sheet(
    dataset: Dataset,
    *,
    splits: Sequence[str] = (),
    view: View | None = None,
    size: int = 160,
    per_class: int = 12,
) -> tuple[Image, int]:
    """Draw every full shape, and to its right its parts by split; small parts are drawn larger, up to a limit.

    A place of a part has the colour of its true point of the full shape, so that wrong ground truth shows as wrong
    colours; parts without ground truth are plain.

    Parameters
    ----------
    splits
        Draw these only; all where empty.
    view, size
        From where, and how many pixels wide and high each picture is.
    per_class
        The most parts of a class and split that are drawn, evenly chosen.

    Returns
    -------
    The sheet, and the number of shapes on it.

    Raises
    ------
    UnknownNameError
        If the data set has no such split.
    """
    view = view or View(up="z")
    if size < 32 or per_class < 1:
        raise InputError(f"size {size}, {per_class} a class", remedy="ask for at least 32 pixels and 1 part a class")
    specs = dataset.pairs()
    known = {spec.split for spec in specs}
    for split in splits:
        if split not in known:
            raise UnknownNameError("split", split, known)
    groups: dict[tuple[str, str], list[PairSpec]] = {}
    for spec in specs:
        if not splits or spec.split in splits:
            groups.setdefault((spec.class_name, spec.split), []).append(spec)
    rows = [_row(_evenly(groups[key], per_class), view, size) for key in sorted(groups)]
    width = max(len(row) for row in rows)
    return _sheet(rows, width, size), sum(len(row) for row in rows)


def _evenly(specs: Sequence[PairSpec], count: int) -> list[PairSpec]:
    return [specs[place] for place in np.unique(np.linspace(0, len(specs) - 1, count).round().astype(int))]


def _row(specs: Sequence[PairSpec], view: View, size: int) -> list[tuple[str, Image]]:
    full = specs[0].load_full()
    frame = framing(full, view)
    whole = View(azimuth=view.azimuth, elevation=view.elevation, up=view.up)
    row = [(specs[0].class_name, render(full, position_colors(full.vertices, full), view=whole, size=size))]
    for spec in specs:
        data = spec.load()
        colors = PLAIN if data.truth is None else position_colors(data.truth.positions(data.full), data.full)
        own = framing(data.part, view)
        radius = max(own.radius or 0.0, 0.6 * (frame.radius or 0.0))
        near = View(azimuth=view.azimuth, elevation=view.elevation, up=view.up, centre=own.centre, radius=radius)
        number = spec.metadata.get("number")
        label = spec.name if number is None else f"{spec.split} {number}"
        row.append((label, render(data.part, colors, view=near, size=size)))
    return row


def _sheet(rows: Sequence[Sequence[tuple[str, Image]]], width: int, size: int) -> Image:
    height = size + _CAPTION
    paper = np.full((len(rows) * height, width * size, 3), 255.0)
    figure = Figure(figsize=(paper.shape[1] / _DPI, paper.shape[0] / _DPI), dpi=_DPI)
    for i, row in enumerate(rows):
        for j, (label, image) in enumerate(row):
            opacity = image[..., 3:] / 255.0
            here = (slice(i * height, i * height + size), slice(j * size, (j + 1) * size))
            paper[here] = image[..., :3] * opacity + paper[here] * (1.0 - opacity)
            x, y = (j + 0.5) * size / paper.shape[1], 1.0 - ((i + 1) * height - 4) / paper.shape[0]
            figure.text(x, y, label, ha="center", va="bottom", fontsize=7, color="#333333")
    figure.figimage(paper / 255.0, resize=False)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.array(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
