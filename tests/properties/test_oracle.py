"""Properties of the oracle: it counts, keeps the best restored point, traces, and stops."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Smooth, Variable, maximize, minimize
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.bridges.radial import Radial
from nonrigid.solvers.judge import judge
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import LimitReached, NotFiniteError, Oracle
from nonrigid.solvers.solution import TracePoint
from nonrigid.solvers.testing.instances import ball, planted_payoff, two_variables

A = planted_payoff(8)
u = Variable("u", 8)
GAME = Problem("game", maximize(2.0 * QuadraticForm(A)(u)), u @ Simplex())
NO_LIMIT = Limits(seconds=None)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 40))
def test_the_best_is_the_best_restored_point_and_never_gets_worse(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    reported: list[float] = []

    def report(point: FloatArray, trace: TracePoint) -> None:
        assert Simplex().violation(point) <= 1e-12
        reported.append(trace.objective)

    oracle, seen = Oracle(GAME, NO_LIMIT, report=report), []
    for _ in range(count):
        x = rng.exponential(size=8) * rng.choice([1.0, 1e-3, 50.0]) - 0.1  # off the simplex
        value, gradient = oracle.value_and_gradient(x)
        assert value == pytest.approx(-2.0 * x @ A @ x)
        np.testing.assert_allclose(gradient, -4.0 * A @ x)
        seen.append(judge(GAME, {"u": x}).objective)
        assert oracle.best_objective == pytest.approx(max(seen))
    assert oracle.best is not None
    assert GAME.objective.value(oracle.best) == pytest.approx(max(seen))
    assert oracle.evaluations == count
    assert reported == sorted(reported)
    assert [point.objective for point in oracle.trace] == pytest.approx(seen)


def test_a_member_is_kept_untouched_and_the_backend_may_change_its_array() -> None:
    oracle, x = Oracle(GAME, NO_LIMIT), np.full(8, 0.125)
    oracle.value_and_gradient(x)
    x[:] = np.nan
    assert oracle.best is not None
    np.testing.assert_array_equal(oracle.best["u"], np.full(8, 0.125))


def test_points_of_a_bridged_problem_are_judged_on_the_users_own() -> None:
    rewritten = Radial().apply(GAME)
    oracle = Oracle(rewritten.problem, NO_LIMIT, original=GAME, inverse=rewritten.inverse)
    y = 7.0 * np.arange(1.0, 9.0)
    value, _ = oracle.value_and_gradient(y)
    assert oracle.best is not None
    assert oracle.best["u"].sum() == pytest.approx(1.0)
    assert oracle.best_objective == pytest.approx(-value)


def test_second_derivatives_are_counted_and_in_the_sense_of_minimization() -> None:
    oracle, x, d = Oracle(GAME, NO_LIMIT), np.full(8, 0.125), np.arange(8.0)
    np.testing.assert_allclose(oracle.hessian(x), -4.0 * A)
    np.testing.assert_allclose(oracle.hessian_product(x, d), -4.0 * A @ d)
    assert oracle.evaluations == 2


def test_limits_stop_from_inside_and_are_remembered() -> None:
    oracle, x = Oracle(GAME, Limits(evaluations=2)), np.full(8, 0.125)
    oracle.charge(0.5)
    oracle.value_and_gradient(x)
    with pytest.raises(LimitReached, match="2 evaluations are spent"):
        oracle.value_and_gradient(x)
    assert isinstance(oracle.interrupted, LimitReached)
    assert oracle.evaluations == 1.5
    late = Oracle(GAME, Limits(seconds=1e-3))
    late.begin()
    time.sleep(2e-3)
    with pytest.raises(LimitReached, match=r"0\.001 s are spent"):
        late.value_and_gradient(x)


def test_build_time_is_told_from_solve_time() -> None:
    oracle = Oracle(GAME, NO_LIMIT)
    oracle.begin()
    time.sleep(0.02)
    oracle.built()
    assert oracle.build_seconds >= 0.02
    assert oracle.seconds < oracle.build_seconds


def test_what_is_not_finite_stops_and_is_never_the_best() -> None:
    oracle = Oracle(GAME, NO_LIMIT)
    with pytest.raises(NotFiniteError):
        oracle.value_and_gradient(np.full(8, np.nan))
    assert oracle.best is None
    logarithm = Smooth(lambda x: float(x[0]) if x[0] < 0.9 else float("nan"), lambda x: np.ones_like(x))
    broken = Oracle(Problem("broken", minimize(logarithm(u)), u @ Simplex()), NO_LIMIT)
    with pytest.raises(NotFiniteError, match="iterate restored"):
        broken.observe(np.eye(8)[0])
    assert broken.best is None
    assert isinstance(broken.interrupted, NotFiniteError)


def test_a_failing_term_is_remembered_for_libraries_that_swallow_exceptions() -> None:
    def fail(x: FloatArray) -> Any:
        raise KeyError("inside the term")

    oracle = Oracle(Problem("broken", minimize(Smooth(fail, fail)(u)), u @ Simplex()), NO_LIMIT)
    with pytest.raises(KeyError):
        oracle.value_and_gradient(np.full(8, 0.125))
    assert isinstance(oracle.failure, KeyError)


def test_infeasible_points_are_traced_and_never_the_best() -> None:
    oracle = Oracle(ball().problem, NO_LIMIT)
    oracle.value_and_gradient(np.full(3, 2.0))
    assert oracle.best is None
    assert oracle.trace[-1].violation == pytest.approx(11.0)
    oracle.value_and_gradient(np.zeros(3))
    assert oracle.best_objective == pytest.approx(4.5)


def test_several_variables_lie_one_after_the_other() -> None:
    oracle = Oracle(two_variables().problem, NO_LIMIT)
    value, gradient = oracle.value_and_gradient(np.array([1.0, 0.0, 0.0, 1.0, 1.0, 2.0]))
    assert value == 5.0
    np.testing.assert_array_equal(gradient, [0.0, -2.0, -4.0, 0.0, 2.0, 4.0])
    np.testing.assert_array_equal(oracle.lower, [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(oracle.upper, [1, 1, 1, 2, 2, 2])
    (simplex,) = oracle.constraints
    rest, jacobian = simplex.value_and_jacobian(np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]))
    assert rest == [1.0]
    np.testing.assert_array_equal(jacobian, [[1, 1, 1, 0, 0, 0]])


def test_a_long_trace_thins_out_and_keeps_its_end() -> None:
    oracle = Oracle(GAME, NO_LIMIT)
    rng = np.random.default_rng(0)
    for _ in range(3000):
        oracle.value_and_gradient(rng.dirichlet(np.ones(8)))
    assert 200 < len(oracle.trace) < 700
    evaluations = [point.evaluations for point in oracle.trace]
    assert evaluations == sorted(evaluations)
    assert evaluations[-1] > 2900
    assert max(point.objective for point in oracle.trace) == pytest.approx(oracle.best_objective)


@pytest.mark.parametrize(
    "wrong", [{"evaluations": 0}, {"seconds": -1.0}, {"hard_seconds": 0.0}, {"tolerance": 0.0}, {"feasibility": -1.0}]
)
def test_limits_must_be_positive(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        Limits(**wrong)
