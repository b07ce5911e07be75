"""A lower bound on triple assignments by the linear relaxation that has a variable for each triple of matches."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from nonrigid.formulations.model import Problem
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.structure import TripleAssignment, triple_assignment

_MOST = 50_000


@dataclass(frozen=True)
class TripleLift:
    """Bound the triple distortion over injective maps from below by a linear program.

    Variables stand for matches x, pairs of matches z and triples of matches y; the sum of y over the column of one of
    its rows is the z of the other two, that of z over a column the x of the other row. What HiGHS returns is used as
    multipliers only: for any multipliers m of the equations E v = f, the value f'm + sum min(0, c - E'm) over the
    unknowns, each between 0 and 1, is a lower bound, so an inexact solve gives a looser bound, never a wrong one.

    Source: the third level of Sherali and Adams (SIAM J. Discrete Math. 1990), without the products of columns.
    """

    reach: int = 60

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = triple_assignment(problem)
        if isinstance(found, str):
            return found
        size = _size(*found.term.shape)
        return None if size <= _MOST else f"at most {_MOST} unknowns, and the lift of triples has {size}"

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the bound that the multipliers prove."""
        begun = time.perf_counter()
        found = triple_assignment(problem)
        assert isinstance(found, TripleAssignment)
        cost, equations, right, columns = _program(found.term)
        k = found.term.shape[0]
        solve: Any = linprog  # its types know no sparse matrices
        answer = solve(
            cost,
            A_eq=equations,
            b_eq=right,
            A_ub=columns,
            b_ub=np.ones(columns.shape[0]),
            bounds=(0.0, None),
            method="highs",
            options={"time_limit": max(seconds - (time.perf_counter() - begun), 0.01)},
        )
        value = 0.0
        if answer.status == 0:
            m, p = np.asarray(answer.eqlin.marginals), np.minimum(np.asarray(answer.ineqlin.marginals), 0.0)
            reduced = np.minimum(cost - equations.T @ m - columns.T @ p, 0.0)
            # Exactly k matches, as many z as pairs and y as triples of rows are 1 at a map: each group of rows has one.
            value = max(float(right @ m + p.sum()) + _at_worst(reduced, k, found.term.shape[1]), 0.0)
        detail = f"{len(cost)} unknowns, {equations.shape[0] + columns.shape[0]} rows; HiGHS: {answer.message}"
        return Bound(found.constant + found.weight * value, "triple_lift", time.perf_counter() - begun, detail)


def _at_worst(reduced: FloatArray, k: int, n: int) -> float:
    """Return the least that the reduced costs, none positive, add up to at a map: one entry in each group of rows."""
    sizes = [n] * k + [n * (n - 1)] * (k * (k - 1) // 2) + [n * (n - 1) * (n - 2)] * (k * (k - 1) * (k - 2) // 6)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return float(np.minimum.reduceat(reduced, starts).sum())


def _size(k: int, n: int) -> int:
    pairs, triples = k * (k - 1) // 2, k * (k - 1) * (k - 2) // 6
    return k * n + pairs * n * (n - 1) + triples * n * (n - 1) * (n - 2)


def _program(term: TripleDistortion) -> tuple[FloatArray, sparse.csr_array, FloatArray, sparse.csr_array]:
    """Return costs, equations with their right side, and the rows that hold each column to one match."""
    k, n = term.shape
    two = np.argwhere(~np.eye(n, dtype=bool))
    j, l, m = (axis.ravel() for axis in np.indices((n, n, n)))  # noqa: E741 - the columns of the formula
    apart = (j != l) & (j != m) & (l != m)
    three = np.column_stack([j, l, m])[apart]
    pairs, triples = list(combinations(range(k), 2)), list(combinations(range(k), 3))
    first_pair, first_triple = k * n, k * n + len(pairs) * len(two)
    size = first_triple + len(triples) * len(three)
    number = np.full((n, n), -1)
    number[two[:, 0], two[:, 1]] = np.arange(len(two))
    rows, columns, values = [], [], []
    height = 0

    def tie(upper: IntArray, which: IntArray, lower: IntArray) -> None:
        """Add the rows: the sum of `upper` over each value of `which` equals `lower` of that value."""
        nonlocal height
        rows.extend([height + which, height + np.arange(len(lower))])
        columns.extend([upper, lower])
        values.extend([np.ones(len(upper)), -np.ones(len(lower))])
        height += len(lower)

    for i in range(k):
        rows.append(np.full(n, i))
        columns.append(i * n + np.arange(n))
        values.append(np.ones(n))
    height = k
    for place, pair in enumerate(pairs):
        of_pair = first_pair + place * len(two) + np.arange(len(two))
        for side, row in enumerate(pair):
            tie(of_pair, two[:, side], row * n + np.arange(n))
    cost = np.zeros(size)
    for place, triple in enumerate(triples):
        of_triple = first_triple + place * len(three) + np.arange(len(three))
        for one, other in combinations(range(3), 2):
            pair_place = pairs.index((triple[one], triple[other]))
            tie(
                of_triple,
                number[three[:, one], three[:, other]],
                first_pair + pair_place * len(two) + np.arange(len(two)),
            )
        for index, (i, a, c) in enumerate(term.triples):
            if {int(i), int(a), int(c)} == set(triple):
                at = [three[:, triple.index(int(row))] for row in (i, a, c)]
                cost[of_triple] += term.cost[index][tuple(at)]
    equations = sparse.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(height, size)
    )
    right = np.concatenate([np.ones(k), np.zeros(height - k)])
    places = np.arange(k * n)
    once = sparse.csr_array((np.ones(k * n), (places % n, places)), shape=(n, size))
    return cost, equations, right, once


CERTIFICATE = TripleLift()
