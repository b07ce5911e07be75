"""The least of all injective maps: a bound on triple assignments by trying every one."""

from __future__ import annotations

import time
from dataclasses import dataclass

from nonrigid.formulations.model import Problem
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.solve import solve
from nonrigid.solvers.structure import TripleAssignment, triple_assignment

_MOST = 1_000_000


@dataclass(frozen=True)
class Exhaustive:
    """Bound the triple distortion over injective maps by its least value over all of them, 30,240 for 5 of 10.

    The search of `native:exhaustive`. Cut short by the clock it proves only that no distortion is negative.
    """

    reach: int = 60

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = triple_assignment(problem)
        if isinstance(found, str):
            return found
        return None if found.maps <= _MOST else f"at most {_MOST} maps, and the problem has {found.maps}"

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the least value, or 0 where the search did not end in time."""
        begun = time.perf_counter()
        found = triple_assignment(problem)
        assert isinstance(found, TripleAssignment)
        solution = solve(problem, "native:exhaustive", limits=Limits(seconds=max(seconds, 0.01)))
        least = found.constant if solution.bound is None else solution.bound.value
        ended = "all" if solution.bound is not None else "not all"
        return Bound(least, "exhaustive", time.perf_counter() - begun, f"{ended} of {found.maps} maps tried")


CERTIFICATE = Exhaustive()
