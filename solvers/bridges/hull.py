"""From injective maps to their convex hull, for solvers that cannot branch; the way back rounds."""

from __future__ import annotations

from dataclasses import dataclass

from nonrigid.formulations.model import Membership, Problem
from nonrigid.formulations.model.assignment_sets import PartialPermutation
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.bridges.body import replace_memberships
from nonrigid.solvers.judge import Values, restore


@dataclass(frozen=True)
class ToHull:
    """Replace each set of injective maps by its convex hull {x >= 0, rows sum to 1, columns to at most 1}.

    A relaxation: the hull holds more points. The way back takes the injective map nearest to the point found.

    Examples
    --------
    >>> ToHull().claim.value
    'relaxation'
    """

    name: str = "convex hull"
    claim: Claim = Claim.RELAXATION

    def obstacle(self, problem: Problem) -> str | None:
        """Return why there is nothing to relax."""
        if any(isinstance(member.set, PartialPermutation) for member in problem.memberships):
            return None
        return "a variable in a set of injective maps"

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem on the hulls."""
        memberships = tuple(
            Membership(m.variable, m.set.hull() if isinstance(m.set, PartialPermutation) else m.set)
            for m in problem.memberships
        )

        def inverse(values: Values) -> Values:
            return restore(problem, values)

        return Rewritten(replace_memberships(problem, memberships), lambda values: values, inverse)
