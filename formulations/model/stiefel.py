"""The set of matrices with orthonormal columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import ModelError
from nonrigid.geometry.arrays import FloatArray

_ON_IT = 1e-13
"""Entry of C'C - I up to which a matrix counts as orthonormal and is left alone: a little above rounding."""


@dataclass(frozen=True)
class Stiefel:
    r"""Hold (k, r) matrices with orthonormal columns, C'C = I, r <= k: the Stiefel manifold.

    The nearest point to a matrix, and the point with the largest inner product with it, are its polar factor U V' from
    the singular value decomposition U S V'.

    Source: Schoenemann, a generalized solution of the orthogonal Procrustes problem (Psychometrika 1966).

    Examples
    --------
    >>> Stiefel().restore(np.array([[0.0, 2.0], [3.0, 0.0], [0.0, 0.0]]))
    array([[0., 1.],
           [1., 0.],
           [0., 0.]])
    """

    convex: bool = False

    def violation(self, x: FloatArray) -> float:
        """Return the largest entry of |C'C - I|."""
        return float(np.abs(x.T @ x - np.eye(x.shape[1])).max(initial=0.0))

    def project(self, x: FloatArray) -> FloatArray:
        """Return the nearest matrix with orthonormal columns."""
        if np.isfinite(x).all() and self.violation(x) <= _ON_IT:
            return x.copy()
        left, _, right = np.linalg.svd(x, full_matrices=False)
        return np.asarray(left @ right)

    restore = project
    linear_max = project

    def slope_along(self, x: FloatArray, ascent: FloatArray) -> float:
        """Return the largest entry of the ascent along the manifold, G - C sym(C'G), of a point C and ascent G (k, r).

        Source: Edelman, Arias and Smith, the geometry of algorithms with orthogonality constraints (SIMAX 1998).
        """
        inner = x.T @ ascent
        return float(np.abs(ascent - x @ (0.5 * (inner + inner.T))).max(initial=0.0))

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return -1 <= C <= 1."""
        return -np.ones(_checked(shape)), np.ones(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the r (r + 1) / 2 equations of the upper triangle of C'C = I."""
        k, r = _checked(shape)
        first, second = np.triu_indices(r)

        def value_and_jacobian(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            value = np.einsum("ki,ki->i", x[:, first], x[:, second]) - (first == second)
            jacobian = np.zeros((len(first), k, r))
            row = np.arange(len(first))
            jacobian[row, :, first] += x[:, second].T
            jacobian[row, :, second] += x[:, first].T
            return value, jacobian.reshape(len(first), -1)

        return (SmoothConstraint("equal", value_and_jacobian),)

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the first columns of the identity, which sends each basis function to its namesake."""
        return np.eye(*_checked(shape))

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a matrix uniform over the set: the polar factor of normal entries."""
        return self.project(rng.standard_normal(_checked(shape)))

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        return rf"{name}^\top {name} = I"

    @staticmethod
    def examples() -> list[tuple[Stiefel, tuple[int, int]]]:
        """Return what the conformance kit tries."""
        return [(Stiefel(), (5, 3)), (Stiefel(), (3, 3)), (Stiefel(), (4, 1))]

    def __str__(self) -> str:
        return "Stiefel()"


def _checked(shape: tuple[int, ...]) -> tuple[int, int]:
    if len(shape) != 2 or shape[0] < shape[1]:
        raise ModelError(f"no matrix of shape {shape} has orthonormal columns; give (k, r) with r <= k, or transpose")
    return shape[0], shape[1]
