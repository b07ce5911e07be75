"""Run a plan: pairs in parallel, one process each, every finished run kept at once."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from joblib import Parallel, delayed, parallel_config
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from nonrigid.benchmark.datasets.protocols import PairData, PairSpec
from nonrigid.benchmark.environment import environment
from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.plan import Plan
from nonrigid.benchmark.protocol import random_rigid_motion
from nonrigid.benchmark.run import Run, do_run, write_failure
from nonrigid.benchmark.store import Record, Store
from nonrigid.benchmark.terminal import json_text
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import NonrigidError
from nonrigid.geometry.points import SurfacePoints


@dataclass(frozen=True, eq=False)
class Task:
    """Hold the runs of one pair, done one after another in one process, where its derived geometry is shared."""

    spec: PairSpec
    runs: tuple[Run, ...]
    folder: Path


def run_plan(plan: Plan, out: Path, *, jobs: int = 1, fresh: bool = False, quiet: bool = False) -> list[Record]:
    """Do every run of a plan that is not finished, and return all of them.

    Parameters
    ----------
    out
        Folder of the results; see `nonrigid.benchmark.store.Store`.
    jobs
        Processes, each with one BLAS thread.
    fresh
        Whether to repeat finished runs.
    quiet
        Whether to leave out the progress bar.

    Raises
    ------
    InputError
        If a mesh or ground truth of the plan cannot be read. Whatever goes wrong later is a row of the results.
    """
    store = Store(out)
    store.prepare()
    pairs = plan.pairs()
    runs = {spec.name: plan_runs(plan, spec) for spec in pairs}
    labels = {run.id: run.label for members in runs.values() for run in members}
    ids = list(labels)
    write_text(out / "plan.toml", plan.text)
    write_text(out / "environment.json", json_text({**environment(), "jobs": jobs}) + "\n")
    store.write_index({"title": plan.title, "dataset": plan.data_word, "metric": plan.metric, "runs": labels})
    done = set() if fresh else store.finished(ids)
    for run in set(ids) - done:
        (store.runs / f"{run}.json").unlink(missing_ok=True)
    tasks = []
    for spec in pairs:
        todo = tuple(run for run in runs[spec.name] if run.id not in done)
        for part in _shares(todo, -(-jobs // len(pairs))):
            tasks.append(Task(spec, part, out))
    with _progress(store, ids, quiet), parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        Parallel(batch_size=1)(delayed(do_task)(task) for task in tasks)
    records = store.records()
    store.write_table(records)
    return records


def plan_runs(plan: Plan, spec: PairSpec) -> list[Run]:
    """Return the runs of one pair: every method with every backend."""
    data = data_hash(spec.load())
    return [
        Run(
            pair=spec.name,
            split=spec.split,
            class_name=spec.class_name,
            label=entry.label,
            method=entry.method,
            formulation=entry.formulation,
            backend=backend,
            starts=plan.starts,
            seed=plan.seed,
            motion_seed=plan.motion_seed,
            metric=plan.metric,
            limits=plan.limits,
            data_hash=data,
        )
        for entry in plan.methods
        for backend in plan.backends
    ]


def data_hash(data: PairData) -> str:
    """Return a hash of a pair's meshes and ground truth."""
    arrays = [data.part.vertices, data.part.faces, data.full.vertices, data.full.faces]
    for points in (data.truth, data.mirrored):
        if isinstance(points, SurfacePoints):
            arrays += [points.faces, points.barycentric]
    return content_hash(*arrays)


def do_task(task: Task) -> None:
    """Do the runs of one pair, after deriving the geometry that they share, so that times are the solvers' own."""
    store = Store(task.folder)
    data = task.spec.load()
    part = data.part
    if (seed := task.runs[0].motion_seed) is not None:
        part = random_rigid_motion(part, seed)[0]
    with threadpool_limits(1):
        try:
            pair = Pair.of(part, data.full)
        except NonrigidError as refusal:
            for run in task.runs:
                write_failure(run, refusal, store)
            return
        for formulation in {repr(run.formulation): run.formulation for run in task.runs}.values():
            # What this raises, the runs raise again, each into its own row.
            with contextlib.suppress(Exception):
                next(iter(formulation.stages(pair)))
        for run in task.runs:
            do_run(run, data, pair, store)


def _shares(runs: Sequence[Run], count: int) -> list[tuple[Run, ...]]:
    """Split the runs of a pair where there are more processes than pairs."""
    return [share for first in range(count) if (share := tuple(runs[first::count]))]


@contextlib.contextmanager
def _progress(store: Store, ids: Sequence[str], quiet: bool) -> Iterator[None]:
    """Show how many runs are finished, by looking for their files."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield
        return
    columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    stop = threading.Event()
    with Progress(*columns, console=console) as bar:
        shown = bar.add_task("runs", total=len(ids), completed=len(store.finished(ids)))

        def look() -> None:
            while not stop.wait(0.5):
                bar.update(shown, completed=len(store.finished(ids)))

        watcher = threading.Thread(target=look, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            stop.set()
            watcher.join()
            bar.update(shown, completed=len(store.finished(ids)))
