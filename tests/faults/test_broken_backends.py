"""A backend broken in each of five ways, and by a crash, is caught by `solve` and by the conformance kit."""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Native, Refused, via
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.bridges.radial import Radial
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.solution import Solution
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing import ConformanceError, check_backend
from nonrigid.solvers.testing.instances import ball, convex_quadratic, planted_game

QUICK = Limits(seconds=5.0, hard_seconds=1.0, evaluations=2000)
START = {"x": np.array([0.05, 0.1, 0.15, 0.2, 0.2, 0.3])}


def step(x: FloatArray, gradient: FloatArray, length: float = 0.02) -> FloatArray:
    moved = np.maximum(x - length * gradient, 0.0)
    return moved / moved.sum()


@dataclass(frozen=True)
class Honest:
    """Descend on the simplex: the sound backend that the others break."""

    algorithm: str = "descent"
    name: ClassVar[str] = "broken"
    algorithms: ClassVar[tuple[str, ...]] = ("descent",)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        return "descent"

    def accepts(self, problem: Problem) -> Acceptance:
        return Native() if problem.name == "convex quadratic" else Refused("this one takes convex quadratics only")

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        x = start
        for _ in range(1500):
            gradient = oracle.value_and_gradient(x)[1]
            x = x - 0.02 * (gradient - gradient.mean())
        return Raw(x, "converged")

    @classmethod
    def versions(cls) -> dict[str, str]:
        return {"broken": "1"}


