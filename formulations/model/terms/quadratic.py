"""The quadratic form x'Ax."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from nonrigid.formulations.model.term import Applicable, Curvature, ModelError
from nonrigid.geometry.arrays import FloatArray

_TILE = 256


@dataclass(frozen=True, eq=False)
class QuadraticForm(Applicable):
    """Evaluate f(x) = x'Ax for a symmetric matrix A, dense or sparse.

    Parameters
    ----------
    matrix
        (n, n) symmetric; its entries carry the unit of the objective.
    curvature
        Declare it where you know it; it is not computed, since that would cost an eigenvalue problem.

    Raises
    ------
    ModelError
        If the matrix is not square, symmetric to 1e-12 of its largest entry, and finite.

    Examples
    --------
    >>> QuadraticForm(np.diag([1.0, 2.0])).value_and_gradient(np.array([1.0, 1.0]))
    (3.0, array([2., 4.]))
    """

    matrix: Any
    curvature: Curvature
    monotone: bool
    degree: int = 2

    def __init__(self, matrix: Any, *, curvature: Curvature = Curvature.UNKNOWN) -> None:
        array = _as_matrix(matrix)
        if array.ndim != 2 or array.shape[0] != array.shape[1]:
            raise ModelError(f"the matrix of a quadratic form has shape {array.shape}; it must be square")
        entries = array.data if _is_sparse(array) else array
        low, high = float(entries.min(initial=0.0)), float(entries.max(initial=0.0))
        if not (np.isfinite(low) and np.isfinite(high)):
            raise ModelError("the matrix of a quadratic form has entries that are not finite")
        largest = max(-low, high)
        difference = _asymmetry(array)
        if difference > 1e-12 * max(largest, 1e-300):
            raise ModelError(
                f"the matrix is not symmetric: entries differ by up to {difference:.3g}; use (A + A.T) / 2"
            )
        object.__setattr__(self, "matrix", array)
        object.__setattr__(self, "curvature", curvature)
        object.__setattr__(self, "monotone", low >= 0.0)

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return x'Ax and 2Ax."""
        product = self.matrix @ x[0]
        return float(x[0] @ product), 2.0 * product

    def hessian(self, x: FloatArray) -> FloatArray:
        """Return 2A, dense."""
        return _dense(2.0 * self.matrix)

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return 2A d."""
        return np.asarray(2.0 * (self.matrix @ direction))

    def column(self, index: int) -> FloatArray:
        """Return a column of the Hessian 2A; O(n) for a dense matrix."""
        return _dense(2.0 * self.matrix[[index], :]).ravel()

    def lower(self, x: Any, ops: Any) -> Any:
        """Write x'Ax in the operations of a symbolic backend."""
        return ops.quadratic(self.matrix, x)

    def latex(self, names: Sequence[str]) -> str:
        """Return x'Ax as LaTeX."""
        return rf"{names[0]}^\top A {names[0]}"


def _as_matrix(matrix: Any) -> Any:
    return sparse.csr_array(matrix).astype(float) if _is_sparse(matrix) else np.asarray(matrix, dtype=float)


def _asymmetry(matrix: Any) -> float:
    """Return the largest |a_ij - a_ji|, of a dense matrix tile by tile: a transposed copy would take far longer."""
    if _is_sparse(matrix):
        return float(abs(matrix - matrix.T).max()) if matrix.shape[0] else 0.0
    starts = range(0, len(matrix), _TILE)
    tiles = [(slice(i, i + _TILE), slice(j, j + _TILE)) for i in starts for j in starts if i <= j]
    return max((float(np.abs(matrix[i, j] - matrix[j, i].T).max()) for i, j in tiles), default=0.0)


def _dense(matrix: Any) -> FloatArray:
    return np.asarray(matrix.toarray() if _is_sparse(matrix) else matrix)


def _is_sparse(matrix: Any) -> bool:
    return bool(sparse.issparse(matrix))
