"""A payoff matrix as the dynamics need it: by columns, by sparse products, with the work counted."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg.blas import daxpy

from nonrigid.formulations.model import Sense
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame

_DENSE_SHARE = 0.3  # above this share of columns one product with the whole matrix is faster than gathering rows


class Payoff:
    """Serve A, symmetric, dense or sparse; a column is a contiguous row.

    Examples
    --------
    >>> payoff = Payoff(np.array([[0.0, 2.0], [2.0, 0.0]]))
    >>> payoff.product(np.array([0.0, 1.0]))
    (array([2., 0.]), 2)
    """

    def __init__(self, matrix: Any) -> None:
        self.is_sparse = bool(sparse.issparse(matrix))
        if self.is_sparse:
            self.matrix = matrix if matrix.has_sorted_indices else matrix.sorted_indices()
        else:
            self.matrix = matrix.T if matrix.flags.f_contiguous else np.ascontiguousarray(matrix)
        self.size = int(matrix.shape[0])
        self.diagonal: FloatArray = np.asarray(matrix.diagonal(), dtype=float)

    def add_column(self, g: FloatArray, index: int, factor: float) -> None:
        """Add factor * A[:, index] to g in place."""
        if self.is_sparse:
            begin, end = self.matrix.indptr[index], self.matrix.indptr[index + 1]
            g[self.matrix.indices[begin:end]] += factor * self.matrix.data[begin:end]
        else:
            daxpy(self.matrix[index], g, a=factor)

    def entry(self, row: int, column: int) -> float:
        """Return A[row, column]."""
        return float(self.matrix[row, column])

    def product(self, x: FloatArray) -> tuple[FloatArray, int]:
        """Return Ax and the number of columns it took: those where x is not 0."""
        support = np.flatnonzero(x)
        if len(support) > _DENSE_SHARE * self.size:
            return np.asarray(self.matrix @ x), self.size
        if self.is_sparse:
            return np.asarray(self.matrix[support].T @ x[support]), len(support)
        return np.asarray(x[support] @ self.matrix[support]), len(support)


class Ascent:
    """Hold what every dynamic shares: the payoff, the way of counting, watching and stopping.

    A dynamic hands each iterate x, on the surface, with its mean payoff x'Ax to `spend`; every sixteenth of an
    evaluation the iterate is shown to the oracle and the work is charged, in this order, so that a limit loses nothing.
    """

    def __init__(self, game: QuadraticGame, oracle: Oracle, limits: Limits) -> None:
        self.payoff = Payoff(game.matrix)
        self.size, self.weight, self.surface = game.size, game.weight, game.surface
        self._oracle = oracle
        self._tolerance = max(0.1 * limits.tolerance, 1e-13)
        objective = oracle.problem.objective
        self._sign = 1.0 if objective.sense is Sense.MAXIMIZE else -1.0
        self._constant = objective.constant
        self._pending = 0
        self._batch = max(1, self.size // 16)

    def begin(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the start brought onto the surface, and Ax; the center where nothing played meets a payoff."""
        x = self.surface.restore(start)
        g = self.product(x)
        if float(x @ g) <= 0.0 < self.payoff.matrix.max():
            self.show(x, float(x @ g))
            x = self.surface.center(x.shape)
            g = self.product(x)
        self.show(x, float(x @ g))
        return x, g

    def product(self, x: FloatArray) -> FloatArray:
        """Return Ax, charged."""
        g, columns = self.payoff.product(x)
        self._oracle.charge(columns / self.size)
        return g

    def show(self, x: FloatArray, mean: float) -> None:
        """Show the oracle an iterate on the surface with its mean payoff x'Ax."""
        self._oracle.observe(x, objective=self._constant + self._sign * self.weight * mean)

    def spend(self, columns: int, x: FloatArray, mean: float) -> bool:
        """Count columns used on the way to x; return whether x was shown."""
        self._pending += columns
        if self._pending < self._batch:
            return False
        level = float(self.surface.gauge_and_gradient(x)[0])
        self.show(x / level, mean / level**2)
        pending, self._pending = self._pending, 0
        self._oracle.charge(pending / self.size)
        return True

    def met(self, excess: float, mean: float) -> bool:
        """Return whether a gap of 2 * excess in x'Ax is a tenth of the tolerance."""
        value = abs(self._constant + self._sign * self.weight * mean)
        return 2.0 * self.weight * excess <= self._tolerance * max(1.0, value)
