"""The linear form c'x."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, Curvature, ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Linear(Applicable):
    """Evaluate f(x) = c'x for a vector x, or the sum of c_ij x_ij for a matrix.

    Parameters
    ----------
    coefficients
        (n,) or (k, n), finite; their unit is that of the objective.

    Raises
    ------
    ModelError
        If the coefficients are not a finite vector or matrix.

    Examples
    --------
    >>> Linear(np.array([1.0, -2.0])).value_and_gradient(np.array([3.0, 1.0]))
    (1.0, array([ 1., -2.]))
    """

    coefficients: FloatArray
    monotone: bool
    curvature: Curvature = Curvature.AFFINE
    degree: int = 1

    def __init__(self, coefficients: FloatArray) -> None:
        vector = np.array(coefficients, dtype=float)
        if vector.ndim not in (1, 2) or not np.isfinite(vector).all():
            raise ModelError(
                f"the coefficients of a linear form have shape {vector.shape}; give a finite vector or matrix"
            )
        object.__setattr__(self, "coefficients", vector)
        object.__setattr__(self, "monotone", bool(vector.min(initial=0.0) >= 0.0))

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return c'x and c."""
        return float(np.vdot(self.coefficients, x[0])), self.coefficients.copy()

    def hessian(self, x: FloatArray) -> FloatArray:
        """Return the zero matrix."""
        return np.zeros((x.size, x.size))

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return zeros."""
        return np.zeros_like(x)

    def column(self, index: int) -> FloatArray:
        """Return a column of the zero matrix."""
        return np.zeros(self.coefficients.size)

    def lower(self, x: Any, ops: Any) -> Any:
        """Write c'x in the operations of a symbolic backend."""
        if self.coefficients.ndim == 1:
            return ops.sum(ops.matmul(self.coefficients[None, :], x))
        return ops.sum(ops.multiply(self.coefficients, x))

    def latex(self, names: Sequence[str]) -> str:
        """Return c'x as LaTeX."""
        return rf"\langle c, {names[0]} \rangle" if self.coefficients.ndim > 1 else rf"c^\top {names[0]}"
