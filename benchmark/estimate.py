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

ASSUMED_SECONDS = 60.0
"""Time of a run where nothing like it is finished and its limits allow more."""

ASSUMED_BYTES = 500_000
"""Disk of a run where none is finished: mostly one point a vertex of the part."""

_SAME = ("pair", "settings", "backend", "limits", "starts", "seed", "motion_seed", "metric")


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


def estimate(
    plan: Plan, out: Path, *, workers: int = 1, share: tuple[int, int] = (1, 1), fresh: bool = False
) -> Estimate:
    """Estimate what the runs take that `run_plan` would do with the same arguments, without reading a mesh.

    The time of a run is the median over finished runs of the same method and backend; else over those of the same
    method; else the limit of a solve, or `ASSUMED_SECONDS` where that is less.
    """
    store = Store(out)
    mine = plan.pairs()[share[0] - 1 :: share[1]]
    runs = [run for spec in mine for run in plan_runs(plan, spec, data="")]
    known = [store.read_run(path.stem) for path in sorted(store.runs.glob("[!.]*.json"))]
    held = {_key(record) for record in known}
    done = set() if fresh else {run for run in runs if _run_key(run) in held}
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.label, run.backend), []).append(run)
    rows, seconds = [], 0.0
    for (label, backend), members in groups.items():
        each, source = _seconds(members[0], known)
        left = sum(run not in done for run in members)
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
    size = _bytes(store, [record["id"] for record in known])
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


def _key(record: Record) -> tuple[object, ...]:
    return tuple(record.get(name) for name in _SAME)


def _run_key(run: Run) -> tuple[object, ...]:
    told = {**vars(run), "settings": repr(run.formulation), "limits": repr(run.limits)}
    return tuple(told[name] for name in _SAME)


def _bytes(store: Store, done: Sequence[str]) -> float:
    if not done:
        return ASSUMED_BYTES
    chosen = done[:: max(1, len(done) // 100)]
    return sum(path.stat().st_size for run in chosen for path in store.files(run) if path.is_file()) / len(chosen)
