"""The few operations in which a term or set may write its formula once for every symbolic backend."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from nonrigid.geometry.arrays import FloatArray


class Ops(Protocol):
    """Offer the operations that CVXPY, CasADi and numpy each provide.

    `value` is an expression of the backend; matrices are numpy arrays or scipy sparse arrays. A comparison returns
    whatever the backend calls a constraint.
    """

    def sum(self, value: Any) -> Any:
        """Return the sum of all entries."""

    def sum_squares(self, value: Any) -> Any:
        """Return the sum of the squares of all entries."""

    def quadratic(self, matrix: Any, value: Any) -> Any:
        """Return x'Ax for a constant symmetric A, of any curvature."""

    def matmul(self, matrix: Any, value: Any) -> Any:
        """Return A x for a constant A."""

    def multiply(self, matrix: Any, value: Any) -> Any:
        """Return the entrywise product with a constant of the same shape."""

    def column_norms(self, value: Any) -> Any:
        """Return the Euclidean norm of each column."""

    def equal(self, left: Any, right: Any) -> Any:
        """State left = right."""

    def at_most(self, left: Any, right: Any) -> Any:
        """State left <= right."""


class NumpyOps:
    """Evaluate a lowering with numpy: constraints become their residuals (0 where satisfied).

    Examples
    --------
    >>> NumpyOps().quadratic(np.eye(2), np.array([1.0, 2.0]))
    5.0
    """

    def sum(self, value: FloatArray) -> float:
        """Return the sum of all entries."""
        return float(np.sum(value))

    def sum_squares(self, value: FloatArray) -> float:
        """Return the sum of the squares of all entries."""
        return float(np.sum(np.square(value)))

    def quadratic(self, matrix: Any, value: FloatArray) -> float:
        """Return x'Ax."""
        return float(value @ (matrix @ value))

    def matmul(self, matrix: Any, value: FloatArray) -> FloatArray:
        """Return A x."""
        return np.asarray(matrix @ value)

    def multiply(self, matrix: Any, value: FloatArray) -> FloatArray:
        """Return the entrywise product."""
        return np.asarray(matrix * value)

    def column_norms(self, value: FloatArray) -> FloatArray:
        """Return the Euclidean norm of each column."""
        return np.asarray(np.linalg.norm(value, axis=0))

    def equal(self, left: Any, right: Any) -> FloatArray:
        """Return |left - right|."""
        return np.asarray(np.abs(np.asarray(left) - right))

    def at_most(self, left: Any, right: Any) -> FloatArray:
        """Return max(left - right, 0)."""
        return np.asarray(np.maximum(np.asarray(left) - right, 0.0))
