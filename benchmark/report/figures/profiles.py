"""Performance profile by time and data profile by evaluations of the first problem of every method and pair."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from nonrigid.benchmark.report.series import MARKERS, PALETTE, Series
from nonrigid.benchmark.report.sketch import FAINT, Sketch, legend
from nonrigid.benchmark.statistics.profiles import Profile, cost_to_reach, data_profile, performance_profile
from nonrigid.benchmark.store import Record

SOLVED_GAP = 0.01
"""A problem counts as solved if the objective is within this relative gap of the best that any backend reached."""

DECREASE_LEFT = 0.01
"""A trace has converged where at most this share of the best improvement over the start is left."""


def solver_profiles(series: Sequence[Series]) -> list[Sketch]:
    """Return both profiles where at least two backends solved the same problems."""
    backends = list(dict.fromkeys(one.backend for one in series))
    problems: dict[tuple[str, str], dict[str, Record]] = {}
    for one in series:
        for record in one.records:
            problems.setdefault((one.label, record["pair"]), {})[one.backend] = record
    # A problem that some backend has not yet tried would count as its failure.
    tried = [runs for runs in problems.values() if len(runs) == len(backends)]
    if len(backends) < 2 or not tried:
        return []
    seconds = [[_seconds(runs[backend]) for backend in backends] for runs in tried]
    evaluations = [_evaluations([runs[backend] for backend in backends]) for runs in tried]
    found = []
    for name, title, axis, what, costs, profile in (
        (
            "profile",
            "Performance profile",
            "within this factor of the fastest backend",
            f"within a factor of the fastest. Solved means an objective within {SOLVED_GAP:.0%} of the best that any "
            "backend reached on that problem; time is that of building and solving",
            seconds,
            performance_profile(seconds, backends),
        ),
        (
            "data-profile",
            "Data profile",
            "evaluations of objective and gradient",
            f"within a number of evaluations of objective and gradient (one counts as one whatever the dimension). "
            f"Solved means that at most {DECREASE_LEFT:.0%} of the best improvement over the start is left",
            evaluations,
            data_profile(evaluations, np.zeros(len(tried)), backends),
        ),
    ):
        unsolved = sum(not np.isfinite(row).any() for row in costs)
        caption = (
            f"Share of the first problems of {len(tried)} methods and pairs that each backend solves {what}. A failure "
            f"is an infinite cost; {unsolved} problems are solved by none."
        )
        found.append(_sketch(name, title, axis, caption, profile))
    return found


def _sketch(name: str, title: str, axis: str, caption: str, profile: Profile) -> Sketch:
    ends = [steps[-1] for steps in profile.at if len(steps)]
    starts = [steps[0] for steps in profile.at if len(steps)]
    low, high = min(starts, default=1.0), 1.1 * max(ends, default=1.0) + 0.1

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        for index, (solver, steps) in enumerate(zip(profile.solvers, profile.at, strict=True)):
            at = np.concatenate([[low], steps, [high]])
            axes.step(
                at,
                100 * profile.share(solver, at),
                where="post",
                label=solver,
                color=PALETTE[index % len(PALETTE)],
                linestyle=("-", (0, (5, 2)), (0, (1.5, 1.5)))[index // len(PALETTE) % 3],
                marker=MARKERS[index % len(MARKERS)],
                markevery=max(1, len(at) // 6),
                markersize=4,
            )
        axes.set(xscale="log", xlim=(low, high), ylim=(0, 102), xlabel=axis, ylabel="% of problems")
        axes.grid(color=FAINT, linewidth=0.6)
        legend(figure)

    rows = [
        {"backend": solver, "cost": float(cost), "share": float(profile.share(solver, cost))}
        for solver, steps in zip(profile.solvers, profile.at, strict=True)
        for cost in np.unique(steps)
    ]
    return Sketch(name=name, title=title, caption=caption, rows=rows, draw=draw)


def _seconds(record: Record) -> float:
    stage = record["stages"][0] if record["stages"] else None
    if stage is None or not stage["usable"] or stage["gap"] is None or stage["gap"] > SOLVED_GAP:
        return math.inf
    # Below a microsecond the clock says nothing.
    return max(float(stage["build_seconds"] + stage["solve_seconds"]), 1e-6)


def _evaluations(records: Sequence[Record]) -> list[float]:
    """Return for each run of one problem the evaluations until it converged."""
    stages = [record["stages"][0] if record["stages"] else None for record in records]
    usable = [stage for stage in stages if stage is not None and stage["usable"] and stage["gap"] is not None]
    if not usable or len({stage["problem_hash"] for stage in usable}) > 1:
        return [math.inf] * len(records)
    sign = -1.0 if usable[0]["sense"] == "maximize" else 1.0
    best = min(sign * stage["objective"] for stage in usable)
    starts = [sign * point[2] for stage in usable for point in stage["trace"][:1] if point[2] is not None]
    found = []
    for stage in stages:
        if stage is None or not stage["usable"] or stage["gap"] is None:
            found.append(math.inf)
            continue
        # The trace is thinned; the answer itself stands at its end.
        points = [(sign * p[2], p[1]) for p in stage["trace"] if p[2] is not None]
        points.append((sign * stage["objective"], stage["evaluations"]))
        values, costs = zip(*points, strict=True)
        cost = cost_to_reach(values, costs, start=max(starts, default=best), best=best, tolerance=DECREASE_LEFT)
        # Closed forms need no evaluation at all.
        found.append(max(cost, 1.0))
    return found
