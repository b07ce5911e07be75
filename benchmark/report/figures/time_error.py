"""Error against time, with the front of what no other solver beats in both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from nonrigid.benchmark.report.series import Series
from nonrigid.benchmark.report.sketch import FAINT, INK, Sketch, keys, legend
from nonrigid.benchmark.statistics.averages import pareto_front


def error_against_time(series: Sequence[Series]) -> list[Sketch]:
    """Return the figure of mean error against mean solve time, with quartile bars and the Pareto front.

    Another program's predictions took no time to solve here, and are left out.
    """
    shown = [one for one in series if any(record["solve_seconds"] > 0 for record in one.matched)]
    if not shown:
        return []
    rows: list[dict[str, Any]] = []
    for one in shown:
        seconds = np.array([record["solve_seconds"] for record in one.matched])
        errors = 100 * np.array([record["mean_error"] for record in one.matched])
        row: dict[str, Any] = {"method": one.label, "backend": one.backend, "pairs": len(errors)}
        for name, values in (("seconds", seconds), ("error x100", errors)):
            low, high = np.percentile(values, [25, 75])
            row |= {name: float(values.mean()), f"{name} quartile 1": float(low), f"{name} quartile 3": float(high)}
        rows.append(row)
    points = np.array([[row["seconds"], row["error x100"]] for row in rows], dtype=np.float64)
    front = pareto_front(points)
    for row, best in zip(rows, front, strict=True):
        row["on the front"] = "yes" if best else "no"

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        order = np.flatnonzero(front)[np.argsort(points[front, 0])]
        axes.step(points[order, 0], points[order, 1], where="post", color=INK, linewidth=0.8, alpha=0.6)
        for one, row, (x, y) in zip(shown, rows, points, strict=True):
            # The mean of skewed values can lie outside the quartiles; that side then has no bar.
            spans = [
                np.maximum([[c - row[f"{name} quartile 1"]], [row[f"{name} quartile 3"] - c]], 0)
                for name, c in (("seconds", x), ("error x100", y))
            ]
            axes.errorbar(
                x, y, xerr=spans[0], yerr=spans[1], color=one.colour, marker=one.marker, markersize=7, linewidth=0.8
            )
        axes.set(xscale="log", xlabel="mean solve time of a pair (s)", ylabel="mean geodesic error x100")
        axes.set_ylim(bottom=0)
        axes.grid(color=FAINT, linewidth=0.6)
        legend(figure, keys(shown))

    names = ", ".join(one.name for one, best in zip(shown, front, strict=True) if best)
    caption = (
        "Mean geodesic error x100 against the mean solve time of a pair, over the pairs with a match; bars span the "
        f"quartiles over pairs. Lower left is better; the line is the front that no other beats in both: {names}."
    )
    return [Sketch(name="time", title="Error against time", caption=caption, rows=rows, draw=draw)]
