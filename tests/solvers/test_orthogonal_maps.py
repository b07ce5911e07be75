"""The fit of a map with orthonormal columns on every kind of solver: its polar factor, by each route."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from nonrigid.formulations.spectral_growth import map_fit
from nonrigid.solvers.backends.cvxpy import Cvxpy
from nonrigid.solvers.bridges.polar import Polar
from nonrigid.solvers.bridges.spectral_ball import SpectralBall, ToSpectralBall
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing import check_bridge

ROUTES = {
    "nlopt:LD_CCSAQ": "polar factor",
    "nlopt:LD_LBFGS": "polar factor",
    "casadi:ipopt": "polar factor",
    "scipy:L-BFGS-B": "polar factor",
    "cvxpy:SCS": "spectral ball",
    "cvxpy:CLARABEL": "spectral ball",
}


@pytest.mark.parametrize("backend", ROUTES)
def test_every_backend_finds_the_polar_factor(backend: str) -> None:
    rough = np.random.default_rng(1).standard_normal((9, 5))
    answer = solve(map_fit("map", rough), backend)
    left, values, right = np.linalg.svd(rough, full_matrices=False)
    assert answer.status is Status.STATIONARY
    assert answer.route == (ROUTES[backend], backend)
    assert answer.objective == pytest.approx(values.sum(), rel=1e-8)
    assert np.abs(answer["C"] - left @ right).max() < 1e-3


@settings(max_examples=25, deadline=None)
@example(4, 4, 1)  # a point near a matrix of lower rank, where the polar factor turns sharply
@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(0, 4))
def test_both_bridges_keep_their_contract(seed: int, columns: int, more: int) -> None:
    problem = map_fit("map", np.random.default_rng(seed).standard_normal((columns + more, columns)))
    check_bridge(Polar(), problem, rng_seed=seed)
    check_bridge(ToSpectralBall(), problem, rng_seed=seed)


@given(st.integers(0, 10**6))
def test_the_ball_is_the_hull(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ball, member, outside = SpectralBall(), SpectralBall().sample((4, 3), rng), rng.standard_normal((4, 3))
    nearest = ball.project(outside)
    assert ball.violation(nearest) < 1e-12
    # The angle at a nearest point towards any member is obtuse.
    assert float(np.sum((outside - nearest) * (member - nearest))) < 1e-9
    assert np.allclose(ball.project(member), member)
    assert np.sum(outside * ball.linear_max(outside)) >= np.sum(outside * member) - 1e-12


def test_matrices_too_large_for_a_cone_are_refused_with_the_remedy() -> None:
    refused = Cvxpy("CLARABEL").accepts(map_fit("map", np.eye(80, 40)))
    assert "order 120, at most 90 work; use SCS" in str(refused)
    assert "use SCS or CLARABEL" in str(Cvxpy("OSQP").accepts(map_fit("map", np.eye(3, 2))))
