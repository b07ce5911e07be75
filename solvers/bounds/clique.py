"""Motzkin and Straus: a quadratic game with m mutually exclusive groups of strategies is worth at most 1 - 1/m."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nonrigid.formulations.model import Problem
from nonrigid.solvers.bounds.standard_quadratic import edge_limit, standard_quadratic
from nonrigid.solvers.solution import Bound


@dataclass(frozen=True)
class Clique:
    """Bound x'Bx on the simplex by d + (b - d)(1 - 1/m), d and b the largest entries on and off the diagonal.

    m is the number of colours of a greedy colouring of the graph {B_ij > d}, which no clique of it exceeds. With
    payoffs in [0, 1], a zero diagonal and conflicts at 0 this is 1 - 1/m.

    Source: Motzkin and Straus, maxima for graphs (Canadian J. Math. 1965), theorem 1.
    """

    reach: int = 10**9

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = standard_quadratic(problem)
        return found if isinstance(found, str) else None

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the bound; one pass over the matrix."""
        begun = time.perf_counter()
        game = standard_quadratic(problem)
        assert not isinstance(game, str)
        off, on = edge_limit(game.matrix)
        colours = colour_count(game.matrix > on)
        value = on + max(off - on, 0.0) * (1.0 - 1.0 / colours)
        value += 4e-16 * abs(value)
        return Bound(game.objective(value), "clique", time.perf_counter() - begun, f"{colours} colours")


def colour_count(adjacent: NDArray[np.bool_]) -> int:
    """Return the number of colours that a greedy colouring uses: an upper bound of the clique number."""
    return len(colour_classes(adjacent))


def colour_classes(adjacent: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Return sets of mutually non-adjacent vertices that together hold every vertex once."""
    order = np.argsort(-adjacent.sum(axis=1), kind="stable")
    free = np.ones(len(adjacent), dtype=bool)
    classes = []
    for first in order:
        if not free[first]:
            continue
        members, open_ = [first], free & ~adjacent[first]
        open_[first] = False
        while open_.any():
            # The vertex that leaves most of the others open keeps the class growing.
            choices = np.flatnonzero(open_)
            chosen = choices[int(np.argmin(adjacent[np.ix_(choices, choices)].sum(axis=1)))]
            members.append(chosen)
            open_ &= ~adjacent[chosen]
            open_[chosen] = False
        free[members] = False
        classes.append(np.array(members, dtype=np.intp))
    return classes


CERTIFICATE = Clique()
