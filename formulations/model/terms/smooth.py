"""Any smooth function as a term: the escape hatch for a formula that is not a term yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, Curvature
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Smooth(Applicable):
    """Evaluate a user's function of one array from its value and its gradient.

    Parameters
    ----------
    function
        Takes the variable's array, returns a number.
    gradient
        Takes the variable's array, returns an array of the same shape.
    curvature
        Declare it where you know it.

    Examples
    --------
    >>> square = Smooth(lambda x: float(x @ x), lambda x: 2 * x)
    >>> square.value_and_gradient(np.array([1.0, 2.0]))
    (5.0, array([2., 4.]))
    """

    function: Callable[[FloatArray], float]
    gradient: Callable[[FloatArray], FloatArray]
    curvature: Curvature = Curvature.UNKNOWN

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the value and the gradient."""
        return float(self.function(x[0])), np.asarray(self.gradient(x[0]), dtype=float)

    @classmethod
    def from_jax(cls, value_and_grad: Callable[[Any], tuple[Any, Any]]) -> Smooth:
        """Wrap `jax.value_and_grad(f)`; enable 64-bit floats in JAX first, or gradients carry seven digits only."""
        return cls(
            lambda x: float(value_and_grad(x)[0]),
            lambda x: np.asarray(value_and_grad(x)[1], dtype=float),
        )

    @classmethod
    def from_casadi(cls, function: Any) -> Smooth:
        """Wrap a `casadi.Function` of one dense input and one scalar output; casadi derives the gradient.

        Numbers cross at every call: expect 20 to 70 times the time of numpy for dense matrices.
        """
        source, target = function.name_in(0), function.name_out(0)
        slope = function.factory(f"{function.name()}_gradient", [source], [f"grad:{target}:{source}"])
        return cls(
            lambda x: float(function(x)),
            lambda x: np.asarray(slope(x), dtype=float).reshape(x.shape),
        )

    @classmethod
    def from_cvxpy(cls, expression: Any, variable: Any) -> Smooth:
        """Wrap a scalar CVXPY expression of one variable; CVXPY derives the gradient."""

        def value(x: FloatArray) -> float:
            variable.value = x
            return float(expression.value)

        def gradient(x: FloatArray) -> FloatArray:
            variable.value = x
            slope = expression.grad[variable]
            dense = slope.toarray() if hasattr(slope, "toarray") else slope
            return np.asarray(dense, dtype=float).reshape(x.shape, order="F")

        return cls(value, gradient)
