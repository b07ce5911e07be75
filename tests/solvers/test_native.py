"""The specialised dynamics: monotone, exact on known answers, equal to each other, honest about what they take."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nonrigid.formulations.model import (
    ElasticNet,
    Problem,
    QuadraticForm,
    Simplex,
    Smooth,
    Sphere,
    Variable,
    free,
    maximize,
    minimize,
)
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Refused
from nonrigid.solvers.backends.native import BACKEND, Native
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

COLUMN = ["infection_immunisation", "pairwise_frank_wolfe"]
SIMPLEX = [*COLUMN, "projected_gradient"]
CURVED = ["projected_gradient", "generalised_power"]


def game(matrix: object, surface: ElasticNet | None = None, weight: float = 1.0) -> Problem:
    n = matrix.shape[0]  # type: ignore[attr-defined]
    u = Variable("u", n)
    return Problem("game", maximize(weight * QuadraticForm(matrix)(u)), u @ (surface or Simplex()))


def matching_payoff(n: int, seed: int) -> FloatArray:
    """Payoff of a planted partial matching: 4 candidates a point, conflicts and diagonal 0."""
    rng = np.random.default_rng(seed)
    m = n // 4
    source = rng.random((m, 2))
    target = source + 0.02 * rng.standard_normal((m, 2))
    left = np.repeat(np.arange(m), 4)
    right = rng.integers(0, m, n)
    right[::4] = np.arange(m)

    def spread(points: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))

    A = np.exp(-300.0 * (spread(source)[np.ix_(left, left)] - spread(target)[np.ix_(right, right)]) ** 2)
    A[(left[:, None] == left) | (right[:, None] == right)] = 0.0
    return np.asarray((A + A.T) / 2)


@pytest.mark.parametrize("algorithm", SIMPLEX)
@pytest.mark.parametrize("seed", [0, 1])
def test_dynamics_reach_a_stationary_sparse_point_and_never_descend(algorithm: str, seed: int) -> None:
    answer = solve(game(matching_payoff(60, seed)), f"native:{algorithm}")
    assert answer.status is Status.STATIONARY
    assert answer.stationarity <= 2e-7
    support = np.flatnonzero(answer["u"])
    assert 2 <= len(support) < 30
    objectives = np.array([point.objective for point in answer.trace])
    assert (np.diff(objectives) >= -1e-13).all()


@pytest.mark.parametrize("surface", [ElasticNet(mix=0.05), ElasticNet(mix=0.5), ElasticNet(mix=0.8), Sphere()])
@pytest.mark.parametrize("algorithm", CURVED)
def test_curved_nets_are_solved_without_descent(algorithm: str, surface: ElasticNet) -> None:
    A = matching_payoff(60, 2)
    answer = solve(game(A, surface), f"native:{algorithm}")
    assert answer.status is Status.STATIONARY
    objectives = np.array([point.objective for point in answer.trace])
    assert (np.diff(objectives) >= -1e-12 * objectives.max()).all()
    if surface.mix == 1.0:
        assert answer.objective == pytest.approx(np.linalg.eigvalsh(A)[-1], rel=1e-6)


def test_generalised_power_grows_its_shift_where_the_plain_step_would_descend() -> None:
    """The bipartite game swaps its two sides for ever without a shift."""
    A = np.zeros((6, 6))
    A[:2, 2:] = A[2:, :2] = 1.0
    answer = solve(game(A, Sphere()), "native:generalised_power", start={"u": np.array([0.9, 0.1, 0, 0, 0, 0.1])})
    assert answer.status is Status.STATIONARY
    assert answer.objective == pytest.approx(np.sqrt(8.0))


@pytest.mark.parametrize("algorithm", SIMPLEX)
@given(st.integers(3, 20), st.integers(0, 1000), st.floats(0.1, 1.0))
@settings(max_examples=15, deadline=None)
def test_every_random_game_ends_at_an_equilibrium(algorithm: str, n: int, seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    A = rng.random((n, n)) * (rng.random((n, n)) < density)
    A = (A + A.T) / 2  # the diagonal is not 0 here
    answer = solve(game(A), f"native:{algorithm}", start={"u": rng.dirichlet(np.ones(n))})
    assert answer.status is Status.STATIONARY
    assert answer.violation <= 1e-12


@pytest.mark.parametrize("algorithm", SIMPLEX)
def test_sparse_and_dense_matrices_give_the_same_answer(algorithm: str) -> None:
    A = matching_payoff(60, 3)
    A[A < 0.2] = 0.0
    dense = solve(game(A), f"native:{algorithm}", limits=Limits(tolerance=1e-10))
    thin = solve(game(sparse.csr_array(A)), f"native:{algorithm}", limits=Limits(tolerance=1e-10))
    np.testing.assert_allclose(thin["u"], dense["u"], atol=1e-9)


@pytest.mark.parametrize("algorithm", SIMPLEX)
def test_a_start_without_payoff_does_not_end_there(algorithm: str) -> None:
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 0] = 1.0
    answer = solve(game(A), f"native:{algorithm}", start={"u": np.array([0.0, 0.0, 0.5, 0.5])})
    np.testing.assert_allclose(answer["u"], [0.5, 0.5, 0.0, 0.0], atol=1e-6)
    nothing = solve(game(np.zeros((3, 3))), f"native:{algorithm}")
    assert nothing.status is Status.STATIONARY
    assert nothing.objective == 0.0


@pytest.mark.parametrize("algorithm", SIMPLEX)
def test_limits_keep_the_best_point(algorithm: str) -> None:
    answer = solve(game(matching_payoff(60, 4)), f"native:{algorithm}", limits=Limits(evaluations=2, tolerance=1e-12))
    assert answer.status is Status.LIMIT
    assert answer.evaluations <= 2 + 1e-9
    assert answer.objective == pytest.approx(max(point.objective for point in answer.trace), rel=1e-13)


@pytest.mark.parametrize("algorithm", [*SIMPLEX, "generalised_power"])
def test_an_unreachable_tolerance_ends_by_itself(algorithm: str) -> None:
    surface = ElasticNet() if algorithm == "generalised_power" else Simplex()
    limits = Limits(seconds=None, tolerance=1e-300, evaluations=100_000)
    answer = solve(game(matching_payoff(40, 5), surface), f"native:{algorithm}", limits=limits)
    assert answer.stationarity <= 1e-9
    assert answer.evaluations < 90_000


def test_a_minimized_negative_weight_and_a_scaled_game_are_the_same_game() -> None:
    A, u = matching_payoff(40, 6), Variable("u", 40)
    flipped = solve(Problem("game", minimize(-3.0 * QuadraticForm(A)(u)), u @ Simplex()), "native:projected_gradient")
    plain = solve(game(A), "native:projected_gradient")
    assert flipped.objective == pytest.approx(-3.0 * plain.objective, rel=1e-6)
    assert flipped.trace[-1].objective == pytest.approx(flipped.objective, rel=1e-9)


def test_the_default_suits_the_surface() -> None:
    A = matching_payoff(40, 7)
    assert BACKEND.default_algorithm(game(A)) == "projected_gradient"
    assert BACKEND.default_algorithm(game(A, ElasticNet())) == "generalised_power"


def test_refusals_name_the_number_and_the_way_out() -> None:
    A = matching_payoff(40, 8)
    curved = Native("pairwise_frank_wolfe").accepts(game(A, ElasticNet(mix=0.8)))
    assert isinstance(curved, Refused)
    assert "not 0.8" in curved.reason
    assert "generalised_power" in curved.reason
    flat = Native("generalised_power").accepts(game(A))
    assert isinstance(flat, Refused)
    assert "mix > 0" in flat.reason
    u = Variable("u", 2)
    bowl = Problem("bowl", minimize(Smooth(lambda x: float(x @ x), lambda x: 2 * x)(u)), u @ free())
    assert isinstance(Native("projected_gradient").accepts(bowl), Refused)


def test_the_replicator_ends_on_a_face_that_it_cannot_leave() -> None:
    u = Variable("u", 3)
    game = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 2.0], [2.0, 2.0, 0.0]])
    start = {"u": np.array([0.5, 0.5, 0.0])}
    problem = Problem("game", maximize(QuadraticForm(game)(u)), u @ Simplex())
    answer = solve(problem, "native:replicator", start=start, limits=Limits(evaluations=100))
    assert answer.status is Status.FEASIBLE
    assert answer.evaluations < 10


def test_a_start_without_payoff_is_an_answer_if_no_more_is_granted() -> None:
    u = Variable("u", 3)
    problem = Problem("game", maximize(QuadraticForm(1.0 - np.eye(3))(u)), u @ Simplex())
    answer = solve(problem, start={"u": np.array([1.0, 0.0, 0.0])}, limits=Limits(evaluations=1))
    assert answer.usable
