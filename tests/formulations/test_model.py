"""The modelling language: printing, LaTeX, fixing variables, and refusing what is stated wrongly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse

from nonrigid.formulations.model import (
    Applicable,
    Body,
    Box,
    Curvature,
    ElasticNet,
    ModelError,
    Problem,
    QuadraticForm,
    Set,
    Simplex,
    Smooth,
    SmoothConstraint,
    Sphere,
    Sum,
    Term,
    Variable,
    free,
    maximize,
    minimize,
    nonnegative,
)
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation, cheapest_assignment
from nonrigid.formulations.model.ops import NumpyOps
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.geometry.arrays import FloatArray

C, v = Variable("C", (2, 3)), Variable("v", 3)
W = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 3.0]])
F = np.array([1.0, -1.0])


class Fit(Applicable):
    """|C v - f|^2: one term of two variables, convex in each but not in both."""

    curvature = Curvature.INDEFINITE

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, tuple[FloatArray, FloatArray]]:
        matrix, vector = x
        rest = matrix @ vector - F
        return float(rest @ rest), (2.0 * np.outer(rest, vector), 2.0 * matrix.T @ rest)


class Product(Applicable):
    """x'y, with its own way of fixing an argument."""

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, tuple[FloatArray, FloatArray]]:
        return float(x[0] @ x[1]), (x[1], x[0])

    def fix(self, given: tuple[FloatArray | None, ...]) -> Any:
        (constant,) = [value for value in given if value is not None]
        return Smooth(lambda x: float(constant @ x), lambda x: constant, Curvature.AFFINE)

    def latex(self, names: list[str]) -> str:
        return rf"{names[0]}^\top {names[1]}"


SQUARES = Smooth(lambda x: float((x**2).sum()), lambda x: 2.0 * x, Curvature.CONVEX)
JOINT = Problem("joint", minimize(Fit()(C, v) + 0.5 * SQUARES(C) + SQUARES(v)), C @ free(), v @ Box(-1.0, 2.0))


def test_a_problem_prints_as_it_was_stated() -> None:
    assert str(JOINT) == (
        "joint: minimize Fit(C, v) + 0.5 * Smooth(C) + Smooth(v)\n"
        "  subject to C in Box(-inf, inf), v in Box(-1, 2)\n"
        "  with C of shape (2, 3), v of shape (3,)"
    )
    ring = SmoothConstraint("equal", lambda x: (np.array([x @ x - 1.0]), 2.0 * x[None, :]))
    named = Problem("named", maximize(SQUARES(v)), v @ nonnegative(), constraints={"on the ring": (v, ring)})
    assert "and on the ring" in str(named)
    assert named.latex() == r"\max_{v}\; \mathrm{Smooth}(v) \quad\text{s.t.}\quad 0 \le v,\ \text{on the ring}"


def test_latex_shows_weights_names_and_sets() -> None:
    assert JOINT.latex() == (
        r"\min_{C, v}\; \mathrm{Fit}(C, v) + 0.5\, \mathrm{Smooth}(C) + \mathrm{Smooth}(v)"
        r" \quad\text{s.t.}\quad -1 \le v \le 2"
    )
    u = Variable("u", 3)
    assert Problem("p", minimize(SQUARES(u)), u @ free()).latex() == r"\min_{u}\; \mathrm{Smooth}(u)"
    assert ElasticNet(mix=0.8).latex("u") == r"u \ge 0,\ 0.2\,1^\top u + 0.8\,\|u\|^2 = 1"
    assert Body(Simplex()).latex("u") == r"u \ge 0,\ 1^\top u \le 1"
    assert [str(s) for s in (Simplex(), Sphere(), ElasticNet(mix=0.5), Body(Simplex()))] == [
        "Simplex()",
        "Sphere(nonnegative)",
        "ElasticNet(mix=0.5)",
        "Body(Simplex())",
    ]
    assert Product()(v, u).latex() == r"v^\top u"


def test_sums_and_weights_are_linear() -> None:
    values = {"C": W, "v": np.array([1.0, 2.0, -1.0])}
    fit, squares = Fit()(C, v), SQUARES(C)
    total = 2.0 * (fit + squares * 3.0 + Sum((SQUARES(v),)))
    assert [term.weight for term in total.terms] == [2.0, 6.0, 2.0]
    objective = minimize(total)
    value, gradient = objective.value_and_gradient(values)
    assert objective.value(values) == value
    parts = [(2.0, fit), (6.0, squares), (2.0, SQUARES(v))]
    assert value == pytest.approx(sum(weight * term.value_and_gradient(values)[0] for weight, term in parts))
    expected = 2.0 * fit.value_and_gradient(values)[1]["C"] + 6.0 * 2.0 * W
    np.testing.assert_allclose(gradient["C"], expected)
    assert (fit * -1.0).curvature is Curvature.INDEFINITE
    assert (squares * -1.0).curvature is Curvature.CONCAVE


