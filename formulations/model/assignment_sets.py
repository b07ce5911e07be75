"""Sets of assignments: injective maps as 0/1 matrices, and their convex hull."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import ModelError
from nonrigid.formulations.model.transport_sets import PartialTransport
from nonrigid.geometry.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Assignment:
    r"""Hold (k, n) matrices x >= 0 whose rows sum to 1 and whose columns sum to at most 1, k <= n.

    It is the convex hull of the injective maps from rows to columns: a linear function has an optimum at one of them.

    Source: Birkhoff and von Neumann, for k < n by adding rows.

    Examples
    --------
    >>> Assignment().linear_max(np.array([[3.0, 2.0, 0.0], [3.0, 0.0, 0.0]]))
    array([[0., 1., 0.],
           [1., 0., 0.]])
    """

    @property
    def convex(self) -> bool:
        """Whether the set is convex."""
        return True

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation of a sign, a row or a column."""
        rows, columns = np.abs(x.sum(axis=1) - 1.0), x.sum(axis=0) - 1.0
        return max(float(np.max(part, initial=0.0)) for part in (-x, rows, columns))

    def restore(self, x: FloatArray) -> FloatArray:
        """Scale rows and columns down to 1, then move what is missing into what is free; see `PartialTransport`."""
        return PartialTransport(np.ones(x.shape[0]), np.ones(x.shape[1])).restore(x)

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return the injective map with the largest sum of g, by shortest augmenting paths."""
        chosen = np.zeros_like(g)
        chosen[np.arange(len(g)), cheapest_assignment(-g)[0]] = 1.0
        return chosen

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= x <= 1."""
        _checked(shape)
        return np.zeros(shape), np.ones(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the row sums and the column sums."""
        k, n = _checked(shape)
        rows = np.asarray(np.kron(np.eye(k), np.ones((1, n))), dtype=float)
        columns = np.asarray(np.kron(np.ones((1, k)), np.eye(n)), dtype=float)
        return (
            SmoothConstraint("equal", lambda x: (np.asarray(x.sum(axis=1) - 1.0), rows), linear=True),
            SmoothConstraint("at most", lambda x: (np.asarray(x.sum(axis=0) - 1.0), columns), linear=True),
        )

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the uniform matrix."""
        return np.full(_checked(shape), 1.0 / shape[1])

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a random mixture of three random injective maps."""
        weights = rng.dirichlet(np.ones(3))
        return np.asarray(sum(weight * _random_map(shape, rng) for weight in weights))

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        return rf"{name} \ge 0,\ {name} 1 = 1,\ {name}^\top 1 \le 1"

    def __str__(self) -> str:
        return "Assignment()"

    @staticmethod
    def examples() -> list[tuple[Assignment, tuple[int, ...]]]:
        """Return what the conformance kit tries the set on."""
        return [(Assignment(), (2, 4)), (Assignment(), (3, 3))]


@dataclass(frozen=True)
class PartialPermutation:
    """Hold the injective maps from k rows to n columns, k <= n, as (k, n) matrices of zeros and ones.

    Examples
    --------
    >>> PartialPermutation().restore(np.array([[0.6, 0.4, 0.3], [0.7, 0.1, 0.0]]))
    array([[0., 1., 0.],
           [1., 0., 0.]])
    """

    @property
    def convex(self) -> bool:
        """Whether the set is convex: no."""
        return False

    @property
    def integral(self) -> bool:
        """Say that every entry is 0 or 1."""
        return True

    def hull(self) -> Assignment:
        """Return the convex hull."""
        return Assignment()

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation of a row, a column or integrality."""
        fraction = np.abs(x - (x > 0.5))
        return max(float(np.max(fraction, initial=0.0)), Assignment().violation(x))

    def restore(self, x: FloatArray) -> FloatArray:
        """Return the nearest injective map: the one with the largest sum of x, what is no number counted as 0."""
        return self.linear_max(np.nan_to_num(x, nan=0.0, posinf=1.0, neginf=0.0))

    project = restore

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return the injective map with the largest sum of g."""
        return Assignment().linear_max(g)

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= x <= 1."""
        return Assignment().bounds(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the row sums and the column sums; integrality is told by `integral`."""
        return Assignment().constraints(shape)

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the map of each row to the column of its own number."""
        return np.eye(*_checked(shape))

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a random injective map."""
        return _random_map(shape, rng)

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        return rf"{name} \in \{{0, 1\}}^{{k \times n}},\ {name} 1 = 1,\ {name}^\top 1 \le 1"

    def __str__(self) -> str:
        return "PartialPermutation()"

    @staticmethod
    def examples() -> list[tuple[PartialPermutation, tuple[int, ...]]]:
        """Return what the conformance kit tries the set on."""
        return [(PartialPermutation(), (2, 4)), (PartialPermutation(), (3, 3))]


def cheapest_assignment(cost: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return for each row the column of the assignment of least total cost, and the prices that prove it.

    Prices are not positive, and 0 for columns left free: sum_i min_j (cost_ij - price_j) + sum_j price_j is a lower
    bound of every assignment's cost, and equals that of the one returned. Rows are added one by one along shortest
    augmenting paths, O(k^2 n).

    Raises
    ------
    ModelError
        If a cost is not finite, or there are more rows than columns.

    Source: Jonker and Volgenant, a shortest augmenting path algorithm for linear assignment problems (Computing 1987).

    Examples
    --------
    >>> columns, prices = cheapest_assignment(np.array([[0.0, 1.0, 5.0], [0.0, 3.0, 5.0]]))
    >>> columns, prices
    (array([1, 0]), array([-1.,  0.,  0.]))
    """
    k, n = _checked(cost.shape)
    if not np.isfinite(cost).all():
        raise ModelError("a cost of an assignment is not finite; give forbidden pairs a large cost")
    row_of = np.full(n, -1)
    row_price, price = np.zeros(k), np.zeros(n)
    for added in range(k):
        length, before = np.full(n, np.inf), np.full(n, -1)
        reached = np.zeros(n, dtype=bool)
        row, at, here = added, -1, 0.0
        while True:
            through = here + cost[row] - row_price[row] - price
            shorter = ~reached & (through < length)
            length[shorter], before[shorter] = through[shorter], at
            at = int(np.where(reached, np.inf, length).argmin())
            here = float(length[at])
            reached[at] = True
            if row_of[at] < 0:
                break
            row = int(row_of[at])
        passed = reached & (row_of >= 0)
        row_price[row_of[passed]] += here - length[passed]
        row_price[added] += here
        price[passed] -= here - length[passed]
        while at >= 0:
            previous = int(before[at])
            row_of[at] = row_of[previous] if previous >= 0 else added
            at = previous
    taken = np.flatnonzero(row_of >= 0)
    return taken[np.argsort(row_of[taken])], price


def _random_map(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    k, n = _checked(shape)
    chosen = np.zeros((k, n))
    chosen[np.arange(k), rng.permutation(n)[:k]] = 1.0
    return chosen


def _checked(shape: tuple[int, ...]) -> tuple[int, int]:
    if len(shape) != 2 or shape[0] > shape[1]:
        raise ModelError(
            f"an assignment needs a matrix with no more rows than columns, not shape {shape}; transpose it"
        )
    return shape[0], shape[1]
