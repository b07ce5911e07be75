"""Small problems whose optimum is proved: what every backend is tried on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import combinations, permutations
from typing import Any

import numpy as np

from nonrigid.formulations.isometric import distance_ratios
from nonrigid.formulations.model import (
    Applicable,
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
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.model.terms.area_gap import AreaGap
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.terms.masked_data import MaskedBasis, MaskedTarget
from nonrigid.formulations.model.terms.membership import membership
from nonrigid.formulations.model.terms.mumford_shah import MumfordShah
from nonrigid.formulations.model.terms.squared_residual import SquaredResidual
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.testing.sets import HalfSquaredDistance


@dataclass(frozen=True, eq=False, kw_only=True)
class Instance:
    """Hold a problem, its proved optimum, a point that attains it, and the proof's name.

    `unimodal` says that every stationary point reachable from the interior is optimal, so that a backend which accepts
    the problem has no excuse for another answer.
    """

    problem: Problem
    optimum: float
    values: Mapping[str, FloatArray]
    certificate: str
    unimodal: bool = True


@cache
def instances() -> tuple[Instance, ...]:
    """Return all instances."""
    return tuple(make() for make in _MAKERS)


def planted_payoff(count: int = 10, *, rng_seed: int = 0, sharpness: float = 200.0) -> FloatArray:
    """Return a payoff exp(-sharpness eps^2) of a planted partial matching, (count, count), with conflicts zeroed.

    Half of the candidates are right: points of a unit square seen twice with noise; the others match at random. eps is
    the difference of two candidates' distances on either side; candidates that share a point conflict.

    Examples
    --------
    >>> A = planted_payoff(10)
    >>> bool((A == A.T).all() and (np.diag(A) == 0).all())
    True
    """
    rng = np.random.default_rng(rng_seed)
    points = rng.random((count, 2))
    seen = points + 0.01 * rng.standard_normal(points.shape)
    left = np.concatenate([np.arange(count - count // 2), rng.integers(0, count, count // 2)])
    right = np.concatenate([np.arange(count - count // 2), rng.integers(0, count, count // 2)])
    far = np.linalg.norm(points[left][:, None] - points[left][None], axis=2)
    apart = np.linalg.norm(seen[right][:, None] - seen[right][None], axis=2)
    payoff = np.exp(-sharpness * (far - apart) ** 2)
    payoff[(left[:, None] == left) | (right[:, None] == right)] = 0.0
    return np.asarray(payoff)


def planted_game(count: int = 10, *, rng_seed: int = 0) -> Instance:
    """Return max u'Au on the simplex for a planted payoff, proved by trying every support.

    Some optimum has a support S on which the equations A u = value, 1'u = 1 have one solution (along a null direction
    the objective is constant, so the support could shrink); all 2^n - 1 supports are tried.

    Examples
    --------
    >>> planted_game().certificate
    'all 1023 supports'
    """
    payoff = planted_payoff(count, rng_seed=rng_seed)
    best, point = 0.0, np.eye(count)[0]
    for size in range(2, count + 1):
        for support in combinations(range(count), size):
            system = np.block([[payoff[np.ix_(support, support)], -np.ones((size, 1))], [np.ones((1, size)), 0.0]])
            if abs(np.linalg.det(system)) < 1e-10:
                continue
            played = np.linalg.solve(system, np.eye(size + 1)[-1])
            if played[:-1].min() > 0.0 and played[-1] > best:
                best, point = float(played[-1]), np.zeros(count)
                point[list(support)] = played[:-1]
    u = Variable("u", count)
    problem = Problem("planted game", maximize(QuadraticForm(payoff)(u)), u @ Simplex())
    return Instance(
        problem=problem,
        optimum=best,
        values={"u": point},
        certificate=f"all {2**count - 1} supports",
        unimodal=False,
    )


def convex_quadratic() -> Instance:
    """Return min sum d_i x_i^2 on the simplex: x_i = (1/d_i) / sum 1/d, objective 1 / sum 1/d."""
    d = np.array([1.0, 2.0, 3.0, 5.0, 8.0, 13.0])
    x = Variable("x", d.size)
    form = QuadraticForm(np.diag(d), curvature=Curvature.CONVEX)
    optimum = 1.0 / float(np.sum(1.0 / d))
    return Instance(
        problem=Problem("convex quadratic", minimize(form(x)), x @ Simplex()),
        optimum=optimum,
        values={"x": optimum / d},
        certificate="closed form, convex",
    )


def rosenbrock() -> Instance:
    """Return Rosenbrock's valley in a box whose bound x <= 0.8 is active: f >= (1 - x)^2, attained at y = x^2."""

    def value(x: FloatArray) -> float:
        return float(100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2)

    def gradient(x: FloatArray) -> FloatArray:
        inner = x[1] - x[0] ** 2
        return np.array([-400.0 * x[0] * inner - 2.0 * (1.0 - x[0]), 200.0 * inner])

    x = Variable("x", 2)
    return Instance(
        problem=Problem("rosenbrock", minimize(Smooth(value, gradient)(x)), x @ Box(-1.5, 0.8)),
        optimum=0.2**2,
        values={"x": np.array([0.8, 0.64])},
        certificate="closed form: a sum of squares, each at its least",
    )


