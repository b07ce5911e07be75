"""Who does the tasks of a benchmark: this process, processes of this machine, or the workers of a cluster."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from nonrigid.benchmark.helper import in_helper
from nonrigid.benchmark.task import Task, WorkerLostError, do_task
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.solvers.confine import follow_parent

KINDS = ("joblib", "dask", "inprocess")


@runtime_checkable
class Executor(Protocol):
    """Do tasks in any order."""

    @property
    def workers(self) -> int:
        """Number of tasks that are done at the same time."""
        ...

    def do(self, tasks: Sequence[Task]) -> None:
        """Do all tasks; raise `WorkerLostError` where a worker died, and whatever a task raises."""
        ...


@dataclass(frozen=True, kw_only=True)
class InProcess:
    """Do tasks one after another from this process; each run still has a child process of its own.

    Examples
    --------
    >>> InProcess().workers
    1
    """

    workers: int = 1

    def do(self, tasks: Sequence[Task]) -> None:
        """Do all tasks in their order."""
        for task in tasks:
            do_task(task)


@dataclass(frozen=True, kw_only=True)
class Joblib:
    """Do tasks in processes of this machine, each with one BLAS thread; with one worker, from this process."""

    workers: int = 1

    def do(self, tasks: Sequence[Task]) -> None:
        """Do all tasks."""
        if self.workers == 1:
            InProcess().do(tasks)
            return
        with parallel_config(
            backend="loky",
            n_jobs=min(self.workers, len(tasks)),
            inner_max_num_threads=1,
            initializer=follow_parent,
            initargs=(os.getpid(),),
        ):
            try:
                Parallel(batch_size=1, pre_dispatch="all")(delayed(do_task)(task) for task in tasks)
            except TerminatedWorkerError:
                raise WorkerLostError("a worker process was killed, perhaps for want of memory") from None


@dataclass(frozen=True, kw_only=True)
class Dask:
    """Do tasks on the workers of a Dask scheduler.

    Parameters
    ----------
    scheduler
        Its address, such as "tcp://10.0.0.1:8786"; None starts a scheduler and `workers` workers on this machine.
    workers
        Workers of that local cluster; with an address, those that the scheduler has.
    """

    scheduler: str | None = None
    workers: int = 1

    def do(self, tasks: Sequence[Task]) -> None:
        """Do all tasks; Dask itself hands a lost worker's tasks to another."""
        distributed = _distributed()
        with self._client(distributed) as client:
            futures = [
                client.submit(in_helper, task, pure=False, retries=2, key=f"{task.spec.name}-{number}")
                for number, task in enumerate(tasks)
            ]
            try:
                for future in distributed.as_completed(futures):
                    future.result()
            except distributed.KilledWorker as lost:
                raise WorkerLostError(f"workers died of the same task: {lost}") from None
            finally:
                client.cancel(futures)

    @contextlib.contextmanager
    def _client(self, distributed: Any) -> Iterator[Any]:
        import dask

        quiet = {"distributed.admin.tick.limit": "1h", "distributed.logging.distributed": "error"}
        with dask.config.set(quiet):
            if self.scheduler is not None:
                try:
                    client = distributed.Client(self.scheduler, timeout="30s")
                except (OSError, ValueError) as error:
                    raise InputError(
                        f"no scheduler answers at {self.scheduler} ({error})", remedy="start one with `dask scheduler`"
                    ) from None
                with client:
                    yield client
                return
            with (
                distributed.LocalCluster(
                    n_workers=self.workers, threads_per_worker=1, dashboard_address=None, silence_logs="ERROR"
                ) as cluster,
                distributed.Client(cluster) as client,
            ):
                yield client


def make_executor(kind: str, *, workers: int = 1, scheduler: str | None = None) -> Executor:
    """Return the executor that a word names.

    Raises
    ------
    UnknownNameError
        If there is none of that name.
    InputError
        If a scheduler is given to another than dask, or more than one worker to inprocess.
    """
    if kind not in KINDS:
        raise UnknownNameError("executor", kind, KINDS)
    if workers < 1:
        raise InputError(f"--jobs is {workers}", remedy="give at least 1")
    if scheduler is not None and kind != "dask":
        raise InputError(f"a scheduler for the executor {kind}", remedy="give --executor dask with it")
    if kind == "inprocess":
        if workers > 1:
            raise InputError(f"--jobs is {workers}, but inprocess is one process", remedy="use --executor joblib")
        return InProcess()
    return Joblib(workers=workers) if kind == "joblib" else Dask(scheduler=scheduler, workers=workers)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise InputError("Dask is not installed", remedy="run `pip install 'nonrigid[cluster]'`") from None
    return distributed
