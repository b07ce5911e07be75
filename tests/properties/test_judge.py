"""Properties of the judge: zero stationarity at known optima, positive elsewhere, nothing hidden."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.formulations.model import (
    Box,
    ElasticNet,
    Problem,
    QuadraticForm,
    Simplex,
    Smooth,
    SmoothConstraint,
    Variable,
    free,
    maximize,
    minimize,
)
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.judge import judge, kkt_residual, restore, violation
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

x3 = Variable("x", 3)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 9), st.integers(0, 10_000), st.floats(0.0, 1.0))
def test_a_linear_problem_is_stationary_at_its_maximiser_alone(size: int, seed: int, mix: float) -> None:
    rng = np.random.default_rng(seed)
    c, surface, x = rng.standard_normal(size), ElasticNet(mix=mix), Variable("x", size)
    problem = Problem("linear", maximize(Linear(c)(x)), x @ surface)
    best = judge(problem, {"x": surface.linear_max(c)})
    assert best.stationarity <= 1e-12
    other = judge(problem, {"x": surface.sample((size,), rng)})
    assert other.objective + other.stationarity == pytest.approx(best.objective, abs=1e-9)  # the gap is exact here
    assert other.stationarity > 0.0
    turned = judge(Problem("turned", minimize(-1.0 * Linear(c)(x)), x @ surface), other.values)
    assert turned.stationarity == pytest.approx(other.stationarity, abs=1e-12)


def test_where_there_is_only_a_projection_the_step_is_measured() -> None:
    target = np.array([2.0, 0.5, -3.0])
    term = Smooth(lambda x: 0.5 * float(((x - target) ** 2).sum()), lambda x: x - target)
    problem = Problem("nearest", minimize(term(x3)), x3 @ Box(-1.0, 1.0))
    assert judge(problem, {"x": target}).stationarity == 0.0  # restored to (1, 0.5, -1), the optimum
    assert judge(problem, {"x": np.zeros(3)}).stationarity == 3.0


def test_a_set_without_closed_forms_is_judged_by_kkt() -> None:
    class Bare:
        def __getattr__(self, name: str) -> Any:
            if name in ("linear_max", "project"):
                raise AttributeError(name)
            return getattr(Simplex(), name)

    c = np.array([3.0, 1.0, 2.0])
    problem = Problem("bare", maximize(Linear(c)(x3)), x3 @ Bare())
    assert judge(problem, {"x": np.array([1.0, 0.0, 0.0])}).stationarity <= 1e-12
    assert judge(problem, {"x": np.array([0.0, 1.0, 0.0])}).stationarity > 0.5


def test_named_constraints_enter_by_their_multipliers() -> None:
    half = SmoothConstraint("at most", lambda x: (x[:1] - 0.5, np.eye(3)[:1]), linear=True)
    c = np.array([3.0, 1.0, 2.0])
    problem = Problem("half", maximize(Linear(c)(x3)), x3 @ Simplex(), constraints={"half": (x3, half)})
    assert judge(problem, {"x": np.array([0.5, 0.0, 0.5])}).stationarity <= 1e-9
    assert judge(problem, {"x": np.array([0.3, 0.3, 0.4])}).stationarity > 0.1
    beyond = judge(problem, {"x": np.array([1.0, 0.0, 0.0])})
    assert beyond.violation == 0.5
    # A multiplier of the wrong sign is no excuse: the constraint pushes outward here.
    pushed = Problem("pushed", minimize(Linear(c)(x3)), x3 @ Box(0.0, 1.0), constraints={"half": (x3, half)})
    assert kkt_residual(pushed, {"x": np.array([0.5, 0.0, 0.0])}) == pytest.approx(3.0)
    assert kkt_residual(pushed, {"x": np.zeros(3)}) == 0.0


def test_an_entry_between_equal_bounds_is_no_obstacle() -> None:
    free_slope = Problem("fixed", minimize(Linear(np.ones(3))(x3)), x3 @ Box(0.5, 0.5))
    assert kkt_residual(free_slope, {"x": np.full(3, 0.5)}) == 0.0


def test_a_violation_that_is_not_a_number_is_not_hidden() -> None:
    broken = SmoothConstraint("at most", lambda x: (np.array([np.nan]), np.zeros((1, 3))))
    problem = Problem("p", minimize(Linear(np.ones(3))(x3)), x3 @ Simplex(), constraints={"nan": (x3, broken)})
    assert violation(problem, {"x": Simplex().center((3,))}) == np.inf


def test_a_gradient_that_is_not_finite_is_never_stationary() -> None:
    def gradient(x: FloatArray) -> FloatArray:
        return np.full(3, np.nan)

    problem = Problem("p", maximize(Smooth(lambda x: 1.0, gradient)(x3)), x3 @ Simplex())
    judged = judge(problem, {"x": np.ones(3)})
    assert judged.objective == 1.0
    assert judged.stationarity == np.inf


def test_restoring_is_per_variable_and_stationarity_adds_up() -> None:
    x, y = Variable("x", 2), Variable("y", 2)
    form = QuadraticForm(np.array([[0.0, 1.0], [1.0, 0.0]]))
    both = Problem("both", maximize(form(x) + form(y)), x @ Simplex(), y @ Simplex())
    values = {"x": np.array([3.0, 1.0]), "y": np.array([1.0, -1.0])}
    point = restore(both, values)
    np.testing.assert_allclose(point["x"], [0.75, 0.25])
    np.testing.assert_allclose(point["y"], [1.0, 0.0])
    single = [Problem("one", maximize(form(v)), v @ Simplex()) for v in (x, y)]
    parts = sum(judge(p, {p.variables[0].name: values[p.variables[0].name]}).stationarity for p in single)
    assert judge(both, values).stationarity == pytest.approx(parts)


def test_an_objective_without_a_bound_is_nowhere_stationary() -> None:
    falling = Problem("falling", minimize(Linear(np.ones(3))(x3)), x3 @ free())
    assert judge(falling, {"x": np.full(3, -1e8)}).stationarity >= 1e8
    for backend in ("native", "scipy:L-BFGS-B", "nlopt:LD_LBFGS"):
        assert solve(falling, backend, limits=Limits(evaluations=300)).status is not Status.STATIONARY


def test_in_a_narrow_box_the_gain_counts_not_the_step() -> None:
    narrow = Problem("narrow", minimize(1e9 * Linear(np.ones(3))(x3)), x3 @ Box(0.0, 1e-7))
    assert judge(narrow, {"x": np.full(3, 1e-7)}).stationarity == pytest.approx(100.0)
    assert judge(narrow, {"x": np.zeros(3)}).stationarity == 0.0


def test_minima_on_curved_surfaces_are_stationary_and_other_points_are_not() -> None:
    rng = np.random.default_rng(3)
    root = rng.standard_normal((3, 3))
    form = QuadraticForm(root @ root.T + 3.0 * np.eye(3))
    problem = Problem("least", minimize(form(x3)), x3 @ ElasticNet(mix=1.0))
    best = solve(problem, "nlopt:LD_SLSQP", starts=5)
    assert judge(problem, best.values).stationarity <= 1e-5
    assert judge(problem, {"x": np.array([1.0, 2.0, 0.1])}).stationarity > 0.1
    A, target = rng.standard_normal((3, 5)), rng.standard_normal((3, 5))
    C = Variable("C", (3, 3))
    squares = Smooth(lambda c: float(np.square(c @ A - target).sum()), lambda c: 2.0 * (c @ A - target) @ A.T)
    nearest = Problem("nearest", minimize(squares(C)), C @ Stiefel())
    left, _, right = np.linalg.svd(target @ A.T)
    assert judge(nearest, {"C": left @ right}).stationarity <= 1e-12
    assert judge(nearest, {"C": np.eye(3)}).stationarity > 0.1