def test_a_term_applied_twice_to_a_variable_has_both_parts_in_its_gradient() -> None:
    x = np.array([1.0, 2.0, 3.0])
    value, gradient = Product()(v, v).value_and_gradient({"v": x})
    assert value == 14.0
    np.testing.assert_array_equal(gradient["v"], 2.0 * x)


@pytest.mark.parametrize("name", ["C", "v"])
def test_fixing_a_variable_leaves_the_joint_objective_in_the_other(name: str) -> None:
    values = {"C": W, "v": np.array([0.5, 1.0, -0.5])}
    fixed = JOINT.fix(**{name: values[name]})
    (other,) = fixed.variables
    assert other.name == ({"C", "v"} - {name}).pop()
    rest = {other.name: values[other.name]}
    value, gradient = fixed.objective.value_and_gradient(rest)
    joint, parts = JOINT.objective.value_and_gradient(values)
    assert value == pytest.approx(joint, rel=1e-12)
    np.testing.assert_allclose(gradient[other.name], parts[other.name])
    assert fixed.curvature is Curvature.UNKNOWN  # convex in each, but the joint declaration does not say so


def test_a_term_may_fix_its_arguments_itself() -> None:
    u, given = Variable("u", 3), np.array([1.0, 0.0, 2.0])
    fixed = Problem("bilinear", maximize(Product()(u, v) + SQUARES(u)), u @ Simplex(), v @ Simplex()).fix(u=given)
    assert fixed.objective.constant == 5.0
    assert str(fixed.objective.terms[0]) == "Smooth(v)"
    assert fixed.curvature is Curvature.AFFINE
    assert fixed.objective.value({"v": np.ones(3) / 3}) == pytest.approx(6.0)


def test_constraints_on_a_fixed_variable_go_and_others_stay() -> None:
    ring = SmoothConstraint("at most", lambda x: (np.array([x @ x - 1.0]), 2.0 * x[None, :]))
    u = Variable("u", 3)
    both = Problem(
        "both", minimize(Product()(u, v)), u @ free(), v @ free(), constraints={"u": (u, ring), "v": (v, ring)}
    )
    assert list(both.fix(u=np.ones(3)).constraints) == ["v"]
    assert ring.violation(np.zeros(3)) == 0.0
    assert ring.violation(np.ones(3)) == 2.0


