"""The sum of squares, each entry with its own weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, Curvature, ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class WeightedSquares(Applicable):
    """Evaluate f(C) = ||C o W||_F^2, the sum of the squares of C_ij W_ij.

    Parameters
    ----------
    mask
        W, of the variable's shape, finite.

    Raises
    ------
    ModelError
        If the mask is not finite.

    Examples
    --------
    >>> WeightedSquares(np.array([[1.0, 2.0]])).value_and_gradient(np.array([[3.0, 1.0]]))
    (13.0, array([[6., 8.]]))
    """

    mask: FloatArray
    curvature: Curvature = Curvature.CONVEX
    degree: int = 2

    def __post_init__(self) -> None:
        if not np.isfinite(self.mask).all():
            raise ModelError("the mask has entries that are not finite")

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the weighted sum of squares and its gradient."""
        masked = x[0] * self.mask
        return float(np.sum(masked * masked)), 2.0 * masked * self.mask

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the constant diagonal Hessian times a direction."""
        return 2.0 * self.mask**2 * direction

    def lower(self, x: Any, ops: Any) -> Any:
        """Write the sum in the operations of a symbolic backend."""
        return ops.sum_squares(ops.multiply(self.mask, x))

    def latex(self, names: Sequence[str]) -> str:
        """Return the sum as LaTeX."""
        return rf"\|{names[0]} \circ W\|_F^2"

    @staticmethod
    def examples() -> list[tuple[Any, tuple[int, int]]]:
        """Return instances for the conformance kit."""
        return [(WeightedSquares(np.array([[0.0, 1.0, 2.0], [1.0, 0.5, 3.0]])), (2, 3))]
