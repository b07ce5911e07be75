"""How far an assignment is from scaling all distances alike: a cubic form in an assignment matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from nonrigid.formulations.model.assignment_sets import Assignment
from nonrigid.formulations.model.term import Applicable, Curvature, ModelError
from nonrigid.geometry.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class TripleDistortion(Applicable):
    r"""Evaluate the mean of |r_ia - r_ic| over rows i and pairs {a, c} of other rows, for a (k, n) assignment matrix P.

    r_ia is `ratio[i, a, j, l]` where row i is assigned column j and row a column l; the mean is extended to matrices
    that are no assignments as the multilinear form sum P_ij P_al P_cm |ratio[i, a, j, l] - ratio[i, c, j, m]| / t over
    the t = k (k - 1)(k - 2) / 2 triples. Where two of the columns j, l, m agree, which no assignment does, the
    coefficient is the mean of all the others, so that a relaxation has no reason to seek them.

    Parameters
    ----------
    ratio
        (k, k, n, n) with ratio[i, a, j, l] = ratio[a, i, l, j]; entries with i = a or j = l are not read.

    Raises
    ------
    ModelError
        If the shape is another, k < 3, n < k, or entries that are read are not finite or not symmetric.

    Source: SHREC'16, scale-invariant isometric matching.

    Examples
    --------
    >>> sides, others = np.array([[0.0, 1, 2], [1, 0, 3], [2, 3, 0]]), np.array([[0.0, 2, 4], [2, 0, 6], [4, 6, 0]])
    >>> with np.errstate(divide="ignore", invalid="ignore"):
    ...     term = TripleDistortion(sides[:, :, None, None] / others)
    >>> term.value_and_gradient(np.eye(3))[0]
    0.0
    """

    ratio: FloatArray
    triples: IntArray
    cost: FloatArray
    curvature: Curvature = Curvature.UNKNOWN
    monotone: bool = True
    degree: int = 3

    def __init__(self, ratio: FloatArray) -> None:
        ratio = np.array(ratio, dtype=float)
        if ratio.ndim != 4 or ratio.shape[0] != ratio.shape[1] or ratio.shape[2] != ratio.shape[3]:
            raise ModelError(f"the ratios of a triple distortion have shape {ratio.shape}; it must be (k, k, n, n)")
        k, n = ratio.shape[0], ratio.shape[2]
        if not 3 <= k <= n:
            raise ModelError(f"a triple distortion needs 3 <= k <= n, and has k = {k} rows and n = {n} columns")
        ratio[np.arange(k), np.arange(k)] = 0.0
        ratio[:, :, np.arange(n), np.arange(n)] = 0.0
        largest = float(np.abs(ratio).max(initial=0.0))
        if not np.isfinite(largest):
            raise ModelError("ratios are not finite: two samples coincide; drop one")
        if float(np.abs(ratio - ratio.transpose(1, 0, 3, 2)).max()) > 1e-12 * max(largest, 1e-300):
            raise ModelError("ratio[i, a, j, l] must equal ratio[a, i, l, j]")
        triples = np.array(
            [(i, a, c) for i in range(k) for a, c in combinations([other for other in range(k) if other != i], 2)]
        )
        i, a, c = triples.T
        cost = np.abs(ratio[i, a][:, :, :, None] - ratio[i, c][:, :, None, :]) / len(triples)
        of_i, of_a, of_c = np.ogrid[:n, :n, :n]
        collide = (of_i == of_a) | (of_i == of_c) | (of_a == of_c)
        cost[:, collide] = cost[:, ~collide].mean()
        object.__setattr__(self, "ratio", ratio)
        object.__setattr__(self, "triples", triples)
        object.__setattr__(self, "cost", cost)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns of the assignment matrix."""
        return self.ratio.shape[0], self.ratio.shape[2]

    def of_maps(self, columns: IntArray) -> FloatArray:
        """Return the values at injective maps, given as (..., k) columns."""
        i, a, c = self.triples.T
        each = self.cost[np.arange(len(i)), columns[..., i], columns[..., a], columns[..., c]]
        return np.asarray(each.sum(axis=-1))

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the value and the (k, n) gradient."""
        i, a, c = self.triples.T
        first, second, third = x[0][i], x[0][a], x[0][c]
        over_third = np.einsum("tjlm,tm->tjl", self.cost, third)
        over_second = np.einsum("tjlm,tl->tjm", self.cost, second)
        by_first = np.einsum("tjl,tl->tj", over_third, second)
        gradient = np.zeros_like(x[0])
        np.add.at(gradient, i, by_first)
        np.add.at(gradient, a, np.einsum("tjl,tj->tl", over_third, first))
        np.add.at(gradient, c, np.einsum("tjm,tj->tm", over_second, first))
        return float(np.sum(by_first * first)), gradient

    def hessian(self, x: FloatArray) -> FloatArray:
        """Return the (k n, k n) matrix of second derivatives, rows of P one after another."""
        k, n = self.shape
        blocks = np.zeros((k, k, n, n))
        i, a, c = self.triples.T
        for left, right, over in ((i, a, "tjlm,tm->tjl"), (i, c, "tjlm,tl->tjm"), (a, c, "tjlm,tj->tlm")):
            other = {"tjlm,tm->tjl": c, "tjlm,tl->tjm": a, "tjlm,tj->tlm": i}[over]
            block = np.einsum(over, self.cost, x[other])
            np.add.at(blocks, (left, right), block)
            np.add.at(blocks, (right, left), block.transpose(0, 2, 1))
        return np.asarray(blocks.transpose(0, 2, 1, 3).reshape(k * n, k * n))

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the Hessian times a direction, as a (k, n) matrix."""
        return np.asarray((self.hessian(x) @ direction.ravel()).reshape(x.shape))

    def latex(self, names: Sequence[str]) -> str:
        """Return the mean as LaTeX."""
        return rf"\tfrac{{1}}{{t}} \sum_{{i, a < c}} |r_{{ia}}({names[0]}) - r_{{ic}}({names[0]})|"

    @staticmethod
    def examples() -> list[tuple[TripleDistortion, tuple[int, int], Assignment]]:
        """Return what the conformance kit tries the term on."""
        rng = np.random.default_rng(0)
        ratio = rng.random((4, 4, 5, 5))
        return [(TripleDistortion(ratio + ratio.transpose(1, 0, 3, 2)), (4, 5), Assignment())]
