"""Descriptors of a part against those of the whole, seen through a soft mask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from nonrigid.formulations.model.term import Applicable, ModelError, Term
from nonrigid.formulations.model.terms.group_norm import GroupNorm21, column_norms
from nonrigid.formulations.model.terms.membership import membership, membership_slope
from nonrigid.geometry.arrays import FloatArray


class MaskedBasis:
    """Project masked functions onto a basis: B(u) = Phi' diag(mass * u) G, and the adjoint of u -> B(u).

    Parameters
    ----------
    basis
        Phi, (n, k), orthonormal in the mass.
    mass
        (n,) areas of the vertices.
    functions
        G, (n, q); with `mixing` its factor X, (n, r).
    dtype
        Precision of the two matrix products, each n k q multiplications, n k r with `mixing`: float32 halves the time,
        and gradients keep six digits.
    mixing
        Y, (q, r), where G = X Y': functions of low rank, as descriptors in their principal components.

    Examples
    --------
    >>> masked = MaskedBasis(np.ones((2, 1)), np.array([0.5, 0.5]), np.array([[2.0], [4.0]]))
    >>> masked.project(np.array([1.0, 0.0])), masked.adjoint(np.array([[1.0]]))
    (array([[1.]]), array([1., 2.]))
    """

    def __init__(
        self,
        basis: FloatArray,
        mass: FloatArray,
        functions: FloatArray,
        dtype: DTypeLike = np.float64,
        mixing: FloatArray | None = None,
    ) -> None:
        if len({len(basis), len(mass), len(functions)}) > 1:
            lengths = len(basis), len(mass), len(functions)
            raise ModelError(f"basis, mass and functions have {lengths} rows; give one a vertex")
        if mixing is not None and (mixing.ndim != 2 or mixing.shape[1] != functions.shape[1]):
            raise ModelError(f"mixing has shape {mixing.shape}; give it {functions.shape[1]} columns")
        given = (basis, mass, functions) if mixing is None else (basis, mass, functions, mixing)
        if not all(np.isfinite(array).all() for array in given):
            raise ModelError("the basis, the mass, the functions or their mixing have entries that are not finite")
        self._weighted: Any = np.ascontiguousarray(basis * mass[:, None], dtype=dtype)
        self._functions: Any = np.ascontiguousarray(functions, dtype=dtype)
        self._mixing = mixing
        self.size, self.rank = len(basis), basis.shape[1]
        self.count = functions.shape[1] if mixing is None else len(mixing)

    def project(self, u: FloatArray) -> FloatArray:
        """Return B(u), (k, q), in double precision."""
        scaled = self._weighted * u.astype(self._weighted.dtype)[:, None]
        found = np.asarray(scaled.T @ self._functions, dtype=float)
        return found if self._mixing is None else found @ self._mixing.T

    def adjoint(self, weights: FloatArray) -> FloatArray:
        """Return the gradient of <weights, B(u)> in u, (n,), for weights (k, q)."""
        onto = weights if self._mixing is None else weights @ self._mixing
        products = self._functions @ onto.T.astype(self._functions.dtype)
        return np.asarray(np.einsum("nk,nk->n", products, self._weighted), dtype=float)


@dataclass(frozen=True, eq=False)
class MaskedData(Applicable):
    """Evaluate f(C, v) = ||C A - B(eta(v))||_{2,1} for a functional map C and a mask eta(v) on the whole.

    Parameters
    ----------
    source
        A, (k, q): coefficients of the part's descriptors.
    whole
        The whole's basis and descriptors.

    Raises
    ------
    ModelError
        If the numbers of descriptors differ or the coefficients are not finite.

    Source: Rodola, Cosmo, Bronstein, Torsello and Cremers, partial functional correspondence (CGF 2017).

    Examples
    --------
    >>> whole = MaskedBasis(np.ones((2, 1)), np.array([0.5, 0.5]), np.array([[2.0], [4.0]]))
    >>> value, gradients = MaskedData(np.array([[3.0]]), whole).value_and_gradient(np.eye(1), np.array([0.5, 0.5]))
    >>> value, gradients
    (1.5, (array([[3.]]), array([-3., -6.])))
    """

    source: FloatArray
    whole: MaskedBasis

    def __post_init__(self) -> None:
        if self.source.ndim != 2 or self.source.shape[1] != self.whole.count:
            raise ModelError(f"A has shape {self.source.shape}, the whole {self.whole.count} descriptors")
        if not np.isfinite(self.source).all():
            raise ModelError("the coefficients of the part have entries that are not finite")

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, tuple[FloatArray, FloatArray]]:
        """Return the sum of the column norms, and its gradients in C, (k, k), and v, (n,)."""
        C, v = x
        value, unit = column_norms(C @ self.source - self.whole.project(membership(v)))
        return value, (unit @ self.source.T, -membership_slope(v) * self.whole.adjoint(unit))

    def fix(self, given: Sequence[FloatArray | None]) -> Term:
        """Return the convex term in C for a given v, or the term in v for a given C."""
        C, v = given
        if v is not None:
            return GroupNorm21(self.source, self.whole.project(membership(v)))
        assert C is not None
        return MaskedTarget(C @ self.source, self.whole)

    def latex(self, names: Sequence[str]) -> str:
        """Return the norm as LaTeX."""
        return rf"\|{names[0]} A - B(\eta({names[1]}))\|_{{2,1}}"

    @staticmethod
    def examples() -> list[tuple[Any, list[Any]]]:
        """Return instances for the conformance kit."""
        whole = _example()
        return [(MaskedData(np.random.default_rng(1).standard_normal((2, 4)), whole), [(3, 2), 6])]


@dataclass(frozen=True, eq=False)
class MaskedTarget(Applicable):
    """Evaluate f(v) = ||T - B(eta(v))||_{2,1}: `MaskedData` with the functional map given.

    Parameters
    ----------
    target
        T = C A, (k, q).
    whole
        The whole's basis and descriptors.

    Examples
    --------
    >>> whole = MaskedBasis(np.ones((2, 1)), np.array([0.5, 0.5]), np.array([[2.0], [4.0]]))
    >>> MaskedTarget(np.array([[3.0]]), whole).value_and_gradient(np.array([0.5, 0.5]))
    (1.5, array([-3., -6.]))
    """

    target: FloatArray
    whole: MaskedBasis

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the sum of the column norms and its gradient, (n,)."""
        value, unit = column_norms(self.target - self.whole.project(membership(x[0])))
        return value, -membership_slope(x[0]) * self.whole.adjoint(unit)

    def latex(self, names: Sequence[str]) -> str:
        """Return the norm as LaTeX."""
        return rf"\|T - B(\eta({names[0]}))\|_{{2,1}}"

    @staticmethod
    def examples() -> list[tuple[Any, int]]:
        """Return instances for the conformance kit."""
        return [(MaskedTarget(np.random.default_rng(1).standard_normal((3, 4)), _example()), 6)]


def _example() -> MaskedBasis:
    rng = np.random.default_rng(0)
    return MaskedBasis(rng.standard_normal((6, 3)), rng.uniform(0.5, 1.0, 6), rng.standard_normal((6, 4)))