def elastic_net() -> Instance:
    """Return max (a'u)^2 on the elastic net, mix = 0.8, by the inequality of Cauchy and Schwarz.

    With b = 1 - mix the surface is a sphere about -b/(2 mix) 1 of radius R, R^2 = (1 + n b^2/(4 mix)) / mix.
    """
    a, mix = 1.0 + np.linspace(0.0, 0.5, 10), 0.8
    b = 1.0 - mix
    radius = np.sqrt((1.0 + a.size * b**2 / (4.0 * mix)) / mix)
    u = Variable("u", a.size)
    point = radius * a / np.linalg.norm(a) - b / (2.0 * mix)
    problem = Problem("elastic net", maximize(QuadraticForm(np.outer(a, a))(u)), u @ ElasticNet(mix=mix))
    return Instance(problem=problem, optimum=float(a @ point) ** 2, values={"u": point}, certificate="Cauchy-Schwarz")


def spectral() -> Instance:
    """Return max u'Au on the nonnegative sphere for A > 0: the largest eigenvalue, by Perron and Frobenius."""
    payoff = planted_payoff(10) + 0.05
    eigenvalues, vectors = np.linalg.eigh(payoff)
    u = Variable("u", len(payoff))
    problem = Problem("spectral", maximize(QuadraticForm(payoff)(u)), u @ Sphere())
    values = {"u": np.abs(vectors[:, -1])}
    return Instance(problem=problem, optimum=float(eigenvalues[-1]), values=values, certificate="largest eigenvalue")


def ball() -> Instance:
    """Return min |x - t|^2 / 2 with the named constraint x'x <= 1: x = t/|t|."""
    target = np.array([2.0, -1.0, 2.0])
    inside = SmoothConstraint("at most", lambda x: (np.array([x @ x - 1.0]), 2.0 * x[None, :]))
    x = Variable("x", 3)
    problem = Problem(
        "ball", minimize(HalfSquaredDistance(target)(x)), x @ Box(-5.0, 5.0), constraints={"in the ball": (x, inside)}
    )
    return Instance(problem=problem, optimum=2.0, values={"x": target / 3.0}, certificate="closed form, convex")


def two_variables() -> Instance:
    """Return min |x - y|^2 with x on the simplex and 1 <= y <= 2: x = 1/n, y = 1."""
    count = 3
    x, y = Variable("x", count), Variable("y", count)
    problem = Problem("two variables", minimize(SquaredGap()(x, y)), x @ Simplex(), y @ Box(1.0, 2.0))
    values = {"x": np.full(count, 1.0 / count), "y": np.ones(count)}
    return Instance(
        problem=problem, optimum=(count - 1.0) ** 2 / count, values=values, certificate="closed form, convex"
    )


