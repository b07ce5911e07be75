"""Search of all injective maps for the one of least triple distortion: whole, or cut by bounds."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.structure import TripleAssignment, triple_assignment

_BLOCK = 256  # partial maps extended at once: many enough for numpy, few enough that a good map is found early


def exhaustive(oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
    """Evaluate every map, all those that agree on the first row at once; the best is proved optimal."""
    search = _Search(oracle, start)
    k, n = search.term.shape
    for first in range(n):
        columns, cost = np.array([[first]]), np.zeros(1)
        for _ in range(1, k):
            child = search.children(columns, cost)
            kept = np.isfinite(child)
            columns = np.column_stack([np.repeat(columns, kept.sum(axis=1), axis=0), np.nonzero(kept)[1]])
            cost = child[kept]
        best = int(cost.argmin())
        search.offer(columns[best], float(cost[best]))
    return search.answer("exhaustive", f"{search.problem.maps} maps")


def branch_and_bound(oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
    """Assign row after row, cheapest maps first, and cut a branch whose triples so far cost as much as a known map.

    Costs are not negative, so that what the rows assigned cost bounds every completion from below. Partial maps are
    extended many at once, depth first.
    """
    search = _Search(oracle, start)
    k = search.term.shape[0]
    stack = [(np.zeros((1, 0), dtype=np.int64), np.zeros(1))]
    nodes = 0
    while stack:
        columns, cost = stack.pop()
        columns, cost = columns[cost < search.least], cost[cost < search.least]
        if not len(cost):
            continue
        nodes += len(cost)
        child = search.children(columns, cost)
        parents, added = np.nonzero(child < search.least)
        values = child[parents, added]
        order = np.argsort(values, kind="stable")
        extended, values = np.column_stack([columns[parents], added])[order], values[order]
        if extended.shape[1] == k:
            if len(values):
                search.offer(extended[0], float(values[0]))
            continue
        blocks = range(0, len(values), _BLOCK)
        stack += [(extended[i : i + _BLOCK], values[i : i + _BLOCK]) for i in reversed(blocks)]
    return search.answer("branch_and_bound", f"{nodes} nodes")


class _Search:
    """Hold the best map found, and count work in evaluations of the whole cubic form: n^3 products a triple."""

    def __init__(self, oracle: Oracle, start: FloatArray) -> None:
        problem = triple_assignment(oracle.problem)
        assert isinstance(problem, TripleAssignment)
        self.problem = problem
        self.term: TripleDistortion = problem.term
        k, n = self.term.shape
        self._oracle = oracle
        self._closing = [np.flatnonzero(self.term.triples.max(axis=1) == row) for row in range(k)]
        self.best = oracle.problem.memberships[0].set.restore(start.reshape(k, n)).argmax(axis=1)
        self.least = float(self.term.of_maps(self.best))
        self._show()

    def children(self, columns: IntArray, cost: FloatArray) -> FloatArray:
        """Return (N, n) costs of the (N, d) partial maps with one more row assigned; infinite where not injective."""
        self._oracle.charge(len(columns) / self.term.shape[1] ** 2)
        row, n = columns.shape[1], self.term.shape[1]
        total = np.repeat(cost[:, None], n, axis=1)
        for triple in self._closing[row]:
            table = self.term.cost[triple]
            place = int(np.flatnonzero(self.term.triples[triple] == row)[0])
            one, other = (columns[:, index] for index in np.delete(self.term.triples[triple], place))
            total += np.moveaxis(table, place, 2)[one, other]
        np.put_along_axis(total, columns, np.inf, axis=1)
        return total

    def offer(self, columns: IntArray, cost: float) -> None:
        """Keep a map if it is better than the best so far."""
        if cost < self.least:
            self.best, self.least = columns, cost
            self._show()

    def answer(self, method: str, detail: str) -> Raw:
        """Return the best map with its proof: nothing better is left."""
        value = self.problem.constant + self.problem.weight * self.least
        return Raw(self._flat(), f"{detail} searched", Bound(value, method, self._oracle.seconds, detail))

    def _show(self) -> None:
        self._oracle.observe(self._flat(), objective=self.problem.constant + self.problem.weight * self.least)

    def _flat(self) -> FloatArray:
        chosen = np.zeros(self.term.shape)
        chosen[np.arange(len(chosen)), self.best] = 1.0
        return chosen.ravel()
