"""Does a better objective give a better match? Objective gap against matching error."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from nonrigid.benchmark.report.series import Series
from nonrigid.benchmark.report.sketch import FAINT, Sketch, keys, legend
from nonrigid.benchmark.statistics.averages import rank_correlation

_SMALLEST_GAP = 1e-9
"""Gaps below this are drawn here, since a logarithm has no zero."""


def gap_against_error(series: Sequence[Series]) -> list[Sketch]:
    """Return the figure of gap against error where some run falls short of the best objective."""
    rows = [
        {
            "method": one.label,
            "backend": one.backend,
            "pair": record["pair"],
            "gap": float(record["gap"]),
            "error x100": 100 * float(record["mean_error"]),
        }
        for one in series
        for record in one.matched
        if record.get("gap") is not None
    ]
    if not any(row["gap"] > _SMALLEST_GAP for row in rows):
        return []

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        looks = {}
        for one in series:
            mine = [row for row in rows if (row["method"], row["backend"]) == (one.label, one.backend)]
            if mine:
                looks[one.name] = one
                axes.plot(
                    [max(row["gap"], _SMALLEST_GAP) for row in mine],
                    [row["error x100"] for row in mine],
                    color=one.colour,
                    marker=one.marker,
                    linestyle="",
                    markersize=5,
                    alpha=0.75,
                )
        axes.set(xscale="log", xlabel="relative gap to the best objective known", ylabel="mean geodesic error x100")
        axes.set_ylim(bottom=0)
        axes.grid(color=FAINT, linewidth=0.6)
        legend(figure, keys(list(looks.values())))

    said = []
    for label in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == label]
        rho = rank_correlation([row["gap"] for row in mine], [row["error x100"] for row in mine])
        said.append(f"{label}: {'not defined' if rho is None else f'{rho:.2f}'} ({len(mine)} runs)")
    caption = (
        "Relative gap of the first problem's objective to the best that any backend reached on it, against the "
        f"matching error of the run; gaps below {_SMALLEST_GAP:g} are drawn there. Spearman's rank correlation over "
        f"all runs of a method, {'; '.join(said)}: near 1, a better objective goes with a better match."
    )
    return [Sketch(name="gap", title="Objective against matching error", caption=caption, rows=rows, draw=draw)]
