"""The proofs of the small problems hold: each stated point attains the stated optimum and is stationary."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.formulations.model import Sense
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation
from nonrigid.solvers.judge import judge, kkt_residual
from nonrigid.solvers.testing import Instance, instances


@pytest.mark.parametrize("instance", instances(), ids=lambda instance: instance.problem.name)
def test_the_optimum_is_attained_stationary_and_not_beaten_by_samples(instance: Instance) -> None:
    problem = instance.problem
    judged = judge(problem, instance.values)
    assert judged.objective == pytest.approx(instance.optimum, rel=1e-12)
    assert judged.violation <= 1e-12
    assert judged.stationarity <= 1e-9
    # An assignment is a degenerate vertex: least-squares multipliers overstate its residual; samples are vertices.
    degenerate = any(isinstance(m.set, Assignment | PartialPermutation) for m in problem.memberships)
    assert degenerate or kkt_residual(problem, judged.values) <= 1e-9
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    rng = np.random.default_rng(0)
    for _ in range(200):
        values = {m.variable.name: m.set.sample(m.variable.shape, rng) for m in problem.memberships}
        if all(condition.violation(values[v.name]) <= 0.0 for v, condition in problem.constraints.values()):
            assert sign * problem.objective.value(values) <= sign * instance.optimum + 1e-12
            assert degenerate or judge(problem, values).stationarity > 1e-6
