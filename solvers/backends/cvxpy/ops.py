"""The operations of a lowering in CVXPY expressions."""

from __future__ import annotations

from typing import Any

import cvxpy

cp: Any = cvxpy  # its types are incomplete


class CvxpyOps:
    """Write lowerings as CVXPY expressions; CVXPY itself then checks what is convex.

    Examples
    --------
    >>> import numpy as np
    >>> x = cvxpy.Variable(2)
    >>> CvxpyOps().quadratic(np.eye(2), x).is_convex(), CvxpyOps().quadratic(-np.eye(2), x).is_convex()
    (True, False)
    """

    def sum(self, value: Any) -> Any:
        """Return the sum of all entries."""
        return cp.sum(value)

    def sum_squares(self, value: Any) -> Any:
        """Return the sum of the squares of all entries."""
        return cp.sum_squares(value)

    def quadratic(self, matrix: Any, value: Any) -> Any:
        """Return x'Ax; CVXPY finds its curvature by an eigenvalue."""
        return cp.quad_form(value, matrix)

    def matmul(self, matrix: Any, value: Any) -> Any:
        """Return A x."""
        return matrix @ value

    def multiply(self, matrix: Any, value: Any) -> Any:
        """Return the entrywise product with a constant."""
        return cp.multiply(matrix, value)

    def column_norms(self, value: Any) -> Any:
        """Return the Euclidean norm of each column, one second-order cone each."""
        return cp.norm(value, 2, axis=0)

    def largest_singular_value(self, value: Any) -> Any:
        """Return the largest singular value, a cone of matrices of order rows + columns."""
        return cp.sigma_max(value)

    def equal(self, left: Any, right: Any) -> Any:
        """State left = right."""
        return left == right

    def at_most(self, left: Any, right: Any) -> Any:
        """State left <= right."""
        return left <= right
