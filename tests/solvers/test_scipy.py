"""SciPy: every algorithm on proved optima, limits, faults and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, SmoothConstraint, Variable, maximize
from nonrigid.solvers.acceptance import Refused
from nonrigid.solvers.backends.scipy import Scipy
from nonrigid.solvers.bridges.radial import OnRays
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing import check_backend
from nonrigid.solvers.testing.instances import (
    ball,
    convex_quadratic,
    elastic_net,
    planted_game,
    planted_payoff,
    rosenbrock,
    two_variables,
)

SMOOTH = [algorithm for algorithm in Scipy.algorithms if algorithm != "milp"]


def matching(n: int) -> Problem:
    u = Variable("u", n)
    return Problem("game", maximize(QuadraticForm(planted_payoff(n))(u)), u @ Simplex())


@pytest.mark.parametrize("algorithm", SMOOTH)
def test_keeps_the_contract_of_a_backend(algorithm: str) -> None:
    problems = [planted_game(), convex_quadratic(), rosenbrock(), elastic_net(), ball()]
    accepted = check_backend(Scipy(algorithm), problems=problems)
    assert len(accepted) == (4 if algorithm == "L-BFGS-B" else 5)


@pytest.mark.parametrize("algorithm", SMOOTH)
def test_reaches_the_best_known_matching(algorithm: str) -> None:
    problem = matching(30)
    best = solve(problem, "native:replicator", starts=6).objective
    found = solve(problem, Scipy(algorithm), starts=2, limits=Limits(seconds=10))
    assert found.status is Status.STATIONARY
    assert found.objective == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("algorithm", SMOOTH)
def test_limits_hold(algorithm: str) -> None:
    counted = solve(rosenbrock().problem, Scipy(algorithm), limits=Limits(evaluations=3))
    assert counted.evaluations <= 3
    assert counted.status is Status.LIMIT
    timed = solve(matching(150), Scipy(algorithm), limits=Limits(seconds=1e-4))
    assert timed.status is Status.LIMIT


@pytest.mark.parametrize("algorithm", ["SLSQP", "trust-constr"])
def test_a_constraint_that_is_not_finite_ends_the_solve(algorithm: str) -> None:
    problem = ball().problem
    variable = problem.variables[0]
    broken = SmoothConstraint("at most", lambda x: (np.array([np.nan]), np.zeros((1, 3))))
    asked = Problem("broken", problem.objective, *problem.memberships, constraints={"hole": (variable, broken)})
    found = solve(asked, Scipy(algorithm), limits=Limits(seconds=5))
    assert found.status in (Status.NUMERICAL_ERROR, Status.INFEASIBLE)
    assert not found.status.usable


def test_refusals_give_the_number_that_decides() -> None:
    for algorithm, most in (("SLSQP", 500), ("trust-constr", 200)):
        refused = Scipy(algorithm).accepts(matching(600))
        assert isinstance(refused, Refused)
        assert f"600 unknowns, at most {most}" in refused.reason
    assert "'in the ball'" in str(Scipy("L-BFGS-B").accepts(ball().problem))
    assert Scipy.default_algorithm(ball().problem) == "SLSQP"
    assert Scipy.default_algorithm(matching(600)) == "L-BFGS-B"


def test_a_solution_is_reported_through_both_variables() -> None:
    instance = two_variables()
    found = solve(instance.problem, "scipy")
    assert found.algorithm == "SLSQP"
    for name, value in instance.values.items():
        np.testing.assert_allclose(found[name], value, atol=1e-6)


def test_the_origin_of_the_rays_stands_for_the_center() -> None:
    payoff = QuadraticForm(1.0 - np.eye(3))
    value, gradient = OnRays(payoff, Simplex()).value_and_gradient(np.zeros(3))
    assert value == pytest.approx(payoff.value_and_gradient(np.full(3, 1.0 / 3.0))[0])
    assert not gradient.any()