@dataclass(frozen=True)
class WrongGradient(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        x = start
        for _ in range(200):
            x = step(x, -oracle.value_and_gradient(x)[1])
        return Raw(x, "success")


@dataclass(frozen=True)
class WrongStatus(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        return Raw(start * np.arange(1.0, 1.0 + start.size) * 100.0, "optimal")


@dataclass(frozen=True)
class LostIterate(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        x = start
        for _ in range(20):
            x = step(x, oracle.value_and_gradient(x)[1])
        raise RuntimeError("the iterate is lost")


@dataclass(frozen=True)
class NaN(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        oracle.value_and_gradient(np.full(start.size, np.nan))
        return Raw(start, "not reached")


@dataclass(frozen=True)
class NaNAtTheEnd(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        return Raw(np.full(start.size, np.nan), "optimal")


@dataclass(frozen=True)
class WrongShape(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        return Raw(start[:-1], "optimal")


@dataclass(frozen=True)
class HangInPython(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        while True:
            time.sleep(0.01)


@dataclass(frozen=True)
class HangInNativeCode(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        ctypes.PyDLL(None).sleep(3600)  # holds the interpreter lock: no Python code can interrupt it
        return Raw(None, "not reached")


@dataclass(frozen=True)
class Crash(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        faulthandler.disable()  # it would print the stack of the test run
        os.kill(os.getpid(), signal.SIGSEGV)
        return Raw(None, "not reached")


@dataclass(frozen=True)
class RaisesOnAccepting(Honest):
    def accepts(self, problem: Problem) -> Acceptance:
        raise RuntimeError("no answer")


BROKEN = (WrongGradient, WrongStatus, LostIterate, NaN, NaNAtTheEnd, WrongShape)


def solved(backend: Honest, limits: Limits | None = None) -> Solution:
    return solve(convex_quadratic().problem, backend, start=START, limits=limits)


def at_start() -> float:
    return convex_quadratic().problem.objective.value(START)


def test_the_sound_backend_passes() -> None:
    assert check_backend(Honest()) == ("convex quadratic",)
    assert solved(Honest()).status is Status.STATIONARY


@pytest.mark.parametrize("kind", [*BROKEN, HangInPython, HangInNativeCode, Crash], ids=lambda kind: kind.__name__)
def test_the_kit_catches_it(kind: type[Honest]) -> None:
    with pytest.raises(ConformanceError, match=r"expected .* found .* look at"):
        check_backend(kind(), limits=QUICK)


def test_a_wrong_gradient_is_not_called_stationary_and_the_best_point_is_kept() -> None:
    answer = solved(WrongGradient())
    assert answer.status is Status.FEASIBLE
    assert answer.raw_status == "success"
    assert answer.stationarity > 0.1
    assert answer.objective == pytest.approx(at_start())


def test_a_wrong_status_decides_nothing() -> None:
    answer = solved(WrongStatus())
    assert (answer.status, answer.raw_status) == (Status.FEASIBLE, "optimal")
    assert answer.violation <= 1e-12


def test_an_infeasible_point_called_optimal_is_infeasible_where_no_set_can_restore_it() -> None:
    @dataclass(frozen=True)
    class Outside(WrongStatus):
        def accepts(self, problem: Problem) -> Acceptance:
            return Native()

        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            return Raw(np.full(start.size, 3.0), "optimal")

    answer = solve(ball().problem, Outside())
    assert answer.status is Status.INFEASIBLE
    assert answer.violation == pytest.approx(26.0)
    assert not answer.status.usable
    with pytest.raises(ConformanceError, match="expected an answer"):
        check_backend(Outside(), problems=[ball()], limits=QUICK)


def test_a_lost_iterate_is_kept() -> None:
    answer = solved(LostIterate())
    assert answer.status is Status.BACKEND_ERROR
    assert "the iterate is lost" in answer.message
    assert "the iterate is lost" in answer.raw_status
    assert answer.objective < at_start()
    assert answer.violation <= 1e-12


def test_nan_is_a_numerical_error_and_the_point_before_it_is_kept() -> None:
    answer = solved(NaN())
    assert answer.status is Status.NUMERICAL_ERROR
    assert answer.objective == pytest.approx(at_start())
    last = solved(NaNAtTheEnd())
    assert last.status is Status.NUMERICAL_ERROR
    assert not last.values


def test_a_point_of_the_wrong_shape_is_a_backend_error() -> None:
    answer = solved(WrongShape())
    assert answer.status is Status.BACKEND_ERROR
    assert "shape (5,)" in answer.message
    assert answer.objective == pytest.approx(at_start())


@pytest.mark.parametrize("kind", [HangInPython, HangInNativeCode])
def test_a_hang_is_killed_and_the_best_point_kept(kind: type[Honest]) -> None:
    begun = time.perf_counter()
    answer = solved(kind(), Limits(hard_seconds=0.5))
    assert time.perf_counter() - begun < 30.0
    assert answer.status is Status.LIMIT
    assert answer.raw_status == "killed after 0.5 s"
    assert answer.objective == pytest.approx(at_start())


def test_a_crash_is_a_backend_error_and_the_best_point_kept() -> None:
    answer = solved(Crash(), Limits(hard_seconds=20.0))
    assert answer.status is Status.BACKEND_ERROR
    assert "exit code -11" in answer.message
    assert answer.objective == pytest.approx(at_start())


def test_a_backend_that_raises_before_it_runs_is_a_backend_error_in_a_child() -> None:
    answer = solved(RaisesOnAccepting(), Limits(hard_seconds=20.0))
    assert answer.status is Status.BACKEND_ERROR
    assert "RuntimeError: no answer" in answer.message
    assert not answer.values
    with pytest.raises(ConformanceError, match="RuntimeError"):
        check_backend(RaisesOnAccepting())


def test_a_chain_falls_back_and_records_every_attempt() -> None:
    refused, lost, sound = solve(planted_game().problem, Honest()), LostIterate(), Honest()
    assert refused.status is Status.REFUSED
    assert "convex quadratics only" in refused.message
    answer = solve(convex_quadratic().problem, [lost, sound, lost])
    assert [attempt.status for attempt in answer.attempts] == [Status.BACKEND_ERROR, Status.STATIONARY]
    assert answer.objective == pytest.approx(convex_quadratic().optimum)


@dataclass(frozen=True)
class OwnClock(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        gradient = oracle.value_and_gradient(start)[1]
        time.sleep(1.1 * (limits.seconds or 0.0))
        return Raw(start - 1e-3 * gradient, "user_limit")


def test_time_spent_by_the_clock_of_the_library_is_a_limit() -> None:
    answer = solve(convex_quadratic().problem, OwnClock(), start=START, limits=Limits(seconds=0.2))
    assert answer.status is Status.LIMIT
    assert answer.usable


@pytest.mark.parametrize("seconds", [float("inf"), 3e9])
def test_a_limit_beyond_what_systems_can_wait_for_is_no_fault(seconds: float) -> None:
    answer = solve(convex_quadratic().problem, Honest(), start=START, limits=Limits(hard_seconds=seconds))
    assert answer.status is Status.STATIONARY


@dataclass(frozen=True)
class HangingBehindABridge(Honest):
    def accepts(self, problem: Problem) -> Acceptance:
        return via(problem, Radial())

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        time.sleep(60.0)
        raise AssertionError


def test_a_killed_solve_keeps_its_route_and_claim() -> None:
    answer = solve(planted_game().problem, HangingBehindABridge(), limits=QUICK)
    assert answer.status is Status.LIMIT
    assert answer.route == ("radial", "broken:descent")
    assert not answer.usable
    assert "before the first point" in answer.message


@dataclass(frozen=True)
class ReturnsAnArray(Honest):
    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        return start  # type: ignore[return-value]


def test_a_run_that_returns_no_raw_answer_is_a_backend_error() -> None:
    answer = solve(convex_quadratic().problem, ReturnsAnArray(), start=START)
    assert answer.status is Status.BACKEND_ERROR
    assert "run of broken returned a ndarray, not a Raw" in answer.message
