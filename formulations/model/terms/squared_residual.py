"""The sum of squared residuals of a linear regression in a matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, Curvature
from nonrigid.formulations.model.terms.residual import check_residual, lowered_residual
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SquaredResidual(Applicable):
    """Evaluate f(C) = ||C A - B||_F^2.

    Parameters
    ----------
    source
        A, (r, q) finite: one column an observation.
    target
        B, (k, q) finite, in the square root of the objective's unit.

    Raises
    ------
    ModelError
        If the matrices are not finite or their numbers of columns differ.

    Examples
    --------
    >>> term = SquaredResidual(np.eye(2), np.array([[3.0, 0.0], [4.0, 1.0]]))
    >>> term.value_and_gradient(np.zeros((2, 2)))
    (26.0, array([[-6.,  0.],
           [-8., -2.]]))
    """

    source: FloatArray
    target: FloatArray
    curvature: Curvature = Curvature.CONVEX

    def __post_init__(self) -> None:
        check_residual(self.source, self.target)

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the sum of squares and its gradient, (k, r)."""
        residual = x[0] @ self.source - self.target
        return float(np.sum(residual * residual)), 2.0 * residual @ self.source.T

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the constant Hessian times a direction: 2 D A A'."""
        return np.asarray(2.0 * (direction @ self.source) @ self.source.T)

    def lower(self, x: Any, ops: Any) -> Any:
        """Write the sum in the operations of a symbolic backend."""
        return ops.sum_squares(lowered_residual(self.source, self.target, x, ops))

    def latex(self, names: Sequence[str]) -> str:
        """Return the sum as LaTeX."""
        return rf"\|{names[0]} A - B\|_F^2"

    @staticmethod
    def examples() -> list[tuple[Any, tuple[int, int]]]:
        """Return instances for the conformance kit."""
        rng = np.random.default_rng(0)
        return [(SquaredResidual(rng.standard_normal((3, 5)), rng.standard_normal((4, 5))), (4, 3))]
