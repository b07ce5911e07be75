"""Linear least squares in a matrix, in closed form."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.formulations.model.terms.squared_residual import SquaredResidual
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle


def regression(problem: Problem) -> SquaredResidual | str:
    """Return the one term of min ||C A - B||_F^2 over all matrices C, or say what keeps the problem from being so."""
    wanted = "one free matrix and one term ||C A - B||_F^2, minimized"
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or len(problem.objective.terms) != 1:
        return f"{wanted}, not {len(problem.objective.terms)} of {', '.join(map(str, problem.memberships))}"
    applied, member = problem.objective.terms[0], problem.memberships[0]
    weight = applied.weight if problem.objective.sense is Sense.MINIMIZE else -applied.weight
    if not isinstance(applied.term, SquaredResidual) or weight <= 0.0:
        return f"{wanted}, not {problem.objective.sense.value} {applied} with {member}"
    low, high = member.set.bounds(member.variable.shape)
    if np.isfinite(low).any() or np.isfinite(high).any() or member.set.constraints(low.shape):
        return f"{wanted}, not {member}"
    return applied.term


def least_squares(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Return the minimizer of ||C A - B||_F^2 with the least norm, by singular values of A: a global optimum."""
    term = regression(oracle.problem)
    assert not isinstance(term, str)
    best = np.asarray(np.linalg.lstsq(term.source.T, term.target.T, rcond=None)[0].T.ravel(), dtype=np.float64)
    oracle.value_and_gradient(best)
    return best, "closed form by singular values"
