"""What an algorithm of a library can take, and the first route by which it takes a problem."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.model import Problem
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.solvers.acceptance import Acceptance, Bridge, Native, Refused, Via, via
from nonrigid.solvers.layout import Layout

_MOST_ENTRIES = 10_000_000
"""Largest Jacobian of constraints, in numbers of 8 bytes: methods keep several copies."""


@dataclass(frozen=True, kw_only=True)
class Capability:
    """State what an algorithm takes beside bounds.

    Parameters
    ----------
    equal, at_most
        Whether it takes constraints c(x) = 0 and c(x) <= 0.
    finite_bounds
        Whether every unknown must be bounded on both sides.
    largest
        Largest number of unknowns at which it is of use; None for no such number.
    because
        Why there is such a number, as in "COBYLA keeps a simplex of n + 1 points".
    """

    equal: bool = False
    at_most: bool = False
    finite_bounds: bool = False
    largest: int | None = None
    because: str = ""

    def obstacle(self, problem: Problem) -> str | None:
        """Return what keeps the algorithm from taking the problem as it stands; None if nothing does."""
        layout = Layout(problem)
        if self.largest is not None and layout.size > self.largest:
            return f"{self.because}: {layout.size} unknowns, at most {self.largest} work"
        whole = sum(int(integral_entries(m.set, m.variable.shape).sum()) for m in problem.memberships)
        if whole:
            return f"it takes no integers, and {whole} unknowns are; bridge or use a mixed-integer solver"
        takes = {"equal": self.equal, "at most": self.at_most}
        words = {"equal": "equality", "at most": "inequality"}
        for item in layout.constraints():
            kind = item.constraint.kind
            if not takes[kind]:
                return f"it takes no {words[kind]} constraints, and {item.name!r} is one"
        large = too_many_conditions(problem)
        if large is not None:
            return large
        loose = int(sum(np.sum(~np.isfinite(bound)) for bound in layout.bounds()))
        if self.finite_bounds and loose:
            return f"it needs finite bounds, and {loose} of {2 * layout.size} bounds are infinite; use a Box"
        return None


def too_many_conditions(problem: Problem) -> str | None:
    """Return why the Jacobian of the constraints, a dense matrix, cannot be held; None if it can."""
    layout = Layout(problem)
    rows = sum(item.constraint.count or 0 for item in layout.constraints())
    entries = rows * layout.size
    if entries <= _MOST_ENTRIES:
        return None
    return (
        f"it needs the Jacobian of {rows} constraints in {layout.size} unknowns as a dense matrix of {entries:.2g} "
        f"entries, at most {_MOST_ENTRIES:.2g} work; take fewer samples or native:conditional_gradient"
    )


def accept(
    problem: Problem, algorithm: str, capability: Capability, routes: Iterable[tuple[Bridge, ...]]
) -> Acceptance:
    """Return the first route after which the algorithm takes the problem, or why there is none.

    An empty route stands for the problem as it is.

    Examples
    --------
    >>> from nonrigid.formulations.model import QuadraticForm, Simplex, Variable, maximize
    >>> from nonrigid.solvers.bridges.radial import Radial
    >>> u = Variable("u", 3)
    >>> game = Problem("game", maximize(QuadraticForm(np.ones((3, 3)))(u)), u @ Simplex())
    >>> print(accept(game, "L-BFGS-B", Capability(), [(), (Radial(),)]))
    via radial
    >>> print(accept(game, "L-BFGS-B", Capability(), [()]))
    refused: L-BFGS-B: it takes no equality constraints, and 'u in Simplex()' is one
    """
    reasons: list[str] = []
    for route in routes:
        way = via(problem, *route)
        obstacle = way.reason if isinstance(way, Refused) else capability.obstacle(_rewritten(problem, route))
        if obstacle is None:
            return Via(route) if route else Native()
        if obstacle not in reasons:
            reasons.append(obstacle)
    return Refused(f"{algorithm}: {'; '.join(reasons)}")


def _rewritten(problem: Problem, route: tuple[Bridge, ...]) -> Problem:
    for bridge in route:
        problem = bridge.apply(problem).problem
    return problem
