"""CVXPY's solvers: one solve where convex, steps that never worsen elsewhere, limits, refusals with reasons."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.formulations.model import (
    Box,
    Curvature,
    ElasticNet,
    Problem,
    QuadraticForm,
    Simplex,
    Smooth,
    SmoothConstraint,
    Sphere,
    Variable,
    free,
    maximize,
    minimize,
)
from nonrigid.formulations.model.binary_sets import binary
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.cvxpy import BACKEND
from nonrigid.solvers.bridges.body import ToBody
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

CONVEX = ["CLARABEL", "SCS", "OSQP", "PIQP", "HIGHS"]


def payoff(n: int, seed: int = 0) -> FloatArray:
    """Planted partial matching: n = 5 m candidates of m points, most points with one nearly right candidate."""
    rng = np.random.default_rng(seed)
    m = n // 5
    whole = rng.random((8 * m, 3))
    part = whole[:m] + 0.01 * rng.standard_normal((m, 3))
    x, y = np.repeat(np.arange(m), 5), rng.integers(0, 8 * m, n)
    y[::5] = np.where(rng.random(m) < 0.8, np.arange(m), y[::5])
    d_part = np.linalg.norm(part[x][:, None] - part[x], axis=2)
    d_whole = np.linalg.norm(whole[y][:, None] - whole[y], axis=2)
    A = np.exp(-100.0 * (d_part - d_whole) ** 2)
    A[(x[:, None] == x) | (y[:, None] == y)] = 0.0
    return 0.5 * (A + A.T)


def game(n: int) -> Problem:
    u = Variable("u", n)
    return Problem("game", maximize(QuadraticForm(payoff(n))(u)), u @ Simplex())


def pressed(n: int, curvature: Curvature = Curvature.CONVEX) -> tuple[Problem, FloatArray]:
    """Minimize |D x|^2 on the simplex: x_i proportional to 1 / d_i^2."""
    weights = np.arange(1.0, n + 1.0)
    x = Variable("x", n)
    form = QuadraticForm(np.diag(weights), curvature=curvature)
    return Problem("pressed", minimize(form(x)), x @ Simplex()), (1 / weights) / np.sum(1 / weights)


@pytest.fixture(scope="module")
def best() -> float:
    return solve(game(30), "casadi:ipopt", starts=30, seed=3).objective


@pytest.mark.parametrize("algorithm", [*CONVEX, "nlp-UNO"])
def test_planted_game_is_stationary_and_reaches_the_best_known_from_several_starts(algorithm: str, best: float) -> None:
    answer = solve(game(30), f"cvxpy:{algorithm}", starts=4, limits=Limits(seconds=20))
    assert answer.status is Status.STATIONARY
    assert answer.violation <= 1e-12
    assert answer.objective >= best - 1e-5


@pytest.mark.parametrize("algorithm", CONVEX)
def test_steps_never_worsen_the_objective(algorithm: str) -> None:
    answer = solve(game(30), f"cvxpy:{algorithm}")
    accepted = np.maximum.accumulate([point.objective for point in answer.trace])
    assert answer.objective == pytest.approx(accepted[-1], abs=1e-12)


@pytest.mark.parametrize("algorithm", [*CONVEX, "nlp-UNO"])
def test_convex_problem_is_solved_at_once(algorithm: str) -> None:
    problem, expected = pressed(6)
    answer = solve(problem, f"cvxpy:{algorithm}")
    assert answer.status is Status.STATIONARY
    assert answer.evaluations == 0.0
    assert np.abs(answer["x"] - expected).max() < 1e-6


def test_a_wrong_declaration_of_convexity_is_found_out() -> None:
    x = Variable("x", 3)
    saddle = QuadraticForm(np.diag([1.0, -1.0, 2.0]), curvature=Curvature.CONVEX)
    answer = solve(Problem("saddle", minimize(saddle(x)), x @ Simplex()), "cvxpy:CLARABEL")
    assert answer.evaluations > 0  # stepped, not solved at once
    assert answer.objective == pytest.approx(-1.0)


def test_convex_terms_are_kept_beside_linearised_ones() -> None:
    problem, _ = pressed(5)
    (x,) = problem.variables
    wave = Smooth(lambda z: float(np.sin(3.0 * z).sum()), lambda z: 3.0 * np.cos(3.0 * z))
    mixed = Problem("mixed", minimize(problem.objective.terms[0] + wave(x)), x @ Simplex())
    peer = solve(mixed, "casadi:ipopt")
    for algorithm in ("CLARABEL", "OSQP"):
        answer = solve(mixed, f"cvxpy:{algorithm}")
        assert answer.status is Status.STATIONARY
        assert answer.objective == pytest.approx(peer.objective, abs=1e-5)


def test_undeclared_curvature_and_named_linear_constraint() -> None:
    problem, _ = pressed(4, Curvature.UNKNOWN)
    (x,) = problem.variables
    cap = SmoothConstraint("at most", lambda z: (z[:1] - 0.25, np.eye(4)[:1]), linear=True)
    rest = (1 / np.array([2.0, 3.0, 4.0])) * 0.75 / np.sum(1 / np.array([2.0, 3.0, 4.0]))
    capped = Problem("capped", problem.objective, x @ Simplex(), constraints={"cap": (x, cap)})
    for algorithm in (*CONVEX, "nlp-UNO"):
        answer = solve(capped, f"cvxpy:{algorithm}")
        assert np.abs(answer["x"] - np.r_[0.25, rest]).max() < 1e-5, algorithm


@pytest.mark.parametrize("algorithm", ["CLARABEL", "SCS", "nlp-UNO"])
@pytest.mark.parametrize("surface", [ElasticNet(), Sphere()])
def test_curved_surfaces_through_their_bodies(algorithm: str, surface: ElasticNet) -> None:
    u = Variable("u", 20)
    problem = Problem("curved", maximize(QuadraticForm(payoff(20))(u)), u @ surface)
    answer = solve(problem, f"cvxpy:{algorithm}")
    assert answer.status is Status.STATIONARY
    assert answer.route[0] == ("surface to body" if algorithm != "nlp-UNO" else "cvxpy:nlp-UNO")
    assert answer.objective == pytest.approx(solve(problem, "casadi:ipopt").objective, abs=1e-5)


def test_matrix_and_vector_variables_in_boxes() -> None:
    C, v = Variable("C", (2, 3)), Variable("v", 2)
    T = np.arange(6.0).reshape(2, 3)
    fit = Smooth(lambda c: float(((c - T) ** 2).sum()), lambda c: 2.0 * (c - T))
    problem = Problem("fit", minimize(fit(C) + Linear(np.ones(2))(v)), C @ Box(upper=3.0), v @ Box(0.5, 2.0))
    answer = solve(problem, "cvxpy:OSQP")
    assert np.allclose(answer["C"], np.minimum(T, 3.0), atol=1e-6)
    assert np.allclose(answer["v"], 0.5, atol=1e-6)


@pytest.mark.parametrize("algorithm", ["CLARABEL", "OSQP", "PIQP"])
def test_limits_are_kept(algorithm: str) -> None:
    few = solve(game(30), f"cvxpy:{algorithm}", limits=Limits(evaluations=3))
    assert few.status is Status.LIMIT
    assert few.evaluations <= 3
    x = Variable("x", 2)
    valley = Smooth(
        lambda z: float(100.0 * (z[1] - z[0] ** 2) ** 2 + (1.0 - z[0]) ** 2),
        lambda z: np.array([-400.0 * z[0] * (z[1] - z[0] ** 2) - 2.0 * (1.0 - z[0]), 200.0 * (z[1] - z[0] ** 2)]),
    )
    brief = solve(
        Problem("valley", minimize(valley(x)), x @ Box(-2.0, 2.0)),
        f"cvxpy:{algorithm}",
        limits=Limits(seconds=0.2, tolerance=1e-12),
    )
    assert brief.status is Status.LIMIT
    assert brief.solve_seconds < 1.7
    assert brief.objective < 1.0


def test_a_value_that_is_not_finite_is_a_numerical_error() -> None:
    x = Variable("x", 2)
    cliff = Smooth(lambda z: float(z @ z) if z[0] > 0.9 else float("nan"), lambda z: 2.0 * z)
    problem = Problem("cliff", minimize(cliff(x)), x @ Box(0.0, 2.0))
    assert solve(problem, "cvxpy:CLARABEL", start={"x": np.ones(2)}).status is Status.NUMERICAL_ERROR


def test_refusals_give_the_reason() -> None:
    def reasons(problem: Problem) -> dict[str, str]:
        return {row.algorithm: str(row.acceptance) for row in route(problem, ["cvxpy"])}

    x, u = Variable("x", 2), Variable("u", 4)
    disc = SmoothConstraint("at most", lambda z: (np.array([z @ z - 1.0]), 2.0 * z[None, :]))
    bowl = minimize(Smooth(lambda z: float(z @ z), lambda z: 2.0 * z)(x))
    curved = reasons(Problem("disc", bowl, x @ free(), constraints={"disc": (x, disc)}))
    assert "curved constraint 'disc'" in curved["OSQP"]
    assert "Smooth(x) has no `lower`" in curved["nlp-UNO"]
    net = reasons(Problem("en", maximize(QuadraticForm(np.ones((4, 4)))(u)), u @ ElasticNet()))
    assert net["CLARABEL"] == "via surface to body"
    assert "linear constraints only, and ElasticNet(mix=0.8) is curved" in net["PIQP"]
    assert (
        "a problem that maximizes"
        in reasons(Problem("least", minimize(QuadraticForm(np.ones((4, 4)))(u)), u @ Sphere()))["CLARABEL"]
    )
    assert "1005 unknowns, at most 1000" in reasons(game(1005))["nlp-UNO"]
    whole = reasons(Problem("b", maximize(Linear(np.ones(2))(x)), x @ binary(2)))
    assert "2 entries are integral" in whole["OSQP"]
    assert whole["HIGHS"] == "native"
    assert set(curved) == set(BACKEND.algorithms)


def test_a_variable_in_no_term_stays_where_its_set_begins() -> None:
    u, v = Variable("u", 3), Variable("v", 2)
    problem = Problem("unused", minimize(Linear(np.arange(3.0))(u)), u @ Simplex(), v @ free())
    answer = solve(problem, "cvxpy:CLARABEL")
    assert answer.status is Status.STATIONARY
    assert answer["v"].tolist() == [0.0, 0.0]


def test_a_body_is_no_way_round_named_constraints() -> None:
    u = Variable("u", 2)
    apart = QuadraticForm(np.array([[0.0, 1.0], [1.0, 0.0]]))
    few = {"few": (u, SmoothConstraint("at most", lambda x: (x - np.array([0.1, 0.2]), np.eye(2)), linear=True))}
    problem = Problem("game", maximize(apart(u)), u @ Simplex(), constraints=few)
    assert "named constraints" in str(ToBody().obstacle(problem))
