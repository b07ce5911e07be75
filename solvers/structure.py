"""What a problem looks like to a specialised solver: the shapes for which closed forms are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from nonrigid.formulations.model import ElasticNet, Problem, QuadraticForm, Sense


@dataclass(frozen=True, eq=False)
class QuadraticGame:
    """Hold max weight * x'Ax over one elastic-net surface (the simplex included), for A >= 0 and weight > 0."""

    form: QuadraticForm
    weight: float
    surface: ElasticNet

    @property
    def matrix(self) -> Any:
        """The symmetric matrix A, dense or sparse, weight not included."""
        return self.form.matrix

    @property
    def size(self) -> int:
        """Number of strategies."""
        return int(self.matrix.shape[0])


def quadratic_game(problem: Problem) -> QuadraticGame | str:
    """Return the problem as a quadratic game, or say in words what keeps it from being one."""
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or len(problem.objective.terms) != 1:
        return "one variable and one quadratic term"
    surface, applied = problem.memberships[0].set, problem.objective.terms[0]
    if not isinstance(surface, ElasticNet):
        return f"a variable on a simplex, elastic net or sphere, not in {surface}"
    if not isinstance(applied.term, QuadraticForm):
        return f"a quadratic form, not {applied}"
    weight = applied.weight if problem.objective.sense is Sense.MAXIMIZE else -applied.weight
    if weight <= 0 or not applied.term.monotone:
        return "a maximized quadratic form with no negative entry"
    return QuadraticGame(applied.term, weight, surface)
