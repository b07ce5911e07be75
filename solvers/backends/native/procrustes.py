"""Orthogonal Procrustes: the best matrix with orthonormal columns, in closed form."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle


def procrustes_gain(problem: Problem) -> FloatArray | str:
    """Return K of a problem max <K, C> over C'C = I, or say in words what keeps the problem from being one."""
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or not isinstance(problem.memberships[0].set, Stiefel):
        return f"one matrix with orthonormal columns, not {', '.join(map(str, problem.memberships))}"
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    gain = np.zeros(problem.variables[0].shape)
    for applied in problem.objective.terms:
        if not isinstance(applied.term, Linear):
            return f"linear terms, not {applied}"
        gain += sign * applied.weight * applied.term.coefficients
    return gain


def procrustes(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Return the polar factor U V' of K = U S V', the maximizer of <K, C> over C'C = I: a global optimum.

    Source: Schoenemann, a generalized solution of the orthogonal Procrustes problem (Psychometrika 1966).
    """
    gain = procrustes_gain(oracle.problem)
    assert not isinstance(gain, str)
    best = Stiefel().linear_max(gain).ravel()
    oracle.value_and_gradient(best)
    return best, "closed form by singular values"
