"""Run a plan: tasks handed to an executor, every finished run kept at once, lost workers' tasks handed out again."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.benchmark.environment import known_environment
from nonrigid.benchmark.executors import Executor, Joblib
from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.held_out import held_out_for
from nonrigid.benchmark.plan import Plan
from nonrigid.benchmark.run import Run
from nonrigid.benchmark.store import Record, Store
from nonrigid.benchmark.task import Task, WorkerLostError, absolute, data_hash
from nonrigid.benchmark.terminal import json_text
from nonrigid.geometry.errors import InputError

_HEADS = ("index.json", "plan.toml", "environment.json", "*.parquet")
"""What is written into the folder of results itself, each first under a name of its own that begins with a dot."""

ROUNDS = 3
"""How often tasks are handed out again although workers died and no run was finished since."""


def run_plan(
    plan: Plan,
    out: Path,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    share: tuple[int, int] = (1, 1),
    fresh: bool = False,
    quiet: bool = False,
) -> list[Record]:
    """Do every run of a plan that is not finished, and return all that are.

    Parameters
    ----------
    out
        Folder of the results; see `nonrigid.benchmark.store.Store`.
    jobs
        Processes, each with one BLAS thread, where no executor is given.
    executor
        Who does the runs; see `nonrigid.benchmark.executors`.
    share
        (k, n): do the k-th of n shares of the pairs only, as another machine does the others; see `merge_results`.
    fresh
        Whether to repeat finished runs.
    quiet
        Whether to leave out the progress bar.

    Raises
    ------
    InputError
        If a mesh or ground truth of the plan cannot be read, two of its methods are the same, or another benchmark
        writes to `out`. Whatever goes wrong later is a row of the results.
    StorageError
        If results cannot be written; those that are finished are kept.
    WorkerLostError
        If workers died again and again without finishing a run.
    """
    executor = Joblib(workers=jobs) if executor is None else executor
    out = Path(os.path.abspath(out))  # noqa: PTH100 - a link is part of the name
    store = Store(out)
    store.prepare()
    with _alone(out):
        pairs = [absolute(spec) for spec in plan.pairs()]
        runs = {spec.name: plan_runs(plan, spec) for spec in pairs}
        _refuse_twins(runs)
        _write_head(plan, store, runs, executor.workers)
        mine = pairs[share[0] - 1 :: share[1]]
        ids = [run.id for spec in mine for run in runs[spec.name]]
        if fresh:
            store.drop(ids)
        with _progress(store, ids, quiet):
            _hand_out(executor, store, mine, runs, ids)
        records = store.records()
        store.write_table(records)
    return records


def plan_runs(plan: Plan, spec: PairSpec, *, data: str | None = None) -> list[Run]:
    """Return the runs of one pair: every method with every backend and every accuracy.

    `data` is the hash of the pair's meshes; where None, the pair is loaded for it.
    """
    data = data_hash(spec.load()) if data is None else data
    return [
        Run(
            pair=spec.name,
            split=spec.split,
            class_name=spec.class_name,
            label=f"{entry.label} ({accuracy})" if accuracy else entry.label,
            method=entry.method,
            formulation=held_out_for(entry.formulation, spec),
            backend=backend,
            starts=plan.starts,
            seed=plan.seed,
            motion_seed=plan.motion_seed,
            metric=plan.metric,
            limits=limits,
            data_hash=data,
            run_seconds=plan.run_seconds,
        )
        for entry in plan.methods
        for accuracy, limits in plan.variants()
        for backend in plan.backends
    ]


def _refuse_twins(runs: Mapping[str, Sequence[Run]]) -> None:
    """Raise `InputError` where two methods of a plan are the same but for their labels: their runs have one id."""
    for members in runs.values():
        labels: dict[str, str] = {}
        for run in members:
            if labels.setdefault(run.id, run.label) != run.label:
                raise InputError(
                    f"the methods {labels[run.id]!r} and {run.label!r} are the same with the same settings",
                    remedy="leave one of them out",
                )


def _write_head(plan: Plan, store: Store, runs: Mapping[str, Sequence[Run]], workers: int) -> None:
    labels = {run.id: run.label for members in runs.values() for run in members}
    word, found = known_environment()
    store.write_environment(word, found)
    with store.writing():
        write_text(store.folder / "plan.toml", plan.text)
        write_text(store.folder / "environment.json", json_text({**found, "jobs": workers}) + "\n")
    head: dict[str, object] = {
        "title": plan.title,
        "dataset": plan.data_word,
        "data": plan.dataset.name,
        "metric": plan.metric,
    }
    for name in ("root", "templates"):
        place = getattr(plan.dataset, name, None)
        head[name] = None if place is None else str(Path(place).resolve())
    store.write_index({**head, "runs": labels})


def _hand_out(
    executor: Executor, store: Store, pairs: Sequence[PairSpec], runs: Mapping[str, Sequence[Run]], ids: Sequence[str]
) -> None:
    barren = 0
    while len(done := store.finished(ids)) < len(ids):
        tasks = []
        for spec in pairs:
            todo = [run for run in runs[spec.name] if run.id not in done]
            for part in _shares(todo, -(-executor.workers // len(pairs))):
                tasks.append(Task(spec, part, store.folder))
        try:
            executor.do(tasks)
        except WorkerLostError as lost:
            barren = 0 if len(store.finished(ids)) > len(done) else barren + 1
            if barren == ROUNDS:
                raise WorkerLostError(
                    f"{lost}; {ROUNDS} times in a row, no run was finished in between: give fewer --jobs, or limit "
                    f"memory by [limits] memory_gb"
                ) from None


def _shares(runs: Sequence[Run], count: int) -> list[tuple[Run, ...]]:
    """Split the runs of a pair where there are more processes than pairs."""
    return [share for first in range(count) if (share := tuple(runs[first::count]))]


@contextlib.contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Hold the folder's lock, which the system takes back when this process dies, and clear away half-written files."""
    with (out / ".lock").open("w") as file:
        if os.name == "posix":
            import fcntl

            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    "another benchmark writes there", file=out, remedy="wait for it, or name another --out"
                ) from None
        own = [path for name in _HEADS for path in out.glob(f".{name}.*")]
        for folder in (out / "runs", out / "matches"):
            own += [*folder.glob(".*.*.*"), *folder.glob("*.part")]
        for path in own:
            if path.is_file():
                path.unlink(missing_ok=True)
        yield


@contextlib.contextmanager
def _progress(store: Store, ids: Sequence[str], quiet: bool) -> Iterator[None]:
    """Show how many runs are finished and when the rest will be, by looking for their files."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield
        return
    columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    stop = threading.Event()
    with Progress(*columns, console=console, auto_refresh=False, speed_estimate_period=3600.0) as bar:
        shown = bar.add_task("runs", total=len(ids), completed=len(store.finished(ids)))

        def look() -> None:
            while not stop.wait(0.5):
                bar.update(shown, completed=len(store.finished(ids)), refresh=True)

        watcher = threading.Thread(target=look, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            stop.set()
            watcher.join()
            bar.update(shown, completed=len(store.finished(ids)), refresh=True)