def injective_map() -> Instance:
    """Return the least triple distortion from 3 points of a plane to 5, proved by trying all 60 maps."""
    rng = np.random.default_rng(1)
    target = rng.random((5, 2))
    source = 1.3 * target[:3] + 0.05 * rng.standard_normal((3, 2))
    part, full = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (source, target))
    term, shape = TripleDistortion(distance_ratios(part, full, "logarithmic")), (3, 5)
    maps = [np.eye(5)[list(columns)] for columns in permutations(range(5), 3)]
    best = min(maps, key=lambda chosen: term.value_and_gradient(chosen)[0])
    P = Variable("P", shape)
    start = {"P": np.full(shape, 0.2)}
    return Instance(
        problem=Problem("injective map", minimize(term(P)), P @ PartialPermutation(), start=start),
        optimum=term.value_and_gradient(best)[0],
        values={"P": best},
        certificate="all 60 maps",
        unimodal=False,
    )


def transport() -> Instance:
    """Return a linear assignment of 3 rows to 4 columns, proved by the prices (0, -1, 0, 0) of the columns."""
    cost = np.array([[2.0, 0.0, 3.0, 4.0], [5.0, 1.0, 3.0, 4.0], [5.0, 4.0, 6.0, 3.0]])
    X = Variable("X", (3, 4))
    values = {"X": np.eye(4)[[0, 1, 3]]}
    problem = Problem("transport", minimize(Linear(cost)(X)), X @ Assignment())
    return Instance(problem=problem, optimum=6.0, values=values, certificate="column prices")


def functional_map(*, orthogonality_weight: float = 0.05) -> Instance:
    """Return a step of partial functional maps in C, each of whose terms is at its least at one signed diagonal map.

    Descriptors come in threes that share a and whose targets lie about C a at angles of 120 degrees and distance h: the
    sum of their residual lengths is least, 3 h, where the residuals' directions cancel. The mask is 0 on the diagonal,
    and C'C = diag(d). Without the penalty of the Gram matrix the problem is convex.
    """
    rng = np.random.default_rng(3)
    size, rank, height, weight = 4, 3, 0.4, 0.2
    C = np.diag([1.0, -1.0, 1.0, 0.0])
    sources, targets = [], []
    for a in 0.5 * rng.standard_normal((6, size)):
        plane = np.linalg.qr(rng.standard_normal((size, 2)))[0]
        for angle in 2.0 * np.pi * np.arange(3) / 3.0:
            sources.append(a)
            targets.append(C @ a - height * (plane @ [np.cos(angle), np.sin(angle)]))
    A, B = np.array(sources).T, np.array(targets).T
    unknown = Variable("C", (size, size))
    energy = weight * GroupNorm21(A, B)(unknown) + 0.1 * WeightedSquares(1.0 - np.eye(size))(unknown)
    if orthogonality_weight:
        energy = energy + orthogonality_weight * GramPenalty((np.arange(size) < rank).astype(float))(unknown)
    return Instance(
        problem=Problem(
            "functional map" if orthogonality_weight else "robust regression", minimize(energy), unknown @ free()
        ),
        optimum=weight * height * len(sources),
        values={"C": C},
        certificate="each term at its least",
        unimodal=not orthogonality_weight,
    )


def robust_regression() -> Instance:
    """Return the convex part of `functional_map`."""
    return functional_map(orthogonality_weight=0.0)


