"""Linear assignment by shortest augmenting paths, proved by prices."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.model.assignment_sets import cheapest_assignment
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.structure import LinearAssignment, linear_assignment


def matching(oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
    """Solve min <cost, P> over assignments P, and prove the answer by prices of the columns.

    For any prices v <= 0, sum_i min_j (cost_ij - v_j) + sum_j v_j is a lower bound, by linear programming duality; it
    is evaluated here whatever the prices are worth.
    """
    problem = linear_assignment(oracle.problem)
    assert isinstance(problem, LinearAssignment)
    cost = problem.cost
    oracle.charge(1.0)
    chosen, prices = cheapest_assignment(cost)
    answer = np.zeros_like(cost)
    answer[np.arange(len(cost)), chosen] = 1.0
    oracle.observe(answer.ravel())
    bound = problem.constant + float((cost - prices).min(axis=1).sum() + prices.sum())
    return Raw(answer.ravel(), "assignment found", Bound(bound, "assignment prices", oracle.seconds))
