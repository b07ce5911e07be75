"""From matrices with orthonormal columns to their convex hull, a cone of matrices, for solvers of convex programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model import Curvature, Membership, Problem, SmoothConstraint
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.bridges.body import replace_memberships
from nonrigid.solvers.judge import Values, restore


@dataclass(frozen=True)
class SpectralBall:
    """Hold (k, r) matrices with no singular value above 1: the convex hull of those with orthonormal columns.

    Examples
    --------
    >>> SpectralBall().restore(np.diag([2.0, 0.5]))
    array([[1. , 0. ],
           [0. , 0.5]])
    """

    convex: bool = True

    def violation(self, x: FloatArray) -> float:
        """Return by how much the largest singular value exceeds 1."""
        return max(float(np.linalg.norm(x, 2)) - 1.0, 0.0)

    def project(self, x: FloatArray) -> FloatArray:
        """Return the nearest matrix of the ball: singular values above 1 become 1."""
        left, values, right = np.linalg.svd(x, full_matrices=False)
        return x.copy() if values[0] <= 1.0 else np.asarray((left * np.minimum(values, 1.0)) @ right)

    restore = project

    def linear_max(self, slope: FloatArray) -> FloatArray:
        """Return the matrix with the largest inner product with another: its polar factor."""
        return Stiefel().linear_max(slope)

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return -1 <= C <= 1."""
        return -np.ones(shape), np.ones(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return that the largest singular value is at most 1; its slope is one of several where some are equal."""

        def value_and_jacobian(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            left, values, right = np.linalg.svd(x, full_matrices=False)
            return values[:1] - 1.0, np.outer(left[:, 0], right[0]).reshape(1, -1)

        return (SmoothConstraint("at most", value_and_jacobian),)

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return 0."""
        return np.zeros(shape)

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a matrix of normal entries with its singular values cut at 1."""
        return self.project(rng.standard_normal(shape))

    def lower(self, x: Any, ops: Any) -> list[Any]:
        """Write the bound on the largest singular value, an operation that CVXPY alone offers."""
        return [ops.at_most(ops.largest_singular_value(x), 1.0)]

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        return rf"\|{name}\|_2 \le 1"

    def __str__(self) -> str:
        return "SpectralBall()"


@dataclass(frozen=True)
class ToSpectralBall:
    """Replace C'C = I by its convex hull, the matrices C without a singular value above 1.

    A relaxation: the ball holds more points. For the linear objectives that it takes it is tight: a linear function is
    largest over the hull at an extreme point, which has orthonormal columns. The way back takes the polar factor.

    Examples
    --------
    >>> ToSpectralBall().claim.value
    'relaxation'

    Source: Journee, Nesterov, Richtarik and Sepulchre, generalized power method (JMLR 2010): the hull of the Stiefel
    manifold.
    """

    name: str = "spectral ball"
    claim: Claim = Claim.RELAXATION

    def obstacle(self, problem: Problem) -> str | None:
        """Return why the hull cannot stand for the set."""
        if not any(isinstance(member.set, Stiefel) for member in problem.memberships):
            return "a matrix with orthonormal columns"
        if problem.curvature is not Curvature.AFFINE:
            return f"a linear objective, which {problem.name!r} does not declare"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem on the hull."""
        memberships = tuple(
            Membership(m.variable, SpectralBall() if isinstance(m.set, Stiefel) else m.set) for m in problem.memberships
        )

        def inverse(values: Values) -> Values:
            return restore(problem, values)

        return Rewritten(replace_memberships(problem, memberships), lambda values: values, inverse)
