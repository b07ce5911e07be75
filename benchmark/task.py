"""Do the runs of one pair: the pair loaded once, its geometry derived once, each run in a child process of its own."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from nonrigid.benchmark.datasets.protocols import PairData, PairSpec
from nonrigid.benchmark.environment import known_environment, source_digest
from nonrigid.benchmark.guard import Ended, GuardedChild, guarded_call, one_ahead
from nonrigid.benchmark.metric import geodesic_errors
from nonrigid.benchmark.protocol import random_rigid_motion
from nonrigid.benchmark.run import Run, do_run, memory_words, write_failure, write_loss
from nonrigid.benchmark.store import StorageError, Store
from nonrigid.formulations.formulation import Formulation, Pair
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import InputError, NonrigidError
from nonrigid.geometry.points import SurfacePoints
from nonrigid.solvers.confine import is_out_of_memory
from nonrigid.solvers.status import Status

_LOADED, _READY = "loaded", "ready"


class WorkerLostError(NonrigidError):
    """Report that a process was killed from outside; what was finished is kept, the rest can be handed out again."""


@dataclass(frozen=True, eq=False)
class Task:
    """Hold the runs of one pair and the folder of their results; data go by reference, as paths and a hash."""

    spec: PairSpec
    runs: tuple[Run, ...]
    folder: Path


def do_task(task: Task) -> None:
    """Do the runs of one pair that are not finished.

    Everything happens in a child process that loads the pair and derives the geometry that its runs share, so that
    their times are the solvers' own; each run is a child of that child. What crashes or hangs there ends as rows.

    Raises
    ------
    StorageError
        If results cannot be written.
    WorkerLostError
        If the child was killed from outside.
    """
    store = Store(task.folder)
    if not (task.folder / "index.json").is_file():
        raise StorageError(
            f"{task.folder}: this machine does not see the folder of the results; give --out on a disk that all "
            f"machines share, or run each share of the plan by itself and `nonrigid merge` the results"
        )
    store.write_environment(*known_environment())
    source_digest()  # here, and the backends' versions below, so that no run has to look them up
    cold: list[str] = []
    while todo := tuple(run for run in task.runs if not store.has(run.id)):
        first = todo[0]
        ended = guarded_call(
            partial(_host, Task(task.spec, todo, task.folder), tuple(cold)),
            seconds=first.run_seconds,
            memory_gb=first.limits.memory_gb,
            until=_READY,
        )
        if ended.well:
            return
        if ended.told.startswith("warming ") and ended.told not in cold:
            cold.append(ended.told)  # its runs start without shared geometry, each guarded by itself
        elif ended.told == _READY:
            raise WorkerLostError(f"the process of the pair {task.spec.name} was lost: {ended.words}")
        else:
            for run in todo:
                write_loss(run, *_verdict(ended, run), store)


def data_hash(data: PairData) -> str:
    """Return a hash of a pair's meshes and ground truth."""
    arrays = [data.part.vertices, data.part.faces, data.full.vertices, data.full.faces]
    for points in (data.truth, data.mirrored):
        if isinstance(points, SurfacePoints):
            arrays += [points.faces, points.barycentric]
    return content_hash(*arrays)


def _host(task: Task, cold: tuple[str, ...], tell: Callable[[str], None]) -> None:
    store = Store(task.folder)
    with threadpool_limits(1):
        try:
            data, pair = _loaded(task)
        except NonrigidError as refusal:
            for run in task.runs:
                write_failure(run, refusal, store)
            return
        tell(_LOADED)
        for text, formulation in {repr(run.formulation): run.formulation for run in task.runs}.items():
            if (word := f"warming {text}") not in cold:
                tell(word)
                _warm(formulation, pair)
        _warm_scoring(data, task.runs[0].metric)
        tell(_READY)
        _guarded_runs(task.runs, data, pair, store)


def _loaded(task: Task) -> tuple[PairData, Pair]:
    data = task.spec.load()
    if (found := data_hash(data)) != (wanted := task.runs[0].data_hash):
        raise InputError(
            f"the files of the pair {task.spec.name} have the hash {found[:12]}, those of the plan {wanted[:12]}",
            remedy="give every machine the same files",
        )
    part = data.part
    if (seed := task.runs[0].motion_seed) is not None:
        part = random_rigid_motion(part, seed)[0]
    return data, Pair.of(part, data.full)


def _warm(formulation: Formulation, pair: Pair) -> None:
    # What this raises, the runs raise again, each into its own row.
    with contextlib.suppress(Exception):
        _ = pair.part.mesh, pair.full.mesh  # repaired once, for a method that looks at them late as well
        next(iter(formulation.stages(pair)))


def _warm_scoring(data: PairData, metric: str) -> None:
    """Take the distance of two points: what scoring derives of the full shape is then there for every run."""
    if data.truth is not None and data.truth.matched.any():
        known = np.flatnonzero(data.truth.matched)
        with contextlib.suppress(Exception):  # as in `_warm`
            geodesic_errors(data.full, data.truth[known[:1]], data.truth[known[-1:]], geodesics=metric)


def _guarded_runs(runs: Sequence[Run], data: PairData, pair: Pair, store: Store) -> None:
    """Do one run after another, each in a child of its own, which is made while the run before it is done."""

    def made(run: Run) -> GuardedChild:
        def work(tell: Callable[[str], None]) -> None:
            do_run(run, data, pair, store)

        log = store.log_file(run.id)
        log.unlink(missing_ok=True)
        return GuardedChild(work, memory_gb=run.limits.memory_gb, log=log)

    with contextlib.closing(one_ahead(made(run) for run in runs)) as children:
        for run, child in zip(runs, children, strict=True):
            ended = child.end(seconds=run.run_seconds)
            if not store.has(run.id):
                write_loss(run, *_verdict(ended, run), store)
            log = store.log_file(run.id)
            with contextlib.suppress(OSError):
                if not log.stat().st_size:
                    log.unlink()


def _verdict(ended: Ended, run: Run) -> tuple[str, str]:
    """Return status and message of a run whose process was lost."""
    if ended.killed:
        return Status.LIMIT.value, f"{ended.words}; {Status.LIMIT.advice.partition(';')[0]}"
    if is_out_of_memory(ended.words) and run.limits.memory_gb is not None:
        return Status.LIMIT.value, memory_words(ended.words, run.limits)
    return Status.BACKEND_ERROR.value, f"{ended.words}; {Status.BACKEND_ERROR.advice.partition(';')[0]}"


def absolute(spec: PairSpec) -> PairSpec:
    """Return the pair with the paths of its files written from the root, for a process that works elsewhere."""
    places = {role: getattr(spec, role) for role in ("part", "full", "truth", "mirrored")}
    found = {role: Path(os.path.abspath(place)) for role, place in places.items() if isinstance(place, Path)}  # noqa: PTH100 - a link is part of the name
    return PairSpec(**{**vars(spec), **found})
