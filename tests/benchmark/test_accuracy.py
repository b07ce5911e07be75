"""A run is accepted for what was proved or measured of it, never for what a rounded relaxation looks like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nonrigid.benchmark.accuracy import is_accepted
from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize, minimize
from nonrigid.formulations.model.assignment_sets import PartialPermutation
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def test_a_stationary_point_is_accepted_at_the_tolerance_asked() -> None:
    u = Variable("u", 3)
    answer = solve(Problem("game", maximize(QuadraticForm(1.0 - np.eye(3))(u)), u @ Simplex()))
    assert is_accepted(answer, Limits())
    rough = replace(answer, stationarity=1e-4)
    assert is_accepted(rough, Limits(tolerance=1e-3))
    assert not is_accepted(rough, Limits(tolerance=1e-5))
    assert not is_accepted(replace(answer, violation=1e-3), Limits())


def test_a_rounded_relaxation_is_accepted_with_a_certificate_alone() -> None:
    P = Variable("P", (3, 3))
    problem = Problem("assignment", minimize(Linear(np.arange(9.0).reshape(3, 3) % 4)(P)), P @ PartialPermutation())
    rounded = solve(problem, "cvxpy:CLARABEL")
    assert rounded.status is Status.FEASIBLE
    assert rounded.claim == "relaxation"
    assert not is_accepted(rounded, Limits())
