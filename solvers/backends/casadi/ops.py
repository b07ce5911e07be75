"""The operations of a lowering in CasADi expressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np
from scipy import sparse

from nonrigid.formulations.model import Variable


@dataclass(frozen=True, eq=False)
class Relation:
    """Hold an expression that is to be 0, or at most 0, in every entry."""

    expression: Any
    kind: Literal["equal", "at most"]


class CasadiOps:
    """Write lowerings as CasADi expressions.

    Examples
    --------
    >>> x = ca.MX.sym("x", 2)
    >>> float(ca.Function("f", [x], [CasadiOps().quadratic(np.eye(2), x)])([1.0, 2.0]))
    5.0
    """

    def sum(self, value: Any) -> Any:
        """Return the sum of all entries."""
        return ca.sum1(ca.sum2(value))

    def sum_squares(self, value: Any) -> Any:
        """Return the sum of the squares of all entries."""
        return ca.sumsqr(value)

    def quadratic(self, matrix: Any, value: Any) -> Any:
        """Return x'Ax."""
        return ca.bilin(as_dm(matrix), value, value)

    def matmul(self, matrix: Any, value: Any) -> Any:
        """Return A x."""
        return as_dm(matrix) @ value

    def multiply(self, matrix: Any, value: Any) -> Any:
        """Return the entrywise product with a constant."""
        return as_dm(matrix) * value

    def column_norms(self, value: Any) -> Any:
        """Return the Euclidean norm of each column; its derivative is infinite where a column vanishes."""
        return ca.sqrt(ca.sum1(value * value))

    def equal(self, left: Any, right: Any) -> Relation:
        """State left = right."""
        return Relation(left - right, "equal")

    def at_most(self, left: Any, right: Any) -> Relation:
        """State left <= right."""
        return Relation(left - right, "at most")


def as_dm(matrix: Any) -> Any:
    """Return a numpy or scipy matrix as a sparse CasADi matrix."""
    return ca.DM(sparse.csc_matrix(matrix))


def shaped(flat: Any, variable: Variable) -> Any:
    """Return a piece of the flat vector in the variable's shape; numpy counts by rows, CasADi by columns."""
    if len(variable.shape) == 1:
        return flat
    rows = variable.shape[0]
    return ca.reshape(flat, int(np.prod(variable.shape[1:])), rows).T


def is_bound(relation: Relation, x: Any) -> bool:
    """Whether a relation only bounds single entries, which the bounds of the set say already."""
    jacobian = ca.jacobian(relation.expression, x)
    if ca.depends_on(jacobian, x):
        return False
    return bool((np.bincount(jacobian.sparsity().row(), minlength=jacobian.shape[0]) == 1).all())
