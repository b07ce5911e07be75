"""Error curves: the share of matches within each error, a panel a split."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from nonrigid.benchmark.aggregate import Summary, scored_rows, summarize
from nonrigid.benchmark.protocol import THRESHOLDS
from nonrigid.benchmark.report.series import Series, leading, which
from nonrigid.benchmark.report.sketch import FAINT, Sketch, legend


def error_curves(series: Sequence[Series]) -> list[Sketch]:
    """Return the figure of error curves: dense methods solid, sparse ones dashed.

    Source: Cosmo et al. 2016, "SHREC'16: Partial Matching of Deformable Shapes", figure 6.
    """
    shown = leading(series)
    if not shown:
        return []
    splits = list(dict.fromkeys(record["split"] for one in shown for record in one.records))
    means: dict[tuple[str, str], Summary] = {}
    for one in shown:
        for split in splits:
            scores = scored_rows([record for record in one.records if record["split"] == split])
            if any(score.match_count for score in scores):
                means[one.name, split] = summarize(scores)
    metric = next(iter(means.values())).metric

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(splits), sharey=True, squeeze=False)[0]
        for axes, split in zip(panels, splits, strict=True):
            for one in shown:
                mean = means.get((one.name, split))
                if mean is not None:
                    style = "-" if one.dense else (0, (5, 2))
                    axes.plot(
                        THRESHOLDS,
                        100 * mean.curve,
                        label=one.name,
                        linestyle=style,
                        color=one.colour,
                        marker=one.marker,
                        markevery=10,
                        markersize=4,
                        linewidth=1.8,
                    )
            axes.set(xlim=(0, 0.25), ylim=(0, 102), xlabel="geodesic error / sqrt(full area)", title=split)
            axes.grid(color=FAINT, linewidth=0.6)
        panels[0].set_ylabel("% of matches")
        legend(figure)

    counts = "; ".join(
        f"{split}: {max((means[key].shape_count for key in means if key[1] == split), default=0)} shapes"
        for split in splits
    )
    caption = (
        f"Share of the matched points whose geodesic error ({metric}) is at most the threshold: mean over the shapes "
        f"with a match ({counts}), the better of the direct and the mirrored map for each shape. Dense methods solid, "
        f"sparse ones dashed; a sparse curve says nothing about the points it leaves out.{which(series, shown)}"
    )
    rows = [
        {"series": name, "split": split, "threshold": float(threshold), "share": float(share)}
        for (name, split), mean in means.items()
        for threshold, share in zip(THRESHOLDS, mean.curve, strict=True)
    ]
    return [
        Sketch(
            name="curves",
            title="Error curves",
            caption=caption,
            rows=rows,
            draw=draw,
            size=(7.6, 4.2) if len(splits) == 1 else (4.2 * min(len(splits), 3), 4.4),
        )
    ]
