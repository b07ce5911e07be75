"""Limited-memory BFGS and reweighted least squares: exact on known answers, monotone, honest about what they take."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.formulations.model import Box, ModelError, Problem, Smooth, Variable, free, maximize, minimize
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Refused
from nonrigid.solvers.backends.native import BACKEND, Native
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def valley(n: int, box: Box) -> Problem:
    """Rosenbrock's valley in n unknowns."""
    x = Variable("x", n)
    return Problem("valley", minimize(Smooth(scipy.optimize.rosen, scipy.optimize.rosen_der)(x)), x @ box)


def regression(weight: float = 0.5, outliers: int = 6) -> tuple[Problem, FloatArray]:
    """A planted matrix seen through columns of which some are wrong."""
    rng = np.random.default_rng(3)
    truth, source = rng.standard_normal((6, 5)), rng.standard_normal((5, 40))
    target = truth @ source + 1e-3 * rng.standard_normal((6, 40))
    target[:, :outliers] += 5.0 * rng.standard_normal((6, outliers))
    C = Variable("C", (6, 5))
    mask = 0.05 * rng.random((6, 5))
    energy = 2.0 * GroupNorm21(source, target)(C) + weight * WeightedSquares(mask)(C)
    return Problem("regression", minimize(energy), C @ free()), truth


@pytest.mark.parametrize("n", [2, 10, 40])
def test_the_valley_is_followed_to_its_end(n: int) -> None:
    answer = solve(valley(n, Box()), "native:limited_memory", start={"x": np.tile([-1.2, 1.0], n // 2)})
    assert answer.status is Status.STATIONARY
    assert np.abs(answer["x"] - 1.0).max() < 1e-6 or answer.objective < 4.0  # the second, local minimum for n >= 4
    assert answer.evaluations < 40 + 12 * n


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_bounds_are_kept_and_the_answer_is_that_of_another_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((8, 8))
    A, b = root @ root.T + 0.1 * np.eye(8), 3.0 * rng.standard_normal(8)
    x = Variable("x", 8)
    bowl = Smooth(lambda p: float(0.5 * p @ A @ p - b @ p), lambda p: A @ p - b)
    problem = Problem("bowl", minimize(bowl(x)), x @ Box(-0.5, 0.7))
    answer = solve(problem, "native:limited_memory")
    other = solve(problem, "scipy:L-BFGS-B")
    assert answer.status is Status.STATIONARY
    assert answer.violation == 0.0
    assert answer.objective == pytest.approx(other.objective, abs=1e-9)


def test_the_objective_never_rises_and_limits_hold() -> None:
    answer = solve(valley(20, Box()), start={"x": np.full(20, 3.0)}, limits=Limits(evaluations=50))
    assert (answer.algorithm, answer.status, answer.evaluations) == ("limited_memory", Status.LIMIT, 50)
    steps = [point.objective for point in answer.trace]
    assert steps[-1] < 1e-2 * steps[0]


def test_a_maximum_is_found_by_the_same_method() -> None:
    x = Variable("x", 3)
    hill = Smooth(lambda p: float(-np.sum((p - 2.0) ** 4)), lambda p: -4.0 * (p - 2.0) ** 3)
    answer = solve(Problem("hill", maximize(hill(x)), x @ Box(upper=1.5)))
    assert answer["x"] == pytest.approx(np.full(3, 1.5))


def test_reweighting_agrees_with_descent_and_ignores_outliers() -> None:
    problem, truth = regression(weight=1e-6)
    fast, slow = solve(problem), solve(problem, "native:limited_memory")
    assert (fast.algorithm, fast.status) == ("reweighted", Status.STATIONARY)
    assert fast.objective == pytest.approx(slow.objective, rel=1e-8)
    assert np.abs(fast["C"] - truth).max() < 2e-3
    values = [point.objective for point in fast.trace]
    assert all(after <= before for before, after in pairwise(values))


def test_the_conic_backend_certifies_the_reweighted_answer() -> None:
    problem, _ = regression(weight=0.5)
    assert solve(problem, "cvxpy:CLARABEL").objective == pytest.approx(solve(problem).objective, rel=1e-6)


def test_each_algorithm_says_what_it_needs() -> None:
    problem, _ = regression()
    assert Native.default_algorithm(problem) == "reweighted"
    C = problem.variables[0]
    curved = minimize(GroupNorm21(np.eye(5), np.eye(6)[:, :5])(C) + GramPenalty(np.ones(5))(C))
    whole = Problem("whole", curved, C @ free())
    assert Native.default_algorithm(whole) == "limited_memory"
    for wrong, word in (
        (whole, "GramPenalty"),
        (Problem("boxed", problem.objective, C @ Box(-1.0, 1.0)), "Box"),
        (Problem("up", maximize(GroupNorm21(np.eye(5), np.eye(6)[:, :5])(C)), C @ free()), "minimized"),
    ):
        refusal = BACKEND("reweighted").accepts(wrong)
        assert isinstance(refusal, Refused)
        assert word in refusal.reason


def test_a_problem_may_bring_its_start_and_ask_for_few_evaluations() -> None:
    x = Variable("x", 2)
    objective = valley(2, Box()).objective
    asked = Problem("short", objective, x @ free(), start={"x": np.array([-1.2, 1.0])}, evaluations=7)
    answer = solve(asked, limits=Limits(evaluations=100))
    assert answer.evaluations == 7
    assert answer.trace[0].objective == pytest.approx(24.2)
    assert solve(asked, limits=Limits(evaluations=3)).evaluations == 3
    assert solve(asked, start={"x": np.array([1.0, 1.0])}).objective == 0.0
    renamed = asked.stage("other", start={"x": np.zeros(2)})
    assert (renamed.name, renamed.evaluations, renamed.start["x"].tolist()) == ("other", None, [0.0, 0.0])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"start": {"y": np.zeros(2)}}, "starts at 'y'"),
        ({"start": {"x": np.zeros(3)}}, r"of shape \(3,\)"),
        ({"start": {"x": np.array([0.0, np.nan])}}, "finite"),
        ({"evaluations": 0}, "asks for 0 evaluations"),
    ],
)
def test_a_wrong_start_is_refused_in_words(arguments: dict[str, object], words: str) -> None:
    x = Variable("x", 2)
    with pytest.raises(ModelError, match=words):
        Problem("wrong", valley(2, Box()).objective, x @ free(), **arguments)  # type: ignore[arg-type]


def test_a_path_bent_onto_a_bound_is_not_followed_for_ever() -> None:
    Q = np.array([[0.2, -0.7], [-0.7, 2.2]])
    x = Variable("x", 2)
    term = Smooth(lambda at: float(at @ Q @ at), lambda at: 2.0 * Q @ at)
    problem = Problem("saddle", minimize(term(x)), x @ Box(-1.0, 2.0), start={"x": np.array([0.93, 0.38])})
    answer = solve(problem, "native:limited_memory", limits=Limits(evaluations=1000))
    assert answer.status is Status.STATIONARY
    assert answer.objective == pytest.approx(-0.2 / 2.2, abs=1e-6)


def test_robust_regression_with_too_few_descriptors_takes_the_least_map() -> None:
    rng = np.random.default_rng(0)
    A, B = rng.standard_normal((6, 3)), rng.standard_normal((4, 3))
    C = Variable("C", (4, 6))
    answer = solve(Problem("few", minimize(GroupNorm21(A, B)(C)), C @ free()), "native:reweighted")
    assert answer.objective == pytest.approx(0.0, abs=1e-5)
