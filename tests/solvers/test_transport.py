"""Transport plans: the linear problem against HiGHS, plans in their set, and solvers of Gromov-Wasserstein problems."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from nonrigid.formulations.model import ModelError, Problem, Sense, Variable, minimize
from nonrigid.formulations.model.terms.gromov_wasserstein import GromovWasserstein
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.transport_plans import cheapest_transport
from nonrigid.formulations.model.transport_sets import PartialTransport
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Refused
from nonrigid.solvers.backend import make_backend
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.testing import Instance, check_backend


def cloud(count: int, seed: int) -> FloatArray:
    points = np.random.default_rng(seed).random((count, 2))
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))


def planted(k: int = 4, n: int = 6) -> tuple[Problem, FloatArray]:
    """Return the transport of k points to themselves among n of equal mass: it has no distortion and no cost."""
    full = cloud(n, 2)
    chosen = np.arange(k)
    true = np.eye(n)[chosen]
    looks = np.abs(np.random.default_rng(3).standard_normal((k, n))) * (1.0 - true)
    T = Variable("T", (k, n))
    energy = GromovWasserstein(full[:k, :k], full)(T) + 0.05 * Linear(looks)(T)
    return Problem("transport", minimize(energy), T @ PartialTransport(np.ones(k), np.ones(n))), true


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 9), st.integers(1, 12), st.floats(1.0, 3.0))
def test_a_plan_is_as_cheap_as_the_whole_linear_problem_says(seed: int, k: int, n: int, room: float) -> None:
    rng = np.random.default_rng(seed)
    cost, mass, capacity = rng.standard_normal((k, n)), rng.random(k) + 0.01, rng.random(n) + 0.01
    capacity *= room * mass.sum() / capacity.sum()
    plan = cheapest_transport(cost, mass, capacity)
    whole = linprog(
        cost.ravel(),
        A_eq=np.kron(np.eye(k), np.ones((1, n))),
        b_eq=mass,
        A_ub=np.kron(np.ones((1, k)), np.eye(n)),
        b_ub=capacity * (1.0 + 1e-12),
    )
    assert np.sum(cost * plan.moved) == pytest.approx(whole.fun, abs=1e-8)
    assert plan.row_prices @ mass + plan.column_prices @ capacity == pytest.approx(whole.fun, abs=1e-8)


@pytest.mark.parametrize("room", [1.0, 1.02, 4.0])
def test_a_large_plan_is_proved_by_its_prices(room: float) -> None:
    rng = np.random.default_rng(0)
    a, b = rng.random((120, 2)), rng.random((90, 2))
    cost = np.sum((a[:, None] - b[None]) ** 2, axis=2)
    mass, capacity = rng.random(120) + 0.1, rng.random(90) + 0.1
    capacity *= room * mass.sum() / capacity.sum()
    plan = cheapest_transport(cost, mass, capacity)
    assert (cost - plan.row_prices[:, None] - plan.column_prices).min() >= -1e-9
    assert plan.column_prices.max() <= 1e-12
    lower = plan.row_prices @ mass + plan.column_prices @ capacity
    assert np.sum(cost * plan.moved) == pytest.approx(lower, abs=1e-9)
    assert PartialTransport(mass, capacity).violation(plan.moved) <= 1e-9
    again = cheapest_transport(cost, mass, capacity, guess=plan.column_prices)
    assert np.sum(cost * again.moved) == pytest.approx(lower, abs=1e-9)


def test_restoring_moves_no_more_than_what_was_amiss() -> None:
    rng = np.random.default_rng(1)
    plans = PartialTransport(rng.random(5) + 0.1, rng.random(8) + 0.6)
    for _ in range(20):
        x = plans.sample((5, 8), rng)
        noisy = x + 1e-3 * rng.standard_normal(x.shape)
        assert np.abs(plans.restore(noisy) - noisy).sum() <= 40 * 6e-3
        np.testing.assert_array_equal(plans.restore(x), plans.restore(plans.restore(x)))


def test_masses_that_find_no_room_are_refused() -> None:
    with pytest.raises(ModelError, match="larger capacities"):
        PartialTransport(np.ones(3), np.ones(2))
    with pytest.raises(ModelError, match="positive"):
        PartialTransport(np.array([1.0, 0.0]), np.ones(2))
    with pytest.raises(ModelError, match="shape"):
        PartialTransport(np.ones(2), np.ones(3)).center((3, 3))


def test_the_term_is_its_definition() -> None:
    part, full = cloud(3, 0), cloud(4, 1)
    T = np.random.default_rng(2).random((3, 4))
    squares = (part[:, :, None, None] - full[None, None]) ** 2
    value = np.einsum("abcd,ac,bd->", squares, T, T)
    assert GromovWasserstein(part, full).value_and_gradient(T)[0] == pytest.approx(value)
    with pytest.raises(ModelError, match="transpose"):
        GromovWasserstein(np.triu(part), full)


@pytest.mark.parametrize("algorithm", ["conditional_gradient", "conditional_gradient_pot"])
def test_conditional_gradients_keep_the_contract(algorithm: str) -> None:
    problem, true = planted()
    if algorithm.endswith("pot") and find_spec("ot") is None:  # the peer is optional, the refusal is not
        answer = make_backend(f"native:{algorithm}").accepts(problem)
        assert isinstance(answer, Refused)
        assert "nonrigid[peers]" in answer.reason
        return
    if algorithm.endswith("pot"):
        import_module("ot")  # here once, which takes seconds, and not in each child process
    instance = Instance(
        problem=problem, optimum=0.0, values={"T": true}, certificate="each term at its least", unimodal=False
    )
    taken = check_backend(
        f"native:{algorithm}", problems=[instance], limits=Limits(evaluations=150, seconds=10.0, hard_seconds=60.0)
    )
    assert taken == ("transport",)


def test_the_vertex_reached_is_no_worse_than_the_best_map_by_far() -> None:
    part, full = cloud(4, 5), cloud(5, 6)
    T = Variable("T", (4, 5))
    term = GromovWasserstein(part, full)
    problem = Problem("transport", minimize(term(T)), T @ PartialTransport(np.ones(4), np.ones(5)))
    maps = [np.eye(5)[list(columns)] for columns in permutations(range(5), 4)]
    best = min(term.value_and_gradient(plan)[0] for plan in maps)
    found = min(solve(problem, start={"T": plan}).objective for plan in maps[::12])
    assert found <= best + 1e-9
    assert problem.objective.sense is Sense.MINIMIZE


@pytest.mark.parametrize("backend", ["native", "nlopt", "casadi", "scipy", "cvxpy"])
def test_every_backend_finds_the_planted_plan_from_near_by(backend: str) -> None:
    problem, true = planted()
    near = 0.7 * true + 0.3 * np.full(true.shape, 1.0 / true.shape[1])
    solution = solve(problem, backend, start={"T": near})
    assert solution.objective == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(solution["T"], true, atol=1e-2)


@pytest.mark.parametrize("backend", ["nlopt:LD_AUGLAG", "casadi:ipopt", "scipy:SLSQP", "cvxpy:CLARABEL"])
def test_sizes_whose_dense_constraints_do_not_fit_are_refused_with_the_number(backend: str) -> None:
    k, n = 300, 500
    T = Variable("T", (k, n))
    plans = PartialTransport(np.ones(k), np.ones(n))
    problem = Problem("transport", minimize(GromovWasserstein(cloud(k, 0), cloud(n, 1))(T)), T @ plans)
    answer = make_backend(backend).accepts(problem)
    assert isinstance(answer, Refused)
    assert "150000 unknowns" in answer.reason
