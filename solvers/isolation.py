"""A solve in a child process that can be killed: the only hard time limit, and the only shield against a crash."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Bridge, Via
from nonrigid.solvers.backend import Backend
from nonrigid.solvers.confine import (
    child_context,
    die_with_parent,
    flush_native_output,
    is_out_of_memory,
    limit_memory,
)
from nonrigid.solvers.judge import Values, judge
from nonrigid.solvers.layout import Layout
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.once import route_and_claim, solve_once
from nonrigid.solvers.solution import Solution, TracePoint
from nonrigid.solvers.status import Status

_REPORT_EVERY = 0.1  # seconds between the points that the child hands over while it works
_LONGEST_WAIT = 3600.0  # seconds; systems refuse to wait for ever by a number


def run_isolated(problem: Problem, backend: Backend, start: Values, limits: Limits) -> Solution:
    """Solve in a child process, kill it at `limits.hard_seconds`, and keep the best point it had handed over.

    A crash of a native library ends as `backend_error` with the signal's number, a solve that fills its
    `limits.memory_gb` as `limit`, or as `backend_error` where it had no point yet.
    """
    context = child_context()
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_work, args=(there, os.getpid(), problem, backend, start, limits), daemon=True)
    begun = time.perf_counter()
    child.start()
    there.close()
    heard = _listen(here, None if limits.hard_seconds is None else begun + limits.hard_seconds)
    seconds = time.perf_counter() - begun
    if heard.expired:
        child.kill()
    child.join()
    here.close()
    if heard.answer is not None:
        return _told_of_memory(heard.answer, limits)
    if heard.expired:
        status, words = Status.LIMIT, f"killed after {limits.hard_seconds:g} s"
    else:
        status = Status.BACKEND_ERROR
        words = heard.words or f"the child process ended with exit code {child.exitcode}"
    return _told_of_memory(_salvaged(problem, backend, status, words, heard, seconds), limits)


def _work(pipe: Connection, parent: int, problem: Problem, backend: Backend, start: Values, limits: Limits) -> None:
    die_with_parent(parent)
    sent = [0.0]

    def report(point: FloatArray, trace: TracePoint) -> None:
        now = time.perf_counter()
        if now - sent[0] >= _REPORT_EVERY:
            sent[0] = now
            pipe.send((point, trace))

    try:
        if limits.memory_gb is not None:
            limit_memory(limits.memory_gb)
        pipe.send(solve_once(problem, backend, start, limits, report))
    except Exception as failure:  # nothing that a third party's `accepts` or bridge raises may look like a crash
        pipe.send(f"{type(failure).__name__}: {failure}")
    pipe.close()
    flush_native_output()


def _told_of_memory(answer: Solution, limits: Limits) -> Solution:
    if limits.memory_gb is None or answer.status is not Status.BACKEND_ERROR or not is_out_of_memory(answer.raw_status):
        return answer
    status = Status.LIMIT if answer.values else Status.BACKEND_ERROR
    return replace(answer, status=status, message=f"{limits.memory_gb:g} GB of memory are spent; {status.advice}")


@dataclass
class _Heard:
    """Hold what a child handed over, and whether its time ran out before it said the last word or died."""

    answer: Solution | None = None
    words: str = ""
    best: FloatArray | None = None
    trace: list[TracePoint] = field(default_factory=list)
    expired: bool = False


def _listen(pipe: Connection, deadline: float | None) -> _Heard:
    # A dead child shows as a closed pipe, possibly in mid-message; it may not yet show as a dead process.
    heard = _Heard()
    while True:
        left = None if deadline is None else deadline - time.perf_counter()
        if left is not None and left <= 0.0:
            heard.expired = True
            return heard
        if not pipe.poll(None if left is None else min(left, _LONGEST_WAIT)):
            continue
        try:
            message = pipe.recv()
        except (EOFError, OSError):
            return heard
        if isinstance(message, Solution):
            heard.answer = message
            return heard
        if isinstance(message, str):
            heard.words = message
            return heard
        heard.best, point = message
        heard.trace.append(point)


def _salvaged(
    problem: Problem,
    backend: Backend,
    status: Status,
    words: str,
    heard: _Heard,
    seconds: float,
) -> Solution:
    best, trace = heard.best, heard.trace
    route, claim = route_and_claim(backend, _bridges(backend, problem))
    solution = Solution(
        problem=problem.name,
        sense=problem.objective.sense,
        backend=backend.name,
        algorithm=backend.algorithm,
        status=status,
        message=f"{words}; {status.advice}" if best is not None else f"{words}, before the first point",
        solve_seconds=seconds,
        evaluations=trace[-1].evaluations if trace else float("nan"),
        trace=tuple(trace),
        route=route,
        claim=claim.value,
        raw_status=words,
        versions=backend.versions(),
    )
    if best is None:
        return solution
    judged = judge(problem, Layout(problem).split(best))
    return replace(
        solution,
        values=judged.values,
        objective=judged.objective,
        violation=judged.violation,
        stationarity=judged.stationarity,
    )


def _bridges(backend: Backend, problem: Problem) -> tuple[Bridge, ...]:
    """Return the bridges that the lost child took; none where a third party's answer fails."""
    try:
        accepted = backend.accepts(problem)
    except Exception:
        return ()
    return accepted.bridges if isinstance(accepted, Via) else ()
