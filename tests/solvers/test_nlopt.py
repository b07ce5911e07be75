"""NLopt: every algorithm on proved optima, limits, faults, routes and refusals."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from nonrigid.formulations.model import Box, Problem, QuadraticForm, Simplex, Smooth, Variable, free, maximize, minimize
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.acceptance import Native, Refused, Via
from nonrigid.solvers.backends.nlopt import Nlopt
from nonrigid.solvers.bridges.squares import Squares
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing import check_backend, check_bridge
from nonrigid.solvers.testing.instances import ball, convex_quadratic, planted_payoff, rosenbrock

GRADIENT = tuple(name for name in Nlopt.algorithms if name.startswith("LD"))


def matching(n: int) -> Problem:
    u = Variable("u", n)
    return Problem("game", maximize(QuadraticForm(planted_payoff(n))(u)), u @ Simplex())


def banana(n: int, lower: float = -1.5, upper: float = 0.8) -> Problem:
    x = Variable("x", n)

    def value(v: FloatArray) -> float:
        return float(np.sum(100.0 * (v[1:] - v[:-1] ** 2) ** 2 + (1.0 - v[:-1]) ** 2))

    def gradient(v: FloatArray) -> FloatArray:
        inner, slope = v[1:] - v[:-1] ** 2, np.zeros_like(v)
        slope[:-1] = -400.0 * v[:-1] * inner - 2.0 * (1.0 - v[:-1])
        slope[1:] += 200.0 * inner
        return slope

    return Problem("valley", minimize(Smooth(value, gradient)(x)), x @ Box(lower, upper))


@pytest.fixture(scope="module")
def best_known() -> float:
    return solve(matching(30), "native:replicator", starts=12, limits=Limits(seconds=5)).objective


@pytest.mark.parametrize("algorithm", [*GRADIENT, "LN_COBYLA"])
def test_keeps_the_contract_of_a_backend(algorithm: str) -> None:
    accepted = check_backend(Nlopt(algorithm))
    assert {"planted game", "convex quadratic", "rosenbrock", "elastic net"} <= set(accepted)
    assert ("ball" in accepted) == (algorithm in ("LD_CCSAQ", "LD_MMA", "LD_SLSQP", "LD_AUGLAG", "LN_COBYLA"))


@pytest.mark.parametrize("algorithm", GRADIENT)
def test_reaches_the_best_known_matching(algorithm: str, best_known: float) -> None:
    found = solve(matching(30), Nlopt(algorithm), starts=4, limits=Limits(seconds=5))
    assert found.status is Status.STATIONARY
    assert found.objective == pytest.approx(best_known, abs=1e-6)


@pytest.mark.parametrize("inner", ["LD_LBFGS", "LD_CCSAQ"])
def test_the_augmented_lagrangian_takes_either_inner_method(inner: str) -> None:
    instance = ball()
    found = solve(instance.problem, Nlopt("LD_AUGLAG", inner=inner), limits=Limits(seconds=5))
    assert found.objective == pytest.approx(instance.optimum, abs=1e-6)
    assert found.violation <= 1e-7


@pytest.mark.parametrize("bridge", ["body", "radial", "squares"])
def test_each_bridge_leads_to_the_same_answer(bridge: str) -> None:
    problem = matching(20)
    found = solve(problem, Nlopt("LD_CCSAQ", bridge=bridge), limits=Limits(seconds=5))
    assert len(found.route) == 2
    assert found.objective == pytest.approx(solve(problem, "native:replicator").objective, abs=1e-6)


def test_squares_keep_objectives_and_optima() -> None:
    check_bridge(Squares(), matching(12))
    check_bridge(Squares(), convex_quadratic().problem, optimum=convex_quadratic().values)


@pytest.mark.parametrize("algorithm", Nlopt.algorithms)
def test_limits_hold(algorithm: str) -> None:
    problem = banana(10)
    counted = solve(problem, Nlopt(algorithm), limits=Limits(evaluations=7))
    assert counted.evaluations <= 7
    assert counted.status is Status.LIMIT, counted
    timed = solve(_slowed(problem), Nlopt(algorithm), limits=Limits(seconds=0.05, tolerance=1e-14))
    assert timed.solve_seconds < 0.5
    assert timed.status is Status.LIMIT, timed


@pytest.mark.parametrize("algorithm", Nlopt.algorithms)
def test_a_value_that_is_not_finite_ends_the_solve(algorithm: str) -> None:
    calls = []

    def value(x: FloatArray) -> float:
        calls.append(1)
        return float(x @ x) if len(calls) <= 2 else float("nan")

    x = Variable("x", 3)
    problem = Problem("broken", minimize(Smooth(value, lambda x: 2.0 * x)(x)), x @ Box(-1.0, 2.0))
    found = solve(problem, Nlopt(algorithm), limits=Limits(seconds=5))
    assert found.status is Status.NUMERICAL_ERROR, found
    assert len(calls) <= 5


def test_the_evolution_strategy_is_repeatable_and_approaches_the_optimum() -> None:
    instance, limits = rosenbrock(), Limits(evaluations=2500)
    first, again = (solve(instance.problem, Nlopt("GN_ISRES", seed=3), limits=limits) for _ in range(2))
    other = solve(instance.problem, Nlopt("GN_ISRES", seed=4), limits=limits)
    np.testing.assert_array_equal(first["x"], again["x"])
    assert first.objective == pytest.approx(instance.optimum, abs=3e-2)
    assert np.any(first["x"] != other["x"])


def test_routes() -> None:
    problem = matching(10)
    assert Nlopt.default_algorithm(problem) == "LD_CCSAQ"
    assert isinstance(Nlopt("LD_SLSQP").accepts(problem), Native)
    names = {name: replace(Nlopt(), algorithm=name).accepts(problem) for name in GRADIENT}
    assert [b.name for b in _via(names["LD_CCSAQ"]).bridges] == ["radial"]
    assert [b.name for b in _via(names["LD_LBFGS"]).bridges] == ["squares"]


def test_refusals_give_the_number_that_decides() -> None:
    wide = matching(400)
    for algorithm, most in (("LD_SLSQP", 200), ("LN_COBYLA", 60), ("GN_ISRES", 60)):
        assert f"400 unknowns, at most {most}" in _reason(Nlopt(algorithm), wide)
    x = Variable("x", 3)
    loose = Problem("loose", minimize(Smooth(lambda v: float(v @ v), lambda v: 2.0 * v)(x)), x @ free())
    assert "6 of 6 bounds are infinite" in _reason(Nlopt("GN_ISRES"), loose)
    assert "'in the ball'" in _reason(Nlopt("LD_LBFGS"), ball().problem)
    assert "maximizes" in _reason(Nlopt("LD_MMA", bridge="body"), convex_quadratic().problem)
    assert solve(ball().problem, "nlopt:LD_VAR1").status is Status.REFUSED


def test_options_are_checked() -> None:
    with pytest.raises(InputError, match="bridge is 'bodies'"):
        Nlopt("LD_MMA", bridge="bodies")
    with pytest.raises(InputError, match="inner is 'LD_MMA'"):
        Nlopt("LD_AUGLAG", inner="LD_MMA")


def _via(accepted: object) -> Via:
    assert isinstance(accepted, Via)
    return accepted


def _reason(backend: Nlopt, problem: Problem) -> str:
    accepted = backend.accepts(problem)
    assert isinstance(accepted, Refused)
    return accepted.reason


def _slowed(problem: Problem) -> Problem:
    applied = problem.objective.terms[0]

    def value(x: FloatArray) -> float:
        time.sleep(0.002)
        return applied.term.value_and_gradient(x)[0]

    term = Smooth(value, lambda x: applied.term.value_and_gradient(x)[1])
    return Problem(problem.name, minimize(term(applied.variables[0])), *problem.memberships)
