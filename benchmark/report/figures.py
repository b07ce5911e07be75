"""Draw error curves and error against time: as SVG and PNG for a light page, as SVG for a dark one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from nonrigid.benchmark.protocol import THRESHOLDS
from nonrigid.benchmark.store import Record

# Okabe and Ito's palette, told apart by readers with any colour vision; its black and yellow suit one page only.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">")
_INK = {"light": "#1f2328", "dark": "#e6e8eb"}
_FAINT = {"light": "#d8dce1", "dark": "#3a4048"}
_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "nonrigid",
    "legend.frameon": False,
}


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Name a figure's files inside the report, and say what it shows."""

    title: str
    caption: str
    light: str
    dark: str


def draw_figures(out: Path, records: Sequence[Record]) -> list[Drawn]:
    """Draw every figure for which there are scores into `out`."""
    series = _series(records)
    if not series:
        return []
    drawn = []
    metric = records[0]["metric"]
    count = len({record["pair"] for record in records})
    for name, title, caption, draw in (
        (
            "curves",
            "Error curves",
            f"Share of the matched points whose geodesic error ({metric}) is at most the threshold, mean over the "
            f"shapes with a match, of {count}; the better of the direct and the mirrored map for each shape.",
            _curves,
        ),
        (
            "time",
            "Error against time",
            "Mean geodesic error x100 against the mean solve time of a pair, over the pairs with a match; bars span "
            "the quartiles over pairs. Lower left is better.",
            _scatter,
        ),
    ):
        for theme in ("light", "dark"):
            with mpl.rc_context({**_STYLE, **_inked(theme)}):
                figure = Figure(figsize=(7.6, 4.4), layout="constrained")
                draw(figure, series, theme)
                figure.savefig(out / f"{name}-{theme}.svg", transparent=True, metadata={"Date": None})
                if theme == "light":
                    figure.savefig(out / f"{name}.png", dpi=200, facecolor="white")
        drawn.append(Drawn(title=title, caption=caption, light=f"{name}-light.svg", dark=f"{name}-dark.svg"))
    return drawn


def _series(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return the runs with matches by what a legend calls them, in the order of the plan."""
    several = len({record["label"] for record in records}) > 1
    found: dict[str, list[Record]] = {}
    for record in records:
        if record.get("match_count"):
            name = f"{record['label']}, {record['backend']}" if several else record["backend"]
            found.setdefault(name, []).append(record)
    return found


def _curves(figure: Figure, series: dict[str, list[Record]], theme: str) -> None:
    axes = figure.add_subplot()
    for index, (name, records) in enumerate(series.items()):
        mean = np.mean([record["curve"] for record in records], axis=0)
        axes.plot(THRESHOLDS, 100 * mean, label=name, linewidth=1.8, **_look(index))
    axes.set(xlim=(0, 0.25), ylim=(0, 102), xlabel="geodesic error / sqrt(full area)", ylabel="% of matches")
    axes.grid(color=_FAINT[theme], linewidth=0.6)
    figure.legend(loc="outside right upper", fontsize=8.5)


def _scatter(figure: Figure, series: dict[str, list[Record]], theme: str) -> None:
    axes = figure.add_subplot()
    for index, (name, records) in enumerate(series.items()):
        seconds = np.array([record["solve_seconds"] for record in records])
        errors = 100 * np.array([record["mean_error"] for record in records])
        x, y = seconds.mean(), errors.mean()
        # The mean of skewed values can lie outside the quartiles; that side then has no bar.
        spans = [
            np.maximum([c - np.percentile(v, 25), np.percentile(v, 75) - c], 0) for v, c in ((seconds, x), (errors, y))
        ]
        look = {"color": _look(index)["color"], "marker": _MARKERS[index % len(_MARKERS)]}
        axes.errorbar(
            x,
            y,
            xerr=spans[0][:, None],
            yerr=spans[1][:, None],
            label=name,
            markersize=7,
            linewidth=0.8,
            alpha=0.95,
            **look,
        )
    axes.set(xscale="log", xlabel="solve time of a pair (s)", ylabel="mean geodesic error x100")
    axes.set_ylim(bottom=0)
    axes.grid(color=_FAINT[theme], linewidth=0.6)
    figure.legend(loc="outside right upper", fontsize=8.5)


def _look(index: int) -> dict[str, Any]:
    return {
        "color": _COLOURS[index % len(_COLOURS)],
        "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)],
    }


def _inked(theme: str) -> dict[Any, Any]:
    ink = _INK[theme]
    names = ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")
    return dict.fromkeys(names, ink)
