"""Certificates: on the right side whatever happens inside, tight where theory says so."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

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
from nonrigid.formulations.model.assignment_sets import PartialPermutation
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.solvers.bounds.bound import BoundError, bound, bound_methods
from nonrigid.solvers.bounds.clique import colour_classes
from nonrigid.solvers.bounds.doubly_nonnegative import DoublyNonnegative
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

ON_SIMPLEX = ["clique", "doubly_nonnegative", "eigenvalue", "mixed_integer"]


def game(matrix: FloatArray, surface: ElasticNet | None = None) -> Problem:
    u = Variable("u", len(matrix))
    return Problem("game", maximize(QuadraticForm(matrix)(u)), u @ (surface or Simplex()))


def largest_by_enumeration(B: FloatArray) -> float:
    """Solve the equilibrium conditions of every support: a maximiser equalises the payoffs it plays."""
    n, best = len(B), float(np.diag(B).max())
    for size in range(2, n + 1):
        for chosen in combinations(range(n), size):
            bordered = np.zeros((size + 1, size + 1))
            bordered[:size, :size] = B[np.ix_(chosen, chosen)]
            bordered[:size, size], bordered[size, :size] = -1.0, 1.0
            if abs(np.linalg.det(bordered)) < 1e-12:
                continue  # then a smaller support does as well
            x = np.linalg.solve(bordered, np.eye(size + 1)[size])
            if (x[:size] >= -1e-12).all():
                best = max(best, float(x[size]))
    return best


def random_game(n: int, seed: int, *, payoff: bool) -> FloatArray:
    rng = np.random.default_rng(seed)
    B = rng.random((n, n)) if payoff else rng.standard_normal((n, n))
    B = (B + B.T) / 2
    if payoff:
        B[rng.random((n, n)) < 0.3] = 0.0
        B = np.minimum(B, B.T)
        np.fill_diagonal(B, 0.0)
    return B


@pytest.mark.parametrize("method", ON_SIMPLEX)
@given(st.integers(2, 8), st.integers(0, 10_000), st.booleans())
@example(2, 2, True)  # nothing pays anything: every point is optimal
@settings(max_examples=12, deadline=None)
def test_bounds_lie_on_the_right_side(method: str, n: int, seed: int, payoff: bool) -> None:
    B = random_game(n, seed, payoff=payoff)
    best = largest_by_enumeration(B)
    assert bound(game(B), method, seconds=10).value >= best - 1e-12
    u = Variable("u", n)
    smallest = Problem("game", minimize(QuadraticForm(-B)(u)), u @ Simplex())
    assert bound(smallest, method, seconds=10).value <= -best + 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_exact_bounds_meet_the_optimum(seed: int) -> None:
    B = random_game(12, seed, payoff=True)
    best = largest_by_enumeration(B)
    assert bound(game(B), "mixed_integer").value == pytest.approx(best, abs=2e-6)
    small = B[:4, :4]  # doubly nonnegative is completely positive up to n = 4
    exact = largest_by_enumeration(small)
    assert bound(game(small), "doubly_nonnegative").value == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("iterations", [1, 3, 10])
def test_a_bound_from_an_unfinished_run_is_a_bound(iterations: int) -> None:
    B = random_game(10, 5, payoff=True)
    early = DoublyNonnegative(iterations=iterations).prove(game(B), 10.0).value
    assert early >= largest_by_enumeration(B) - 1e-12
    assert early <= B.max()


def planted_payoff(n: int) -> FloatArray:
    rng = np.random.default_rng(0)
    B = 0.6 * rng.random((n, n))
    B[:10, :10] = 0.9 + 0.1 * rng.random((10, 10))
    B = np.triu(B, 1)
    B[np.arange(n)[:, None] // 2 == np.arange(n) // 2] = 0.0
    return np.asarray(B + B.T)


def test_a_planted_game_is_certified() -> None:
    problem = game(planted_payoff(40))
    answer = solve(problem, "native", starts=3)
    certified = answer.with_bound(bound(problem))
    assert certified.status is Status.CERTIFIED
    assert certified.gap is not None
    assert -1e-9 <= certified.gap <= 1e-6
    assert certified.certificate == "doubly_nonnegative"


def test_conflicts_in_m_groups_give_one_minus_one_over_m() -> None:
    group = np.arange(30) // 6
    B = 1.0 * (group[:, None] != group)
    assert bound(game(B), "clique").value == pytest.approx(0.8)
    classes = colour_classes(B > 0)
    assert sorted(len(members) for members in classes) == [6] * 5


def test_the_sphere_is_exact_and_the_net_between_is_bounded() -> None:
    B = random_game(15, 1, payoff=True)
    assert bound(game(B, Sphere())).value == pytest.approx(solve(game(B, Sphere())).objective, rel=1e-5)
    net = game(B, ElasticNet(mix=0.5))
    assert bound(net).value >= solve(net, starts=5).objective
    negative = game(-np.eye(3) - 0.1, Sphere())
    assert bound(negative).value >= -1.1 - 1e-12


def test_time_is_kept_and_the_bound_still_holds() -> None:
    B = random_game(120, 2, payoff=True)
    answer = solve(game(B), starts=3)
    for method in ("doubly_nonnegative", "mixed_integer"):
        found = bound(game(B), method, seconds=0.3)
        assert found.value >= answer.objective - 1e-12
        assert found.seconds < 5.0


def test_what_cannot_be_bounded_says_why() -> None:
    B = random_game(6, 0, payoff=True)
    with pytest.raises(BoundError, match=r"clique needs a variable on a simplex, not in ElasticNet.*use eigenvalue"):
        bound(game(B, ElasticNet()), "clique")
    u = Variable("u", 2)
    bowl = Problem("bowl", minimize(Smooth(lambda x: float(x @ x), lambda x: 2 * x)(u)), u @ free())
    with pytest.raises(BoundError, match="no bound is automatic"):
        bound(bowl)
    with pytest.raises(BoundError, match="no other bound"):
        bound(bowl, "clique")
    with pytest.raises(BoundError, match="at most 400 strategies, and the problem has 401"):
        bound(game(np.zeros((401, 401))), "mixed_integer")
    with pytest.raises(UnknownNameError):
        bound(bowl, "magic")
    with pytest.raises(InputError):
        bound(bowl, seconds=0)
    assert set(ON_SIMPLEX) <= set(bound_methods())


def test_a_bound_that_the_answer_exceeds_certifies_nothing() -> None:
    u = Variable("u", 3)
    answer = solve(Problem("game", maximize(QuadraticForm(1.0 - np.eye(3))(u)), u @ Simplex()))
    refuted = answer.with_bound(Bound(0.1, "mistaken", 0.0))
    assert refuted.status is Status.STATIONARY
    assert refuted.bound is None
    assert "the bound 0.1 (mistaken) is refuted" in refuted.message
    assert answer.with_bound(Bound(answer.objective, "exact", 0.0)).status is Status.CERTIFIED


@pytest.mark.parametrize("method", ["doubly_nonnegative", "eigenvalue", "auto"])
def test_rounding_of_a_matrix_is_no_fault_of_its_bound(method: str) -> None:
    rng = np.random.default_rng(0)
    u = Variable("u", 4)
    matrix = -5.0 + 1e-13 * rng.standard_normal((4, 4))
    problem = Problem("even", maximize(QuadraticForm(matrix)(u)), u @ Simplex())
    found = bound(problem, method).value
    assert found >= -5.0 - 1e-6
    assert method == "eigenvalue" or found <= -5.0 + 1e-4


def test_a_chain_keeps_the_proof_of_a_later_attempt() -> None:
    P = Variable("P", (3, 3))
    problem = Problem("assignment", minimize(Linear(np.arange(9.0).reshape(3, 3) % 4)(P)), P @ PartialPermutation())
    answer = solve(problem, ["cvxpy:CLARABEL", "native"])
    assert [attempt.status for attempt in answer.attempts] == [Status.FEASIBLE, Status.CERTIFIED]
    assert answer.attempts[0].objective == pytest.approx(answer.attempts[1].objective)
    assert answer.status is Status.CERTIFIED
