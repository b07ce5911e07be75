"""From a quadratic game on the simplex to a mixed-integer linear problem over its KKT points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from nonrigid.formulations.model import Membership, Problem, Simplex, SmoothConstraint, Variable, maximize
from nonrigid.formulations.model.binary_sets import MixedBinary
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values, restore
from nonrigid.solvers.structure import QuadraticGame, quadratic_game


@dataclass(frozen=True)
class KktMixedInteger:
    r"""Rewrite max u'Au on the simplex as a linear problem with n binary entries.

    With one vector k = (x, y, p): max p subject to 1'x = 1, A x <= p, p - (A x)_i <= a (1 - y_i), 0 <= x <= y, y in
    {0, 1}^n, a = max A. A strategy played (x_i > 0 needs y_i = 1) has payoff exactly p, no other has more: x is a
    KKT point and p = x'Ax. Exact: some KKT point is a global maximum.

    Source: Xia, Vera and Zuluaga, globally solving nonconvex quadratic programs with linear integer programming
    techniques (INFORMS J. Computing 2020), for the standard quadratic program.

    Parameters
    ----------
    largest
        Number of strategies above which branch and bound is not tried: 2^n combinations, and the bound 0 <= x <= y is
        weak.
    """

    largest: int = 80
    name: str = "KKT mixed-integer"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why the problem is no quadratic game on the simplex, or too large."""
        game = quadratic_game(problem)
        if isinstance(game, str):
            return game
        if not isinstance(game.surface, Simplex):
            return f"a simplex, not {game.surface}"
        if game.size > self.largest:
            return f"at most {self.largest} strategies, each a binary entry, and this game has {game.size}"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the mixed-integer linear problem over k = (x, y, p)."""
        game = quadratic_game(problem)
        assert isinstance(game, QuadraticGame)
        n, A = game.size, _dense(game)
        largest = max(float(A.max(initial=0.0)), 1e-300)
        k, (original,) = Variable("k", 2 * n + 1), problem.variables
        integral = np.zeros(2 * n + 1, bool)
        integral[n : 2 * n] = True
        upper = np.ones(2 * n + 1)
        upper[-1] = largest
        payoff = np.zeros(2 * n + 1)
        payoff[-1] = 1.0
        constraints = {
            "shares": (k, _affine("equal", np.r_[np.ones(n), np.zeros(n + 1)][None, :], np.ones(1))),
            "equilibrium": (k, _affine("at most", *_equilibrium(A, largest))),
        }
        rewritten = Problem(
            problem.name,
            replace(maximize(game.weight * Linear(payoff)(k)), constant=problem.objective.constant),
            Membership(k, MixedBinary(integral=integral, upper=upper)),
            constraints=MappingProxyType(constraints),
        )

        def forward(values: Values) -> Values:
            u = values[original.name]
            return {"k": np.concatenate([u, (u > 0.0).astype(float), [float(u @ (A @ u))]])}

        def inverse(values: Values) -> Values:
            return restore(problem, {original.name: values["k"][:n]})

        return Rewritten(rewritten, forward, inverse)


def _dense(game: QuadraticGame) -> FloatArray:
    matrix = game.matrix
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=float)


def _equilibrium(A: FloatArray, largest: float) -> tuple[FloatArray, FloatArray]:
    n = len(A)
    one, zero, column = np.eye(n), np.zeros((n, n)), np.ones((n, 1))
    rows = np.block(
        [
            [A, zero, -column],
            [-A, largest * one, column],
            [one, -one, 0.0 * column],
        ]
    )
    return rows, np.concatenate([np.zeros(n), np.full(n, largest), np.zeros(n)])


def _affine(kind: Literal["equal", "at most"], rows: FloatArray, right: FloatArray) -> SmoothConstraint:
    return SmoothConstraint(kind, lambda k: (rows @ k - right, rows), linear=True)
