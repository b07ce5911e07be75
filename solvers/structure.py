"""What a problem looks like to a specialised solver: the shapes for which closed forms are known."""

from __future__ import annotations

from dataclasses import dataclass
from math import perm
from typing import Any

from nonrigid.formulations.model import Applied, ElasticNet, Problem, QuadraticForm, Sense
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray


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


@dataclass(frozen=True, eq=False)
class TripleAssignment:
    """Hold min constant + weight * TripleDistortion(P) over injective maps P, weight > 0."""

    term: TripleDistortion
    weight: float
    constant: float

    @property
    def maps(self) -> int:
        """Number of injective maps."""
        k, n = self.term.shape
        return perm(n, k)


def triple_assignment(problem: Problem) -> TripleAssignment | str:
    """Return the problem as a triple assignment, or say in words what keeps it from being one."""
    found = _assignment_term(problem, PartialPermutation, TripleDistortion)
    if isinstance(found, str):
        return found
    if found.weight <= 0.0:
        return f"a positive weight, not {found.weight:g}"
    assert isinstance(found.term, TripleDistortion)
    return TripleAssignment(found.term, found.weight, problem.objective.constant)


@dataclass(frozen=True, eq=False)
class LinearAssignment:
    """Hold min constant + sum cost_ij P_ij over assignments P; the problem's weight lies in `cost`."""

    cost: FloatArray
    constant: float


def linear_assignment(problem: Problem) -> LinearAssignment | str:
    """Return the problem as a linear assignment, or say in words what keeps it from being one."""
    found = _assignment_term(problem, (Assignment, PartialPermutation), Linear)
    if isinstance(found, str):
        return found
    assert isinstance(found.term, Linear)
    return LinearAssignment(found.weight * found.term.coefficients, problem.objective.constant)


def _assignment_term(problem: Problem, sets: type | tuple[type, ...], kind: type) -> Applied | str:
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or len(problem.objective.terms) != 1:
        return "one variable and one term"
    if not isinstance(problem.memberships[0].set, sets):
        return f"an assignment matrix, not {problem.memberships[0]}"
    applied = problem.objective.terms[0]
    if not isinstance(applied.term, kind):
        return f"a term {kind.__name__}, not {applied}"
    return applied if problem.objective.sense is Sense.MINIMIZE else "a problem that minimizes"