def region() -> Instance:
    """Return a step of partial functional maps in v, each of whose terms is at its least at one constant field.

    A descriptor lives on three vertices, so that some unit vector w is orthogonal to their basis rows; the target is
    the image of the constant field plus h w. The residual is then nowhere shorter than h, and the field has no edge.
    """
    rng = np.random.default_rng(5)
    side, basis_size, height = 3, 4, 0.3
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    vertices = np.c_[x.ravel(), y.ravel(), 0.1 * x.ravel() * y.ravel()]
    faces = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    n = len(vertices)
    basis, mass = rng.standard_normal((n, basis_size)), rng.uniform(0.5, 1.0, n)
    functions, normals = np.zeros((n, n)), np.zeros((basis_size, n))
    for j in range(n):
        held = (j + np.arange(3)) % n
        functions[held, j] = rng.uniform(0.5, 1.5, 3)
        normals[:, j] = np.linalg.svd(basis[held])[2][-1]
    constant = np.full(n, 0.6)
    whole = MaskedBasis(basis, mass, functions)
    inside = membership(constant)
    v = Variable("v", n)
    energy = (
        MaskedTarget(whole.project(inside) + height * normals, whole)(v)
        + 0.5 * AreaGap(mass, float(mass @ inside))(v)
        + 0.01 * MumfordShah(vertices, faces)(v)
    )
    return Instance(
        problem=Problem("region", minimize(energy), v @ free()),
        optimum=height * n,
        values={"v": constant},
        certificate="each term at its least",
        unimodal=False,
    )


def spectral_low_pass() -> Instance:
    """Return the fit of a functional map to a forest's votes: B = C A + N with N orthogonal to the rows of A.

    Then ||X A - B||^2 = ||(X - C) A||^2 + ||N||^2, least at X = C, alone since A has full row rank.
    """
    rng = np.random.default_rng(4)
    rows = np.linalg.qr(rng.standard_normal((6, 4)))[0].T
    C = rng.standard_normal((3, 2))
    A, N = np.array([[1.0, 0.3], [0.0, 0.8]]) @ rows[:2], 0.5 * rng.standard_normal((3, 2)) @ rows[2:]
    unknown = Variable("C", C.shape)
    return Instance(
        problem=Problem("low-pass", minimize(SquaredResidual(A, C @ A + N)(unknown)), unknown @ free()),
        optimum=float(np.sum(N * N)),
        values={"C": C},
        certificate="residual orthogonal to the data",
    )


def orthogonal_fit() -> Instance:
    """Return max <K, C> over C'C = I: at most the sum of K's singular values, attained at its polar factor.

    K = U S V' with known factors; <K, C> = <S, U'C V>, and no entry of U'C V exceeds 1.
    """
    rng = np.random.default_rng(6)
    left, right = np.linalg.qr(rng.standard_normal((5, 3)))[0], np.linalg.qr(rng.standard_normal((3, 3)))[0]
    values = np.array([2.0, 1.0, 0.5])
    unknown = Variable("C", (5, 3))
    return Instance(
        problem=Problem("orthogonal fit", maximize(Linear((left * values) @ right.T)(unknown)), unknown @ Stiefel()),
        optimum=float(values.sum()),
        values={"C": left @ right.T},
        certificate="sum of singular values",
    )


class SquaredGap(Applicable):
    """Evaluate |x - y|^2 in two arguments."""

    curvature = Curvature.CONVEX
    degree = 2

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, tuple[FloatArray, FloatArray]]:
        """Return the value and its two gradients."""
        apart = x[0] - x[1]
        return float(np.sum(apart * apart)), (2.0 * apart, -2.0 * apart)

    def lower(self, x: Any, y: Any, ops: Any) -> Any:
        """Write the gap in the operations of a symbolic backend."""
        return ops.sum_squares(x - y)


_MAKERS: tuple[Callable[[], Instance], ...] = (
    planted_game,
    convex_quadratic,
    rosenbrock,
    elastic_net,
    spectral,
    ball,
    two_variables,
    injective_map,
    transport,
    spectral_low_pass,
    orthogonal_fit,
    robust_regression,
    functional_map,
    region,
)
