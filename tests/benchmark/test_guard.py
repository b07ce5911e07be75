"""What happens in a guarded child stays there."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import faulthandler
import io
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.guard import GuardedChild, Tell, guarded_call, one_ahead
from nonrigid.benchmark.store import StorageError
from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.solvers.confine import can_limit_memory, is_out_of_memory
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def fill(tell: Tell) -> None:
    hoard = []
    while True:
        hoard.append(np.ones(1_000_000))


def test_a_hang_is_killed_with_its_children(tmp_path: Path) -> None:
    def hang(tell: Tell) -> None:
        if os.fork() == 0:
            time.sleep(1.0)
            (tmp_path / "alive").touch()
        ctypes.PyDLL(None).sleep(60)  # holds the interpreter lock

    ended = guarded_call(hang, seconds=0.4)
    assert (ended.well, ended.killed, ended.words) == (False, True, "killed after 0.4 s of a run")
    time.sleep(1.2)
    assert not (tmp_path / "alive").exists()


def test_a_crash_and_an_error_are_told_apart() -> None:
    def crash(tell: Tell) -> None:
        faulthandler.disable()  # it would print the stack of the test run
        tell("here")
        ctypes.string_at(0)

    def fail(tell: Tell) -> None:
        raise ZeroDivisionError("no")

    assert "SIGSEGV" in guarded_call(crash).words
    assert guarded_call(crash).told == "here"
    assert guarded_call(fail).words == "ZeroDivisionError: no"


def test_each_word_gives_new_time_and_the_last_lifts_the_limit() -> None:
    def work(tell: Tell) -> None:
        for word in ("one", "two", "ready"):
            time.sleep(0.35)
            tell(word)
        time.sleep(0.9)

    assert guarded_call(work, seconds=0.8, until="ready").well
    assert guarded_call(work, seconds=0.8).told == "ready"
    assert guarded_call(work, seconds=0.8).killed


def test_memory_ends_at_its_limit() -> None:
    ended = guarded_call(fill, memory_gb=0.1)
    assert is_out_of_memory(ended.words) if can_limit_memory() else "cannot limit memory" in ended.words


def test_a_full_disk_is_the_callers_business() -> None:
    def work(tell: Tell) -> None:
        raise StorageError("full")

    with pytest.raises(StorageError, match="full"):
        guarded_call(work)


def test_native_output_goes_to_the_log_even_before_a_crash(tmp_path: Path) -> None:
    def work(tell: Tell) -> None:
        ctypes.CDLL(None).puts(b"from C")
        os.write(2, b"from Python\n")
        faulthandler.disable()
        ctypes.string_at(0)

    guarded_call(work, log=tmp_path / "log")
    text = (tmp_path / "log").read_text()
    assert "from C" in text
    assert "from Python" in text


def test_a_solve_that_fills_its_memory_says_so() -> None:
    class Greedy(QuadraticForm):
        calls = 0

        def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
            type(self).calls += 1
            if type(self).calls > 3:
                fill(print)
            return super().value_and_gradient(x)

    u = Variable("u", 3)
    matrix = np.array([[0.0, 1.0, 0.1], [1.0, 0.0, 0.1], [0.1, 0.1, 0.0]])
    problem = Problem("greedy", maximize(Greedy(matrix)(u)), u @ Simplex())
    answer = solve(problem, "nlopt:LD_CCSAQ", limits=Limits(memory_gb=0.1))
    assert answer.status in (Status.LIMIT, Status.BACKEND_ERROR)
    assert ("0.1 GB of memory are spent" if can_limit_memory() else "cannot limit memory") in answer.message


def test_the_next_child_stands_ready_while_one_works_and_a_crash_leaves_it_be(tmp_path: Path) -> None:
    def crash(tell: Tell) -> None:
        faulthandler.disable()
        ctypes.string_at(0)

    def hang(tell: Tell) -> None:
        time.sleep(60)

    made = []

    def children() -> Iterator[GuardedChild]:
        for number, work in enumerate((crash, hang, lambda tell: tell("well"))):
            made.append(number)
            yield GuardedChild(work, log=tmp_path / str(number))

    ended = []
    for child in one_ahead(children()):
        ended.append(child.end(seconds=2.0))
        assert len(made) == min(len(ended) + 1, 3)
    assert ["SIGSEGV" in ended[0].words, ended[1].killed, ended[2].told] == [True, True, "well"]


def test_children_end_with_whoever_stops_asking_for_them(tmp_path: Path) -> None:
    def late(tell: Tell) -> None:
        time.sleep(0.5)
        (tmp_path / "alive").touch()

    with contextlib.closing(one_ahead(GuardedChild(late) for _ in range(3))) as children:
        next(children)
    time.sleep(0.8)
    assert not (tmp_path / "alive").exists()


def test_a_disk_too_full_to_print_on_does_not_keep_a_failure_from_being_told() -> None:
    class Full(io.StringIO):
        def flush(self) -> None:
            raise OSError(errno.ENOSPC, "no space left")

    def work(tell: Tell) -> None:
        sys.stdout = Full()
        raise StorageError("full")

    with pytest.raises(StorageError, match="full"):
        guarded_call(work)
