"""Write the measured half of docs/study.md, and its figure, from the results of `nonrigid bench study`.

Usage: python docs/draw_study.py RESULTS [docs]
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from nonrigid.benchmark.report.export import as_markdown
from nonrigid.benchmark.statistics.averages import rank_correlation
from nonrigid.benchmark.store import Record, Store

SMALLEST = 1e-9  # gaps below are drawn there
LOOKS = ("o", "s", "^", "v", "D", "P", "X", "*")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
NAMES = {"gt": "GT", "en": "EN", "im": "IM", "pfm": "PFM", "rf": "RF"}


def main() -> None:
    """Read the results, draw the figure, and write the generated half of the page between its two marks."""
    folder = Path(sys.argv[1])
    docs = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    records = Store(folder).records()
    draw(records, docs / "figures" / "study.png")
    page = docs / "study.md"
    head, mark, rest = page.read_text(encoding="utf-8").partition("<!-- measured -->\n")
    tail = rest.partition("<!-- end of measured -->\n")[2]
    page.write_text(f"{head}{mark}\n{tables(records)}\n<!-- end of measured -->\n{tail}", encoding="utf-8")


def tables(records: Sequence[Record]) -> str:
    """Return the tables of backends and of spreads as markdown."""
    rows = [
        {
            "method": NAMES.get(method, method),
            "backend": backend,
            "gap": middle(runs, "gap"),
            "error": None if (mean := average(runs, "mean_error")) is None else 100 * mean,
            "solve": middle(runs, "solve_seconds"),
            "accepted": f"{sum(bool(run['accepted']) for run in runs)} of {len(runs)}",
            "ended": ", ".join(f"{n} {word}" for word, n in Counter(run["status"] for run in runs).most_common()),
        }
        for (method, backend), runs in grouped(records).items()
    ]
    heads = ("method", "backend", "median gap", "mean error x100", "median solve s", "accepted", "how runs ended")
    spread = []
    for method in dict.fromkeys(run["method"] for run in records):
        mine = [run for run in records if run["method"] == method and run.get("mean_error") is not None]
        pairs, backends = spreads(mine)
        rho = within_pairs(mine)
        words = {"rho": "not defined" if rho is None else round(rho, 2), "pairs": pairs, "backends": backends}
        spread.append({"method": NAMES.get(method, method), "runs": len(mine), **words})
    columns = {"method": "method", "runs": "runs with a match", "rho": "rank correlation of gap and error within pairs"}
    columns |= {"pairs": "spread of the error between pairs", "backends": "between backends on one pair"}
    shown = dict(zip(rows[0], heads, strict=True))
    return f"{as_markdown(rows, shown)}\n{as_markdown(spread, columns)}"


def grouped(records: Sequence[Record]) -> dict[tuple[str, str], list[Record]]:
    """Return the runs of each method and backend, in the plan's order."""
    found: dict[tuple[str, str], list[Record]] = {}
    for run in records:
        found.setdefault((run["method"], run["backend"]), []).append(run)
    return found


def middle(runs: Sequence[Record], name: str) -> float | None:
    """Return the median of a column over the runs that have it."""
    values = [run[name] for run in runs if run.get(name) is not None]
    return float(np.median(values)) if values else None


def average(runs: Sequence[Record], name: str) -> float | None:
    """Return the mean of a column over the runs that have it."""
    values = [run[name] for run in runs if run.get(name) is not None]
    return float(np.mean(values)) if values else None


def within_pairs(runs: Sequence[Record]) -> float | None:
    """Return Spearman's rank correlation of gap and error over all runs, each less its pair's median."""
    gaps, errors = [], []
    for pair in dict.fromkeys(run["pair"] for run in runs):
        mine = [run for run in runs if run["pair"] == pair and run.get("gap") is not None]
        if len(mine) > 1:
            gap = np.log10([max(run["gap"], SMALLEST) for run in mine])
            error = np.array([run["mean_error"] for run in mine])
            gaps += list(gap - np.median(gap))
            errors += list(error - np.median(error))
    return rank_correlation(np.round(gaps, 9), np.round(errors, 9))


def spreads(runs: Sequence[Record]) -> tuple[float, float]:
    """Return standard deviations of the error, x100: of the means of pairs, and of backends about their pair's mean."""
    pairs = dict.fromkeys(run["pair"] for run in runs)
    errors = [np.array([100 * run["mean_error"] for run in runs if run["pair"] == pair]) for pair in pairs]
    between = float(np.std([one.mean() for one in errors]))
    return between, float(np.sqrt(np.mean(np.concatenate([(one - one.mean()) ** 2 for one in errors]))))


def draw(records: Sequence[Record], place: Path) -> None:
    """Draw gap against error, a panel a method."""
    methods = list(dict.fromkeys(run["method"] for run in records))
    backends = list(dict.fromkeys(run["backend"] for run in records))
    figure = Figure(figsize=(3.0 * len(methods), 3.6), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(methods)))
    for axis, method in zip(axes, methods, strict=True):
        for place_, backend in enumerate(backends):
            runs = [run for run in grouped(records).get((method, backend), []) if run.get("gap") is not None]
            runs = [run for run in runs if run.get("mean_error") is not None]
            axis.plot(
                [max(run["gap"], SMALLEST) for run in runs],
                [100 * run["mean_error"] for run in runs],
                linestyle="",
                marker=LOOKS[place_],
                color=COLOURS[place_],
                alpha=0.75,
                label=backend,
            )
        axis.set(xscale="log", xlabel="gap of the first problem", title=NAMES.get(method, method))
        axis.set_xlim(SMALLEST / 3, 3.0 * max(1.0, *(run["gap"] or 0.0 for run in records)))
        axis.set_ylim(bottom=0)
        axis.grid(color="#dddddd", linewidth=0.6)
    axes[0].set_ylabel("mean geodesic error x100")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(backends), frameon=False)
    figure.savefig(place, dpi=110)


if __name__ == "__main__":
    main()
