"""How badly a transport plan keeps distances: the Gromov-Wasserstein term."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class GromovWasserstein(Applicable):
    """Evaluate f(T) = sum over i, i', j, j' of (d_ii' - D_jj')^2 T_ij T_i'j'.

    With r = T 1 and c = T'1 it is r'(d o d) r + c'(D o D) c - 2 <d T D, T>, o the entrywise product: two products of
    matrices, and no array with four indices.

    Parameters
    ----------
    part_distances, full_distances
        d, (k, k), and D, (n, n): symmetric, in one unit of length; f is in its square times the unit of T, squared.

    Raises
    ------
    ModelError
        If one is not a finite, symmetric matrix (to 1e-12 of its largest entry).

    Source: Memoli, Gromov-Wasserstein distances and the metric approach to object matching (Foundations of
    Computational Mathematics 2011); the factors, Peyre, Cuturi and Solomon (ICML 2016), proposition 1.

    Examples
    --------
    >>> apart = np.array([[0.0, 1.0], [1.0, 0.0]])
    >>> GromovWasserstein(apart, 3.0 * apart).value_and_gradient(np.eye(2))
    (8.0, array([[ 8., 20.],
           [20.,  8.]]))
    """

    part_distances: FloatArray
    full_distances: FloatArray
    degree: int = 2
    _squares: tuple[FloatArray, FloatArray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name, matrix in (("part", self.part_distances), ("full surface", self.full_distances)):
            square = matrix.ndim == 2 and matrix.shape[0] == matrix.shape[1]
            if not (square and np.isfinite(matrix).all()):
                raise ModelError(f"distances of the {name} have shape {matrix.shape}; give a finite, square matrix")
            off = float(np.abs(matrix - matrix.T).max(initial=0.0))
            if off > 1e-12 * float(np.abs(matrix).max(initial=0.0)):
                raise ModelError(f"distances of the {name} differ from their transpose by {off:.3g}; use (d + d.T) / 2")
        object.__setattr__(self, "_squares", (self.part_distances**2, self.full_distances**2))

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return f and its gradient, which is linear in T, so that f is half their inner product."""
        gradient = self._product(x[0])
        return 0.5 * float(np.vdot(gradient, x[0])), gradient

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the Hessian, which is constant, times a direction."""
        return self._product(direction)

    def latex(self, names: Sequence[str]) -> str:
        """Return the term as LaTeX."""
        T = names[0]
        return rf"\sum_{{i,i',j,j'}} (d_{{ii'}} - D_{{jj'}})^2 {T}_{{ij}} {T}_{{i'j'}}"

    @staticmethod
    def examples() -> list[tuple[Any, tuple[int, int]]]:
        """Return instances for the conformance kit."""
        rng = np.random.default_rng(0)
        part, full = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (rng.random((3, 2)), rng.random((4, 2))))
        return [(GromovWasserstein(part, full), (3, 4)), (GromovWasserstein(full, full), (4, 4))]

    def _product(self, T: FloatArray) -> FloatArray:
        part, full = self._squares
        rows, columns = part @ T.sum(axis=1), full @ T.sum(axis=0)
        return np.asarray(2.0 * (rows[:, None] + columns) - 4.0 * self.part_distances @ T @ self.full_distances)
