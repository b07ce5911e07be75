"""How far the columns of a matrix are from being orthonormal, or orthonormal up to some that vanish."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class GramPenalty(Applicable):
    """Evaluate f(C) = sum over i != j of G_ij^2 + w sum over i of (G_ii - d_i)^2 for the Gram matrix G = C'C.

    Parameters
    ----------
    squared_lengths
        d, (k,): wanted squared lengths of the columns; 1 for the first r and 0 for the others asks for a partial
        isometry of rank r.
    diagonal_weight
        w, how much a squared length counts beside an inner product.

    Raises
    ------
    ModelError
        If d is not a finite vector or w is negative.

    Examples
    --------
    >>> GramPenalty(np.array([1.0, 0.0])).value_and_gradient(np.array([[1.0, 0.0], [0.0, 1.0]]))
    (1.0, array([[0., 0.],
           [0., 4.]]))
    """

    squared_lengths: FloatArray
    diagonal_weight: float = 1.0

    def __post_init__(self) -> None:
        if self.squared_lengths.ndim != 1 or not np.isfinite(self.squared_lengths).all():
            raise ModelError(f"squared lengths of shape {self.squared_lengths.shape}; give a finite vector")
        if not self.diagonal_weight >= 0.0:
            raise ModelError(f"the diagonal weight is {self.diagonal_weight}; give a number that is not negative")

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the penalty and its gradient 4 C E, where E is G with w (G_ii - d_i) on its diagonal."""
        gram = x[0].T @ x[0]
        gap = gram.diagonal() - self.squared_lengths
        np.fill_diagonal(gram, 0.0)
        value = float(np.sum(gram * gram) + self.diagonal_weight * (gap @ gap))
        np.fill_diagonal(gram, self.diagonal_weight * gap)
        return value, 4.0 * x[0] @ gram

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the Hessian at x times a direction."""
        gram, change = x.T @ x, x.T @ direction
        change = change + change.T
        np.fill_diagonal(gram, self.diagonal_weight * (gram.diagonal() - self.squared_lengths))
        np.fill_diagonal(change, self.diagonal_weight * change.diagonal())
        return np.asarray(4.0 * (direction @ gram + x @ change))

    def latex(self, names: Sequence[str]) -> str:
        """Return the penalty as LaTeX."""
        gram = rf"({names[0]}^\top {names[0]})"
        weight = "" if self.diagonal_weight == 1.0 else rf"{self.diagonal_weight:g} "
        return rf"\sum_{{i \ne j}} {gram}_{{ij}}^2 + {weight}\sum_i ({gram}_{{ii}} - d_i)^2"

    @staticmethod
    def examples() -> list[tuple[Any, tuple[int, int]]]:
        """Return instances for the conformance kit."""
        d = np.array([1.0, 1.0, 0.0])
        return [(GramPenalty(d), (4, 3)), (GramPenalty(d, diagonal_weight=0.3), (3, 3))]
