"""CasADi's solvers: known optima, honest statuses, limits kept, exceptions carried, integer rewriting exact."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import pytest

from nonrigid.formulations.model import (
    Applicable,
    Box,
    ElasticNet,
    ModelError,
    Problem,
    QuadraticForm,
    Simplex,
    Smooth,
    SmoothConstraint,
    Variable,
    free,
    maximize,
    minimize,
)
from nonrigid.formulations.model.binary_sets import MixedBinary, binary, integral_entries
from nonrigid.formulations.model.ops import NumpyOps
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Refused, Via
from nonrigid.solvers.backends.casadi import BACKEND, Casadi
from nonrigid.solvers.bridges.kkt_mixed_integer import KktMixedInteger
from nonrigid.solvers.judge import violation
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

SMOOTH = [name for name in BACKEND.algorithms if name != "bonmin"]
FIRST_ORDER = [name for name in SMOOTH if name not in ("ipopt-hessian", "uno")]


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


def game(n: int, seed: int = 0) -> Problem:
    u = Variable("u", n)
    return Problem("game", maximize(QuadraticForm(payoff(n, seed))(u)), u @ Simplex())


def rosenbrock() -> Smooth:
    def value(x: FloatArray) -> float:
        return float(100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2)

    def gradient(x: FloatArray) -> FloatArray:
        inner = x[1] - x[0] ** 2
        return np.array([-400.0 * x[0] * inner - 2.0 * (1.0 - x[0]), 200.0 * inner])

    return Smooth(value, gradient)


def pressed(n: int) -> tuple[Problem, FloatArray]:
    """Minimize |D x|^2 on the simplex: x_i proportional to 1 / d_i^2."""
    weights = np.arange(1.0, n + 1.0)
    x = Variable("x", n)
    return Problem("pressed", minimize(QuadraticForm(np.diag(weights))(x)), x @ Simplex()), (1 / weights) / np.sum(
        1 / weights
    )


@pytest.fixture(scope="module")
def best() -> float:
    return solve(game(30), "casadi:ipopt", starts=30, seed=3).objective


@pytest.mark.parametrize("algorithm", SMOOTH)
def test_planted_game_is_stationary_and_reaches_the_best_known_from_several_starts(algorithm: str, best: float) -> None:
    answer = solve(game(30), f"casadi:{algorithm}", starts=8, limits=Limits(seconds=20))
    assert answer.status is Status.STATIONARY
    assert answer.violation <= 1e-12
    assert answer.objective >= best - 1e-5


@pytest.mark.parametrize("algorithm", [*BACKEND.algorithms[:4], "uno"])
def test_known_optimum_of_a_convex_quadratic(algorithm: str) -> None:
    problem, expected = pressed(6)
    answer = solve(problem, f"casadi:{algorithm}")
    assert answer.status is Status.STATIONARY
    assert np.abs(answer["x"] - expected).max() < 1e-5


@pytest.mark.parametrize("algorithm", FIRST_ORDER)
def test_box_and_curved_named_constraint(algorithm: str) -> None:
    x = Variable("x", 2)
    inside = solve(Problem("valley", minimize(rosenbrock()(x)), x @ Box(-2.0, 2.0)), f"casadi:{algorithm}")
    assert np.abs(inside["x"] - 1.0).max() < 1e-3
    disc = SmoothConstraint("at most", lambda z: (np.array([z @ z - 1.0]), 2.0 * z[None, :]))
    on_disc = Problem("disc", minimize(rosenbrock()(x)), x @ Box(-2.0, 2.0), constraints={"disc": (x, disc)})
    answer = solve(on_disc, f"casadi:{algorithm}")
    assert answer.violation <= 1e-7
    assert abs(answer.objective - 0.0456748) < 1e-4  # value of the literature for the unit disc


@pytest.mark.parametrize("algorithm", ["ipopt", "ipopt-hessian", "sqpmethod", "uno"])
def test_elastic_net_surface(algorithm: str) -> None:
    u = Variable("u", 30)
    problem = Problem("en", maximize(QuadraticForm(payoff(30))(u)), u @ ElasticNet())
    answer = solve(problem, f"casadi:{algorithm}")
    assert answer.status is Status.STATIONARY
    assert answer.stationarity < 1e-6


def test_named_linear_constraint_binds() -> None:
    problem, _ = pressed(4)
    (x,) = problem.variables
    cap = SmoothConstraint("at most", lambda z: (z[:1] - 0.25, np.eye(4)[:1]), linear=True)
    capped = Problem("capped", problem.objective, x @ Simplex(), constraints={"cap": (x, cap)})
    rest = (1 / np.array([2.0, 3.0, 4.0])) * 0.75 / np.sum(1 / np.array([2.0, 3.0, 4.0]))
    for algorithm in ("ipopt", "ipopt-hessian", "sqpmethod", "uno"):
        answer = solve(capped, f"casadi:{algorithm}")
        assert np.abs(answer["x"] - np.r_[0.25, rest]).max() < 1e-5, algorithm


@dataclass(frozen=True)
class Fit(Applicable):
    """|diag(v) C - T|^2 in a matrix and a vector."""

    target: tuple[tuple[float, ...], ...] = ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0))

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, tuple[FloatArray, FloatArray]]:
        C, v = x
        E = v[:, None] * C - np.array(self.target)
        return float((E**2).sum()), (2 * E * v[:, None], (2 * E * C).sum(axis=1))


def test_two_variables_one_of_them_a_matrix() -> None:
    C, v = Variable("C", (2, 3)), Variable("v", 2)
    ridge = Smooth(lambda c: float((c**2).sum()), lambda c: 2.0 * c)
    answer = solve(Problem("fit", minimize(Fit()(C, v) + ridge(C)), C @ free(), v @ Box(0.5, 2.0)), "casadi:ipopt")
    # At v = 2 each entry of C is 2 T / 5, the objective |T|^2 / 5.
    assert answer.objective == pytest.approx(11.0, abs=1e-8)
    assert np.allclose(answer["C"], 0.4 * np.array(Fit().target), atol=1e-6)


class Slow(QuadraticForm):
    """A quadratic form that takes its time."""

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        time.sleep(0.02)
        return super().value_and_gradient(*x)


@pytest.mark.parametrize("algorithm", ["ipopt", "ipopt-hessian", "sqpmethod", "uno"])
def test_seconds_are_kept(algorithm: str) -> None:
    u = Variable("u", 30)
    answer = solve(
        Problem("slow", maximize(Slow(payoff(30))(u)), u @ Simplex()),
        f"casadi:{algorithm}",
        limits=Limits(seconds=0.1, tolerance=1e-13),
    )
    assert answer.status is Status.LIMIT or answer.stationarity < 1e-12
    assert answer.solve_seconds < 1.6
    assert answer["u"].sum() == pytest.approx(1.0)


@pytest.mark.parametrize("algorithm", ["ipopt", "sqpmethod", "sqpmethod-daqp"])
def test_evaluations_are_kept_and_the_best_point_returned(algorithm: str) -> None:
    answer = solve(game(30), f"casadi:{algorithm}", limits=Limits(evaluations=4))
    assert answer.status is Status.LIMIT
    assert answer.evaluations <= 4
    assert np.isfinite(answer.objective)


@pytest.mark.parametrize("algorithm", FIRST_ORDER)
def test_a_value_that_is_not_finite_is_a_numerical_error(algorithm: str, capfd: pytest.CaptureFixture[str]) -> None:
    x = Variable("x", 2)
    cliff = Smooth(lambda z: float(z @ z) if z[0] > 0.9 else float("nan"), lambda z: 2.0 * z)
    answer = solve(
        Problem("cliff", minimize(cliff(x)), x @ Box(0.0, 2.0)), f"casadi:{algorithm}", start={"x": np.ones(2)}
    )
    assert answer.status is Status.NUMERICAL_ERROR
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("algorithm", ["ipopt", "sqpmethod"])
def test_an_exception_in_a_term_is_a_backend_error_in_its_own_words(algorithm: str) -> None:
    def broken(z: FloatArray) -> float:
        raise ZeroDivisionError("the user's own mistake")

    x = Variable("x", 2)
    problem = Problem("broken", minimize(Smooth(broken, lambda z: z)(x)), x @ Box(0.0, 2.0))
    answer = solve(problem, f"casadi:{algorithm}")
    assert answer.status is Status.BACKEND_ERROR
    assert "the user's own mistake" in answer.raw_status


def test_refusals_give_the_number_or_the_term_that_decides() -> None:
    big, x = game(1005), Variable("x", 2)
    reasons = {row.algorithm: str(row.acceptance) for row in route(big, ["casadi"])}
    assert reasons["ipopt"] == "native"
    assert "1005 unknowns, at most 1000" in reasons["ipopt-hessian"]
    assert "1005 unknowns, at most 500" in reasons["sqpmethod"]
    assert "at most 80 strategies, each a binary entry, and this game has 1005" in reasons["bonmin"]
    valley = Problem("valley", minimize(rosenbrock()(x)), x @ Box(-2.0, 2.0))
    assert "Hessian of every term, and Smooth(x)" in str(Casadi("uno").accepts(valley))
    choice = Problem("choice", maximize(Linear(np.ones(2))(x)), x @ binary(2))
    refused = Casadi("ipopt").accepts(choice)
    assert isinstance(refused, Refused)
    assert "2 entries are integral" in refused.reason


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_branch_and_bound_is_at_least_as_good_as_many_starts(seed: int, capfd: pytest.CaptureFixture[str]) -> None:
    problem = game(10, seed)
    exact = solve(problem, "casadi:bonmin", limits=Limits(seconds=30))
    many = solve(problem, "casadi:ipopt", starts=40, seed=1)
    every = max(one.objective for one in many.attempts)
    assert exact.route == ("KKT mixed-integer", "casadi:bonmin")
    assert exact.status is Status.STATIONARY
    assert exact.objective >= every - 1e-6
    assert capfd.readouterr() == ("", "")


def test_branch_and_bound_solves_a_knapsack() -> None:
    y = Variable("y", 4)
    weight, worth = np.array([2.0, 1.0, 1.5, 0.7]), np.array([3.0, 2.0, 2.5, 1.0])
    load = SmoothConstraint("at most", lambda z: (np.array([weight @ z - 3.0]), weight[None, :]), linear=True)
    answer = solve(
        Problem("knapsack", maximize(Linear(worth)(y)), y @ binary(4), constraints={"load": (y, load)}), "casadi"
    )
    assert answer.algorithm == "bonmin"
    assert answer["y"].tolist() in ([1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0])
    assert answer.objective == pytest.approx(5.0)


def test_kkt_points_of_the_game_are_feasible_in_the_integer_problem_with_equal_objective() -> None:
    problem = game(15)
    local = solve(problem, "casadi:ipopt", limits=Limits(tolerance=1e-9))
    u = np.where(local["u"] > 1e-7, local["u"], 0.0)
    u /= u.sum()
    assert isinstance(Casadi("bonmin").accepts(problem), Via)
    rewritten = KktMixedInteger().apply(problem)
    forward = rewritten.forward({"u": u})
    assert violation(rewritten.problem, forward) < 1e-6
    assert rewritten.problem.objective.value(forward) == pytest.approx(problem.objective.value({"u": u}), abs=1e-12)
    assert np.array_equal(rewritten.inverse(forward)["u"], u)
    raised = Problem("raised", replace(problem.objective, constant=5.0), *problem.memberships)
    value = KktMixedInteger().apply(raised).problem.objective.value(forward)
    assert value == pytest.approx(raised.objective.value({"u": u}), abs=1e-12)


def test_mixed_binary_set_and_linear_term_keep_their_promises() -> None:
    rng = np.random.default_rng(0)
    mixed = MixedBinary(integral=np.array([True, False, True]), upper=np.array([1.0, 4.0, 1.0]))
    x = rng.normal(size=3)
    assert mixed.violation(mixed.restore(x)) == 0.0
    assert mixed.violation(mixed.sample((3,), rng)) == 0.0
    assert mixed.violation(mixed.center((3,))) == 0.0
    g = rng.normal(size=3)
    assert g @ mixed.linear_max(g) >= g @ mixed.sample((3,), rng)
    assert integral_entries(mixed, (3,)).tolist() == [True, False, True]
    assert integral_entries(Simplex(), (2,)).tolist() == [False, False]
    assert "of 3 integral" in str(mixed)
    assert "[0, b]" in mixed.latex("k")
    with pytest.raises(ModelError, match="positive, and 1 where integral"):
        MixedBinary(integral=np.array([True]), upper=np.array([2.0]))
    with pytest.raises(ModelError, match="equally long"):
        MixedBinary(integral=np.array([True]), upper=np.ones(2))
    term = Linear(g)
    assert term.lower(x, NumpyOps()) == pytest.approx(term.value_and_gradient(x)[0])
    assert not term.hessian(x).any()
    assert not term.hessian_product(x, x).any()
    assert not term.column(0).any()
    assert term.latex(["x"]) == r"c^\top x"
    with pytest.raises(ModelError, match="finite vector"):
        Linear(np.ones((2, 2, 2)))
