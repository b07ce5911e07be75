"""Say before a benchmark is run what it will take: runs, hours and disk, from finished runs where there are some."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from nonrigid.benchmark.plan import Plan
from nonrigid.benchmark.run import Run
from nonrigid.benchmark.runner import plan_runs
from nonrigid.benchmark.store import Record, Store
from nonrigid.benchmark.task import absolute

ASSUMED_SECONDS = 60.0
"""Time of a run where nothing like it is finished and its limits allow more."""

ASSUMED_BYTES = 500_000
"""Disk of a run where none is finished: mostly one point a vertex of the part."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Say what a plan still takes.

    Parameters
    ----------
    runs, finished
        Runs of the plan, and how many of them are done.
    hours
        Wall-clock hours of the others with these workers.
    gigabytes
        Disk of their results; derived geometry is cached elsewhere.
    rows
        One a method and backend: its runs, what is finished, seconds a run and where that number comes from.
    """

    runs: int
    finished: int
    hours: float
    gigabytes: float
    rows: tuple[Mapping[str, object], ...]


def estimate(plan: Plan, out: Path, *, workers: int = 1) -> Estimate:
    """Estimate what the runs take that `run_plan` would do.

    The time of a run is the median over finished runs of the same method and backend; else over those of the same
    method; else the limit of a solve, or `ASSUMED_SECONDS` where that is less.
    """
    store = Store(out)
    runs = [run for spec in plan.pairs() for run in plan_runs(plan, absolute(spec))]
    done = store.finished(run.id for run in runs)
    known = [store.read_run(run) for run in sorted(done)]
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.label, run.backend), []).append(run)
    rows, seconds = [], 0.0
    for (label, backend), members in groups.items():
        each, source = _seconds(members[0], known)
        left = sum(run.id not in done for run in members)
        seconds += left * each
        rows.append(
            {
                "method": label,
                "backend": backend,
                "runs": len(members),
                "finished": len(members) - left,
                "seconds": each,
                "from": source,
            }
        )
    size = _bytes(store, done)
    return Estimate(
        runs=len(runs),
        finished=len(done),
        hours=seconds / 3600.0 / workers,
        gigabytes=size * (len(runs) - len(done)) / 1e9,
        rows=tuple(rows),
    )


def _seconds(run: Run, known: Sequence[Record]) -> tuple[float, str]:
    timed = [record for record in known if record["total_seconds"] is not None]
    mine = [record for record in timed if record["settings"] == repr(run.formulation)]
    same = [record for record in mine if record["backend"] == run.backend]
    for members, words in ((same, "finished runs"), (mine, "finished runs with other backends")):
        if members:
            return median(record["total_seconds"] for record in members), f"{len(members)} {words}"
    bounds = [bound for bound in (run.limits.seconds, run.run_seconds) if bound is not None]
    return min([*bounds, ASSUMED_SECONDS]), "assumed: none is finished"


def _bytes(store: Store, done: set[str]) -> float:
    if not done:
        return ASSUMED_BYTES
    sizes = [
        sum(path.stat().st_size for path in store.files(run) if path.is_file())
        for run in sorted(done)[:: max(1, len(done) // 100)]
    ]
    return sum(sizes) / len(sizes)
