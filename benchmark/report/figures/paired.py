"""How much worse than the best, pair by pair: differences with bootstrap intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean
from typing import Any

from matplotlib.figure import Figure

from nonrigid.benchmark.report.series import Series, leading, which
from nonrigid.benchmark.report.sketch import FAINT, INK, Sketch
from nonrigid.benchmark.statistics.paired import paired_difference

FEWEST = 6
"""Pairs below which an interval by resampling says too little to call a difference sure."""

MOST_ROWS = 24
"""Beyond this many combinations, each method is shown with its best backend only."""


def paired_differences(series: Sequence[Series]) -> list[Sketch]:
    """Return the figure of error differences to the series of least mean error, where there is another one."""
    shown = [one for one in series if one.matched]
    if len(shown) > MOST_ROWS:
        shown = leading(series)
    if len(shown) < 2:
        return []
    shown = sorted(shown, key=lambda one: one.mean_error)
    best, others = shown[0], shown[1:]
    rows: list[dict[str, Any]] = []
    for one in others:
        # A pair that one of them has not yet tried would count as its failure.
        pairs = sorted({r["pair"] for r in best.records} & {r["pair"] for r in one.records})
        mine, theirs = _errors(one), _errors(best)
        found = paired_difference([mine.get(p, math.inf) for p in pairs], [theirs.get(p, math.inf) for p in pairs])
        rows.append(
            {
                "series": one.name,
                "against": best.name,
                "pairs": found.pair_count,
                "difference x100": found.mean,
                "low": found.low,
                "high": found.high,
                "better": found.wins,
                "worse": found.losses,
                "equal": found.ties,
            }
        )

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        for place, (one, row) in enumerate(zip(others, rows, strict=True)):
            if row["pairs"]:
                axes.plot([row["low"], row["high"]], [place, place], color=one.colour, linewidth=2)
                axes.plot(row["difference x100"], place, color=one.colour, marker=one.marker, markersize=7)
        axes.axvline(0, color=INK, linewidth=0.8)
        axes.set_yticks(range(len(others)), [str(row["series"]) for row in rows])
        axes.invert_yaxis()
        axes.set(xlabel=f"error x100 less that of {best.name}")
        axes.grid(color=FAINT, linewidth=0.6, axis="x")

    sure = sum(row["low"] > 0 and row["pairs"] >= FEWEST for row in rows)
    caption = (
        f"Mean difference of the geodesic error x100 to {best.name}, which has the least mean error, over the pairs "
        f"that both matched, with the 95 % bootstrap interval over pairs (2000 resamples, seed 0). {sure} of "
        f"{len(others)} are worse beyond their interval on at least {FEWEST} pairs. In the table a pair without a "
        f"match loses to one with."
        f"{which(series, shown)}"
    )
    size = (7.6, 1.4 + 0.32 * len(others))
    return [Sketch(name="paired", title="Paired differences", caption=caption, rows=rows, draw=draw, size=size)]


def _errors(one: Series) -> dict[str, float]:
    """Return the errors by pair, the mean over seeds where a pair has several runs."""
    runs: dict[str, list[float]] = {}
    for record in one.matched:
        runs.setdefault(record["pair"], []).append(100 * record["mean_error"])
    return {pair: mean(errors) for pair, errors in runs.items()}
