"""Draw figures in every form: SVG for light and dark pages, PNG and PDF for papers, and their data as CSV."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.report.export import Row, write_table
from nonrigid.benchmark.report.series import Series

INK, FAINT = "#1f2328", "#d8dce1"
"""Colours of text and axes, and of grids, on a light page."""
_DARK = {INK: "#e6e8eb", FAINT: "#3a4048"}
_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "nonrigid",
    "pdf.fonttype": 42,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.parse_math": False,  # labels are the users' words
}


_INKED: tuple[Any, ...] = ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")


@dataclass(frozen=True, eq=False, kw_only=True)
class Sketch:
    """Describe a figure that is not yet drawn.

    Parameters
    ----------
    name
        Of its files.
    title, caption
        What it is, and what it shows, with the numbers of its data.
    rows
        What is drawn, as a table.
    draw
        Draws into a figure.
    size
        Width and height in inches.
    """

    name: str
    title: str
    caption: str
    rows: Sequence[Row]
    draw: Callable[[Figure], None]
    size: tuple[float, float] = (7.6, 4.2)


def save_sketch(out: Path, sketch: Sketch) -> None:
    """Write `<name>-light.svg`, `<name>-dark.svg`, `<name>.png`, `<name>.pdf`, `<name>.csv` and `<name>.tex`."""
    with mpl.rc_context({**_STYLE, **dict.fromkeys(_INKED, INK)}):
        figure = Figure(figsize=sketch.size, layout="constrained")
        sketch.draw(figure)
        # One layout serves all forms; it is what takes longest.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        light = out / f"{sketch.name}-light.svg"
        figure.savefig(light, transparent=True, metadata={"Date": None})
        figure.savefig(out / f"{sketch.name}.png", dpi=200, facecolor="white")
        figure.savefig(out / f"{sketch.name}.pdf", metadata={"CreationDate": None})
    drawn = light.read_text(encoding="utf-8")
    for bright, dark in _DARK.items():
        drawn = drawn.replace(bright, dark)
    write_text(out / f"{sketch.name}-dark.svg", drawn)
    write_table(out / sketch.name, sketch.rows)


def legend(figure: Figure, handles: Iterable[Any] | None = None) -> None:
    """Put one legend for all panels to the right of them, or below where it is long."""
    shown: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    if handles is not None:
        shown = {handle.get_label(): handle for handle in handles}
    widest = max((len(label) for label in shown), default=0)
    below = len(figure.axes) > 1 or widest > 34
    columns = max(1, min(len(shown), 110 // (widest + 6))) if below else 1
    figure.legend(
        shown.values(), shown.keys(), loc="outside lower center" if below else "outside right upper", ncols=columns
    )


def keys(shown: Sequence[Series]) -> list[Line2D]:
    """Return legend entries: a colour a method and a marker a backend, or one entry a backend for one method."""
    methods = {one.label: one.colour for one in shown}
    backends = {one.backend: one.marker for one in shown}
    if len(methods) == 1:
        return [Line2D([], [], color=one.colour, marker=one.marker, ls="", label=one.name) for one in shown]
    return [Line2D([], [], color=colour, lw=4, label=method) for method, colour in methods.items()] + [
        Line2D([], [], color=INK, marker=marker, ls="", label=backend) for backend, marker in backends.items()
    ]
