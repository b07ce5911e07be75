"""The sum of the lengths of residual columns: a data term that a few wrong descriptors cannot spoil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, Curvature
from nonrigid.formulations.model.terms.residual import check_residual, lowered_residual
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class GroupNorm21(Applicable):
    """Evaluate f(C) = ||C A - B||_{2,1}, the sum over columns of the Euclidean norm of each column.

    Where a column vanishes the subgradient 0 is returned for it.

    Parameters
    ----------
    source
        A, (k, q) finite: one column a descriptor.
    target
        B, (m, q) finite, in the unit of the objective.

    Raises
    ------
    ModelError
        If the matrices are not finite or their numbers of columns differ.

    Examples
    --------
    >>> term = GroupNorm21(np.eye(2), np.array([[3.0, 0.0], [4.0, 1.0]]))
    >>> term.value_and_gradient(np.zeros((2, 2)))
    (6.0, array([[-0.6,  0. ],
           [-0.8, -1. ]]))
    """

    source: FloatArray
    target: FloatArray
    curvature: Curvature = Curvature.CONVEX

    def __post_init__(self) -> None:
        check_residual(self.source, self.target)

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the sum of the column norms and its gradient, (m, k)."""
        value, unit = column_norms(x[0] @ self.source - self.target)
        return value, unit @ self.source.T

    def lower(self, x: Any, ops: Any) -> Any:
        """Write the norm in the operations of a symbolic backend."""
        return ops.sum(ops.column_norms(lowered_residual(self.source, self.target, x, ops)))

    def latex(self, names: Sequence[str]) -> str:
        """Return the norm as LaTeX."""
        return rf"\|{names[0]} A - B\|_{{2,1}}"

    @staticmethod
    def examples() -> list[tuple[Any, tuple[int, int]]]:
        """Return instances for the conformance kit."""
        rng = np.random.default_rng(0)
        return [(GroupNorm21(rng.standard_normal((3, 5)), rng.standard_normal((4, 5))), (4, 3))]


def column_norms(residual: FloatArray) -> tuple[float, FloatArray]:
    """Return the sum of the column norms, in double precision, and the columns divided by their norms (0 by 0 is 0).

    Examples
    --------
    >>> column_norms(np.array([[3.0, 0.0], [4.0, 0.0]]))
    (5.0, array([[0.6, 0. ],
           [0.8, 0. ]]))
    """
    lengths = np.sqrt(np.einsum("ij,ij->j", residual, residual))
    inverse = np.divide(1.0, lengths, out=np.zeros_like(lengths), where=lengths > 1e-30)
    return float(lengths.sum(dtype=float)), residual * inverse
