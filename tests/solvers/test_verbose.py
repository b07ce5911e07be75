"""Solvers are silent, and speak where they are asked to."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve


@pytest.mark.parametrize(
    ("spec", "word"),
    [
        ("casadi:ipopt", "inf_pr"),
        ("casadi:ipopt-hessian", "inf_pr"),
        ("casadi:sqpmethod", "inf_pr"),
        ("cvxpy:CLARABEL", "pcost"),
        ("cvxpy:SCS", "SCS"),
        ("cvxpy:OSQP", "OSQP"),
        ("cvxpy:HIGHS", "HiGHS"),
        ("cvxpy:PIQP", "PIQP"),
        ("scipy:SLSQP", "Function evaluations"),
        ("scipy:trust-constr", "opt"),
    ],
)
def test_a_solver_speaks_only_where_it_is_asked_to(spec: str, word: str, capfd: pytest.CaptureFixture[str]) -> None:
    payoff = np.random.default_rng(0).random((6, 6))
    u = Variable("u", 6)
    problem = Problem("game", maximize(QuadraticForm(payoff + payoff.T)(u)), u @ Simplex())
    assert solve(problem, spec).status.usable
    silent = capfd.readouterr()
    assert silent.out + silent.err == ""
    assert solve(problem, spec, limits=Limits(verbose=True)).status.usable
    spoken = capfd.readouterr()
    assert word in spoken.out + spoken.err
