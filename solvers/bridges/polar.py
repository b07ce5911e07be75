"""From matrices with orthonormal columns to free matrices by their polar factors, for solvers without constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applied, Membership, Objective, Problem, free
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values, restore

_FLAT = 1e-12
"""Sum of two singular values, in terms of the largest, below which the slope along their rotation is not trusted."""


@dataclass(frozen=True, eq=False)
class OnPolarFactors:
    """Evaluate a term at the polar factor U V' of X = U S V'."""

    term: Any

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return f(U V') and its gradient in X.

        With B = U'GV, G the term's own gradient, it is U R V' + (I - U U') G V S^-1 V', R_ij = (B_ij - B_ji) /
        (s_i + s_j). A matrix without full rank has many polar factors; one is taken, and no slope towards the others.
        """
        left, values, right = np.linalg.svd(x[0], full_matrices=False)
        value, slope = self.term.value_and_gradient(left @ right)
        inside = left.T @ slope
        turned = inside @ right.T
        smallest = _FLAT * max(float(values.max(initial=0.0)), 1e-300)
        sums = values[:, None] + values[None, :]
        rotation = np.divide(turned - turned.T, sums, out=np.zeros_like(sums), where=sums > smallest)
        outward = (slope - left @ inside) @ right.T
        scaled = np.divide(outward, values, out=np.zeros_like(outward), where=values > smallest)
        return value, np.asarray((left @ rotation + scaled) @ right)


@dataclass(frozen=True)
class Polar:
    """Replace C with C'C = I by a free matrix X of the same shape, C its polar factor X (X'X)^(-1/2).

    Exact: each C is the polar factor of itself, and of every X = C H with H positive definite, along which the
    objective is flat. A linear objective has no other local optimum than the global one.

    Examples
    --------
    >>> Polar().claim.value
    'exact'

    Source: polar parametrization of the Stiefel manifold: Absil, Mahony and Sepulchre, optimization algorithms on
    matrix manifolds (2008), example 4.1.3.
    """

    name: str = "polar factor"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why polar factors cannot stand for matrices."""
        if problem.constraints:
            return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
        curved = {m.variable.name for m in problem.memberships if isinstance(m.set, Stiefel)}
        if not curved:
            return "a matrix with orthonormal columns"
        for applied in problem.objective.terms:
            if len(applied.variables) > 1 and any(variable.name in curved for variable in applied.variables):
                return f"terms of one variable, and {applied} has {len(applied.variables)}"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem over free matrices."""
        curved = {m.variable.name for m in problem.memberships if isinstance(m.set, Stiefel)}
        terms = tuple(
            Applied(OnPolarFactors(applied.term), applied.variables, applied.weight)
            if applied.variables[0].name in curved
            else applied
            for applied in problem.objective.terms
        )
        memberships = tuple(
            Membership(m.variable, free() if m.variable.name in curved else m.set) for m in problem.memberships
        )
        objective = Objective(problem.objective.sense, terms, problem.objective.constant)

        def inverse(values: Values) -> Values:
            return restore(problem, values)

        return Rewritten(Problem(problem.name, objective, *memberships), lambda values: values, inverse)
