"""Sifting answers for the whole game, whichever backend solves the small ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nonrigid.formulations.model import (
    ElasticNet,
    Problem,
    QuadraticForm,
    Simplex,
    Variable,
    free,
    maximize,
    minimize,
)
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Native, Refused
from nonrigid.solvers.backends.sifted import Sifted
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def planted(n: int = 400, players: int = 30) -> FloatArray:
    """Payoff whose optimum plays a known few: they agree with one another at 0.9 to 1, all else at less than a half."""
    rng = np.random.default_rng(4)
    A = 0.4 * rng.random((n, n))
    chosen = rng.permutation(n)[:players]
    A[np.ix_(chosen, chosen)] = 0.9 + 0.1 * rng.random((players, players))
    return np.asarray(np.triu(A, 1) + np.triu(A, 1).T)


def game(matrix: object, surface: ElasticNet, weight: float = 1.0) -> Problem:
    u = Variable("u", matrix.shape[0])  # type: ignore[attr-defined]
    return Problem("game", maximize(weight * QuadraticForm(matrix)(u)), u @ surface)


@pytest.mark.parametrize("surface", [Simplex(), ElasticNet(mix=0.3)], ids=["simplex", "net"])
@pytest.mark.parametrize("inner", ["casadi:ipopt", "nlopt:LD_CCSAQ", "cvxpy:CLARABEL"])
def test_the_answer_is_stationary_for_the_whole_game(inner: str, surface: ElasticNet) -> None:
    problem = game(planted(), surface, weight=3.0)
    answer = solve(problem, Sifted(inner, least=20), limits=Limits(seconds=30))
    best = solve(problem, "native")
    assert answer.status is Status.STATIONARY, answer.message
    assert answer.objective == pytest.approx(best.objective, abs=1e-5)


def test_it_starts_from_the_players_of_a_given_start() -> None:
    problem = game(planted(), Simplex())
    best = solve(problem, "native")
    again = solve(problem, Sifted("nlopt:LD_CCSAQ", least=40), start=best)
    assert again.objective >= best.objective - 1e-9
    assert again.evaluations < 3.0


def test_a_sparse_payoff_gives_the_same_answer() -> None:
    dense = planted()
    dense[dense < 0.2] = 0.0
    chosen = Sifted("nlopt:LD_CCSAQ", least=40)
    answers = [solve(game(matrix, Simplex()), chosen) for matrix in (dense, sparse.csr_array(dense))]
    assert answers[0].objective == pytest.approx(answers[1].objective, abs=1e-9)


def test_limits_hold_for_both_levels() -> None:
    answer = solve(game(planted(), Simplex()), Sifted("nlopt:LD_CCSAQ", least=20), limits=Limits(evaluations=2))
    assert answer.evaluations <= 2.0
    assert answer.values


def test_it_takes_what_the_inner_backend_takes_once_small() -> None:
    """A dense Hessian is refused at 1200 strategies, and taken at 120."""
    chaff = sparse.random_array((1200, 1200), density=0.01, rng=np.random.default_rng(0))
    problem = game(chaff + chaff.T, Simplex())
    assert isinstance(Sifted("casadi:ipopt-hessian", least=1200).accepts(problem), Refused)
    assert isinstance(Sifted("casadi:ipopt-hessian", least=100).accepts(problem), Native)


def test_other_problems_are_refused_with_the_reason() -> None:
    x = Variable("x", 3)
    refused = Sifted("casadi:ipopt").accepts(Problem("plane", minimize(Linear(np.ones(3))(x)), x @ free()))
    assert isinstance(refused, Refused)
    assert "simplex" in refused.reason