@pytest.mark.parametrize(
    ("kinds", "sense", "expected"),
    [
        ([Curvature.CONVEX, Curvature.AFFINE], minimize, Curvature.CONVEX),
        ([Curvature.CONVEX], maximize, Curvature.CONCAVE),
        ([Curvature.CONVEX, Curvature.CONCAVE], minimize, Curvature.UNKNOWN),
        ([Curvature.AFFINE], maximize, Curvature.AFFINE),
        ([Curvature.INDEFINITE], minimize, Curvature.INDEFINITE),
    ],
)
def test_the_curvature_of_a_problem_follows_from_its_terms(kinds: Any, sense: Any, expected: Curvature) -> None:
    terms = tuple(Smooth(lambda x: 0.0, np.zeros_like, kind)(v) for kind in kinds)
    assert Problem("p", sense(Sum(terms)), v @ free()).curvature is expected


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: Problem("p", minimize(SQUARES(v))), "puts them in no set; add `v @ free"),
        (lambda: Problem("p", minimize(SQUARES(v)), v @ free(), v @ Simplex()), "puts a variable into two sets"),
        (lambda: JOINT.fix(w=np.ones(3)), "has no variable 'w'; it has"),
        (lambda: JOINT.fix(C=W, v=np.ones(3)), "leaves nothing to solve"),
        (lambda: JOINT.fix(v=np.ones(4)), r"fixed at an array of shape \(4,\); it has \(3,\)"),
        (lambda: Box(1.0, 0.0), "lower <= upper, got 1.0 and 0.0"),
        (lambda: Box(float("nan"), 0.0), "lower <= upper"),
        (lambda: ElasticNet(mix=1.5), "mix is 1.5"),
        (lambda: Simplex(mix=0.5), "a simplex has mix = 0"),
        (lambda: Sphere(mix=0.5), "a sphere has mix = 1"),
        (lambda: QuadraticForm(np.ones((2, 3))), r"shape \(2, 3\); it must be square"),
        (lambda: QuadraticForm(np.array([[0.0, 1.0], [0.0, 0.0]])), r"differ by up to 1; use \(A \+ A.T\) / 2"),
        (lambda: QuadraticForm(np.array([[np.nan]])), "not finite"),
        (lambda: QuadraticForm(sparse.csr_array([[np.inf]])), "not finite"),
    ],
)
def test_a_wrong_statement_is_refused_in_words(wrong: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        wrong()


def test_protocols_hold() -> None:
    assert isinstance(Fit(), Term)
    assert all(isinstance(s, Set) for s in (Simplex(), Box(), Body(Simplex())))
    assert Variable("x", (2, 3)).size == 6
    assert Variable("x", 4).shape == (4,)


def test_adapters_take_functions_of_other_libraries() -> None:
    import casadi
    import cvxpy

    x = casadi.SX.sym("x", 3)
    point = np.array([0.3, -1.2, 2.0])
    expected, slope = float(np.sum(np.sin(point) ** 2)), np.sin(2 * point)
    y = cvxpy.Variable(3)
    jax_like = Smooth.from_jax(lambda z: (np.sum(np.sin(z) ** 2), np.sin(2 * z)))
    for term in (Smooth.from_casadi(casadi.Function("f", [x], [casadi.sumsqr(casadi.sin(x))])), jax_like):
        value, gradient = term.value_and_gradient(point)
        assert value == pytest.approx(expected, rel=1e-12)
        np.testing.assert_allclose(gradient, slope, rtol=1e-12)
    value, gradient = Smooth.from_cvxpy(cvxpy.sum_squares(y), y).value_and_gradient(point)
    assert value == pytest.approx(float(point @ point))
    np.testing.assert_allclose(gradient, 2 * point)


def test_numpy_operations_are_the_plain_ones() -> None:
    ops, x = NumpyOps(), np.array([1.0, -2.0])
    assert (ops.sum(x), ops.sum_squares(x)) == (-1.0, 5.0)
    np.testing.assert_array_equal(ops.matmul(np.ones((2, 2)), x), [-1.0, -1.0])
    np.testing.assert_array_equal(ops.equal(x, 1.0), [0.0, 3.0])
    np.testing.assert_array_equal(ops.at_most(x, -1.0), [2.0, 0.0])


def test_an_assignment_is_restored_near_where_it_was() -> None:
    rng = np.random.default_rng(0)
    for shape in ((3, 3), (3, 5), (10, 10), (40, 41)):
        near = Assignment().sample(shape, rng) + 1e-8 * rng.standard_normal(shape)
        found = Assignment().restore(near)
        assert Assignment().violation(found) <= 1e-12
        assert np.abs(found - near).max() <= 1e-6
    np.testing.assert_allclose(Assignment().restore(np.eye(3) + 1e-10 * np.eye(3, k=1)), np.eye(3), atol=1e-9)


def test_costs_that_are_not_finite_are_refused_and_such_points_restored() -> None:
    with pytest.raises(ModelError, match="a cost of an assignment is not finite"):
        cheapest_assignment(np.array([[np.inf, 1.0], [1.0, 2.0]]))
    found = PartialPermutation().restore(np.array([[np.nan, 1.0], [np.inf, -np.inf]]))
    assert found.tolist() == [[0.0, 1.0], [1.0, 0.0]]


def test_a_point_far_outside_is_projected_onto_the_simplex() -> None:
    assert Simplex().project(np.array([1e17, 0.0])).tolist() == [1.0, 0.0]


def test_a_printed_problem_is_the_problem() -> None:
    C = Variable("C", (2, 2))
    w = Variable("w", 2)
    pair = Problem(
        "pair",
        minimize(0.5 * GramPenalty(np.ones(2), 0.3)(C) + -2.0 * SQUARES(w)),
        C @ free(),
        w @ free(),
        constraints={"area_at_least": (w, SmoothConstraint("at most", lambda x: (-x, -np.eye(2)), linear=True))},
    )
    text = pair.latex()
    assert r"0.5\, \left(" in text
    assert "+ -" not in text + str(pair)
    assert r"\text{area\_at\_least}" in text
    fixed = pair.fix(C=np.ones((2, 2)))
    assert f"{fixed.objective.constant:g}" in str(fixed)
    with pytest.raises(ModelError, match=r"has 'w' of shape \(3,\) in a term or constraint, \(2,\) in its set"):
        Problem("p", minimize(SQUARES(Variable("w", 3))), w @ free())
