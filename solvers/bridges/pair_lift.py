"""From a triple assignment to a mixed-integer linear problem by one variable for each pair of matches."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy import sparse

from nonrigid.formulations.model import Membership, Problem, SmoothConstraint, Variable, minimize
from nonrigid.formulations.model.binary_sets import MixedBinary
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values, restore
from nonrigid.solvers.structure import TripleAssignment, triple_assignment


@dataclass(frozen=True)
class PairLift:
    r"""Rewrite min of the triple distortion over injective maps as a linear problem, the map's entries binary.

    With one vector (P, z, e): z_{ia,jl} >= 0 for each pair of rows i < a and columns j != l, with
    sum_l z_{ia,jl} = P_ij and sum_j z_{ia,jl} = P_al, so that z = P_ij P_al where P is integral and
    r_ia = sum ratio z is linear; e >= |r_ia - r_ic| for each triple, and the mean of e is minimized. Exact, without a
    large constant. k = 5 and n = 10 give 980 unknowns, 50 of them binary.

    Parameters
    ----------
    largest
        Number of unknowns above which branch and bound is not tried.

    Source: the lift of pairs of Adams and Johnson for quadratic assignment; the triples follow from it linearly.
    """

    largest: int = 2000
    name: str = "pair lift"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why the problem is no triple assignment, or too large."""
        found = triple_assignment(problem)
        if isinstance(found, str):
            return found
        size = _Lift(found.term).size
        return None if size <= self.largest else f"at most {self.largest} unknowns, and the lift has {size}"

    def apply(self, problem: Problem) -> Rewritten:
        """Return the mixed-integer linear problem."""
        found = triple_assignment(problem)
        assert isinstance(found, TripleAssignment)
        lift, (original,) = _Lift(found.term), problem.variables
        v = Variable("v", lift.size)
        mean = np.zeros(lift.size)
        mean[lift.first_gap :] = 1.0 / len(found.term.triples)
        objective = minimize(found.weight * Linear(mean)(v))
        rewritten = Problem(
            problem.name,
            type(objective)(objective.sense, objective.terms, found.constant),
            Membership(v, MixedBinary(integral=lift.integral, upper=lift.upper)),
            constraints={
                "assigned": (v, _affine("equal", *lift.assigned())),
                "at most once": (v, _affine("at most", *lift.once())),
                "gaps": (v, _affine("at most", *lift.gaps())),
            },
        )

        def forward(values: Values) -> Values:
            return {"v": lift.vector(values[original.name])}

        def inverse(values: Values) -> Values:
            return restore(problem, {original.name: values["v"][: lift.first_pair].reshape(original.shape)})

        return Rewritten(rewritten, forward, inverse)


class _Lift:
    """Hold the places of (P, z, e) in one vector, and the rows that tie them."""

    def __init__(self, term: TripleDistortion) -> None:
        self.term = term
        self.k, self.n = term.shape
        self.pairs = list(combinations(range(self.k), 2))
        self.ordered = np.argwhere(~np.eye(self.n, dtype=bool))
        self.first_pair = self.k * self.n
        self.first_gap = self.first_pair + len(self.pairs) * len(self.ordered)
        self.size = self.first_gap + len(term.triples)
        self.integral = np.arange(self.size) < self.first_pair
        # r_ia - r_ic is a difference of two averages of ratios, hence within their range.
        spread = float(term.ratio.max() - term.ratio.min())
        self.upper = np.where(np.arange(self.size) < self.first_gap, 1.0, max(spread, 1e-300))

    def place(self, pair: int) -> slice:
        """Return the place of z for a pair of rows."""
        begin = self.first_pair + pair * len(self.ordered)
        return slice(begin, begin + len(self.ordered))

    def vector(self, P: FloatArray) -> FloatArray:
        """Return (P, z, e) of a map."""
        left, right = self.ordered.T
        z = [P[i, left] * P[a, right] for i, a in self.pairs]
        flat = np.concatenate([P.ravel(), *z, np.zeros(len(self.term.triples))])
        rows, _ = self.gaps()
        values = (rows @ flat).reshape(2, -1)
        flat[self.first_gap :] = np.abs(values[0])
        return flat

    def assigned(self) -> tuple[FloatArray, FloatArray]:
        """Return the rows of sum_j P_ij = 1, sum_l z = P_ij and sum_j z = P_al."""
        n, (left, right) = self.n, self.ordered.T
        rows = [np.zeros((self.k, self.size))]
        for i in range(self.k):
            rows[0][i, i * n : (i + 1) * n] = 1.0
        for number, pair in enumerate(self.pairs):
            for row, column in zip(pair, (left, right), strict=True):
                block = np.zeros((n, self.size))
                block[column, np.arange(self.size)[self.place(number)]] = 1.0
                block[np.arange(n), row * n + np.arange(n)] = -1.0
                rows.append(block)
        right_side = np.concatenate([np.ones(self.k), np.zeros(2 * n * len(self.pairs))])
        return np.vstack(rows), right_side

    def once(self) -> tuple[FloatArray, FloatArray]:
        """Return the rows of sum_i P_ij <= 1."""
        rows = np.zeros((self.n, self.size))
        for j in range(self.n):
            rows[j, j : self.first_pair : self.n] = 1.0
        return rows, np.ones(self.n)

    def gaps(self) -> tuple[FloatArray, FloatArray]:
        """Return the rows of +-(r_ia - r_ic) - e <= 0."""
        ratio = np.zeros((self.k, self.k, self.size))
        left, right = self.ordered.T
        for number, (i, a) in enumerate(self.pairs):
            ratio[i, a, self.place(number)] = self.term.ratio[i, a, left, right]
            ratio[a, i] = ratio[i, a]
        i, a, c = self.term.triples.T
        difference = ratio[i, a] - ratio[i, c]
        gap = np.zeros_like(difference)
        gap[np.arange(len(gap)), self.first_gap + np.arange(len(gap))] = 1.0
        return np.vstack([difference - gap, -difference - gap]), np.zeros(2 * len(gap))


def _affine(kind: Literal["equal", "at most"], rows: FloatArray, right: FloatArray) -> SmoothConstraint:
    compressed = sparse.csr_array(rows)
    return SmoothConstraint(kind, lambda v: (np.asarray(compressed @ v - right), rows), linear=True)
