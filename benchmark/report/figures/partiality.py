"""Mean error against the missing area, in disjoint and in cumulative bins."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from nonrigid.benchmark.aggregate import by_partiality, scored_rows
from nonrigid.benchmark.report.series import Series, leading, which
from nonrigid.benchmark.report.sketch import FAINT, Sketch, legend

_BINS = {"disjoint": "missing area within 10 % below", "cumulative": "missing area at most"}


def error_by_missing_area(series: Sequence[Series]) -> list[Sketch]:
    """Return the figure of mean error by missing area, a row of panels a way of binning and a column a split.

    Source: Cosmo et al. 2016, "SHREC'16: Partial Matching of Deformable Shapes", figure 7.
    """
    shown = leading(series)
    if not shown:
        return []
    splits = list(dict.fromkeys(record["split"] for one in shown for record in one.records))
    rows: list[dict[str, Any]] = [
        {
            "series": one.name,
            "split": split,
            "bins": bins,
            "missing area up to %": int(re.findall(r"\d+", summary.label)[-1]),
            "shapes": summary.shape_count,
            "without a match": summary.empty_count,
            "mean error x100": 100 * summary.mean_error,
        }
        for bins in _BINS
        for one in shown
        for split in splits
        for summary in by_partiality(
            scored_rows([record for record in one.records if record["split"] == split]), cumulative=bins == "cumulative"
        )
    ]

    # The panels share one axis, whose limit must not depend on which of them is drawn last.
    heights = [row["mean error x100"] for row in rows if row["shapes"]]
    highest = max([height for height in heights if math.isfinite(height)], default=1.0) or 1.0

    def draw(figure: Figure) -> None:
        panels = figure.subplots(2, len(splits), sharex=True, sharey=True, squeeze=False)
        for line, bins in zip(panels, _BINS, strict=True):
            for axes, split in zip(line, splits, strict=True):
                for one in shown:
                    mine = [r for r in rows if (r["series"], r["split"], r["bins"]) == (one.name, split, bins)]
                    axes.plot(
                        [row["missing area up to %"] for row in mine],
                        [row["mean error x100"] for row in mine],
                        label=one.name,
                        color=one.colour,
                        marker=one.marker,
                        linestyle="-" if one.dense else (0, (5, 2)),
                        linewidth=1.4,
                        markersize=5,
                    )
                axes.set(xlabel=f"{_BINS[bins]} (%)", title=split if bins == "disjoint" else None)
                axes.set(xlim=(0, 102), ylim=(0, 1.05 * highest))
                axes.grid(color=FAINT, linewidth=0.6)
            line[0].set_ylabel("mean error x100")
        legend(figure)

    counts = [r["shapes"] for r in rows if r["bins"] == "disjoint" and r["series"] == shown[0].name]
    caption = (
        "Mean geodesic error x100 of the shapes with a match, by the share of the full shape's area that is missing: "
        "above those whose missing area lies within 10 % below the mark, below all those with at most that much "
        f"missing, as the track's page defines. Shapes in the upper bins of {shown[0].name}: "
        f"{', '.join(str(count) for count in counts)}. Dense methods solid, sparse ones dashed.{which(series, shown)}"
    )
    return [
        Sketch(
            name="partiality",
            title="Error by missing area",
            caption=caption,
            rows=rows,
            draw=draw,
            size=(7.6, 6.2) if len(splits) == 1 else (4.2 * min(len(splits), 3), 6.4),
        )
    ]
