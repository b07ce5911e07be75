"""From a surface to its convex body: = becomes <=, for solvers without equality constraints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from nonrigid.formulations.model import Membership, Problem, Sense
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values, restore


@dataclass(frozen=True)
class ToBody:
    """Replace each surface {x >= 0, gauge(x) = 1} by its body {x >= 0, gauge(x) <= 1}.

    Exact where every term is monotone on x >= 0 with positive weight and is maximized: scaling a point of the body
    outward never lowers the objective, so some maximum lies on the surface, and the way back scales onto it.
    """

    name: str = "surface to body"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why the surface cannot be relaxed without loss."""
        if not any(hasattr(member.set, "body") for member in problem.memberships):
            return "a variable on a simplex, elastic net or sphere"
        if problem.objective.sense is not Sense.MAXIMIZE:
            return "a problem that maximizes"
        if problem.constraints:
            return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
        for applied in problem.objective.terms:
            if not getattr(applied.term, "monotone", False) or applied.weight < 0:
                return f"terms that do not fall as x grows, which {applied} does not promise"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem on the bodies."""
        memberships = tuple(Membership(m.variable, _body(m.set)) for m in problem.memberships)

        def inverse(values: Values) -> Values:
            return restore(problem, values)

        return Rewritten(replace_memberships(problem, memberships), lambda values: values, inverse)


def replace_memberships(problem: Problem, memberships: tuple[Membership, ...]) -> Problem:
    """Return the problem with its variables in other sets."""
    return Problem(problem.name, replace(problem.objective), *memberships, constraints=problem.constraints)


def _body(set_: Any) -> Any:
    return set_.body() if hasattr(set_, "body") else set_
