"""A problem: one objective, each variable in a set, and named constraints; plain data that names no solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import Applied, Curvature, ModelError, Sum
from nonrigid.formulations.model.variable import Membership, Variable
from nonrigid.geometry.arrays import FloatArray


class Sense(Enum):
    """Say whether the objective is sought large or small."""

    MINIMIZE = "minimize"
    MAXIMIZE = "maximize"


@dataclass(frozen=True, eq=False)
class Objective:
    """Hold a sum of weighted terms, a constant, and the sense in which it is sought."""

    sense: Sense
    terms: tuple[Applied, ...]
    constant: float = 0.0

    def value(self, values: Mapping[str, FloatArray]) -> float:
        """Return the objective in the user's own sense."""
        return self.constant + sum(term.value_and_gradient(values)[0] for term in self.terms)

    def value_and_gradient(self, values: Mapping[str, FloatArray]) -> tuple[float, dict[str, FloatArray]]:
        """Return the objective in the user's own sense, and its gradient by variable name."""
        total, gradient = self.constant, {name: np.zeros(np.shape(value)) for name, value in values.items()}
        for term in self.terms:
            value, parts = term.value_and_gradient(values)
            total += value
            for name, part in parts.items():
                gradient[name] += part
        return total, gradient


def maximize(expression: Applied | Sum) -> Objective:
    """State that an expression is sought large."""
    return Objective(Sense.MAXIMIZE, expression.terms if isinstance(expression, Sum) else (expression,))


def minimize(expression: Applied | Sum) -> Objective:
    """State that an expression is sought small."""
    return Objective(Sense.MINIMIZE, expression.terms if isinstance(expression, Sum) else (expression,))


@dataclass(frozen=True, eq=False)
class Problem:
    r"""State an optimization problem as functions in sets.

    Parameters
    ----------
    name
        Stage name under which a backend can be chosen for it.
    objective
        Made by `maximize` or `minimize`.
    memberships
        One `variable @ set` for each variable.
    constraints
        Named smooth constraints on one variable: name -> (variable, constraint).
    start
        Where the method that states the problem would begin, for some or all variables; a caller's own start wins.
    evaluations
        How many evaluations the method asks for, where it needs no exact answer; a caller's smaller limit wins.

    Raises
    ------
    ModelError
        If a variable of the objective has no set, or has two, or a start is no finite array of a variable's shape.

    Examples
    --------
    >>> from nonrigid.formulations.model import QuadraticForm, Simplex
    >>> u = Variable("u", 2)
    >>> game = Problem("game", maximize(QuadraticForm(np.array([[0.0, 1.0], [1.0, 0.0]]))(u)), u @ Simplex())
    >>> print(game)
    game: maximize QuadraticForm(u)
      subject to u in Simplex()
      with u of shape (2,)
    >>> print(game.latex())
    \max_{u}\; u^\top A u \quad\text{s.t.}\quad u \ge 0,\ 1^\top u = 1
    """

    name: str
    objective: Objective
    memberships: tuple[Membership, ...]
    constraints: Mapping[str, tuple[Variable, SmoothConstraint]] = field(default_factory=lambda: MappingProxyType({}))
    start: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    evaluations: int | None = None

    def __init__(
        self,
        name: str,
        objective: Objective,
        *memberships: Membership,
        constraints: Mapping[str, tuple[Variable, SmoothConstraint]] | None = None,
        start: Mapping[str, FloatArray] | None = None,
        evaluations: int | None = None,
    ) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "objective", objective)
        object.__setattr__(self, "memberships", memberships)
        object.__setattr__(self, "constraints", dict(constraints or {}))
        object.__setattr__(self, "start", dict(start or {}))
        object.__setattr__(self, "evaluations", evaluations)
        names = [variable.name for variable in self.variables]
        if len(set(names)) < len(names):
            raise ModelError(f"problem {name!r} puts a variable into two sets: {names}; intersect them or rename one")
        used = {variable.name for term in objective.terms for variable in term.variables}
        used |= {variable.name for variable, _ in self.constraints.values()}
        if missing := sorted(used - set(names)):
            raise ModelError(f"problem {name!r} uses {missing} but puts them in no set; add `{missing[0]} @ free()`")
        shapes = {variable.name: variable.shape for variable in self.variables}
        named = [variable for variable, _ in self.constraints.values()]
        for variable in [*(v for term in objective.terms for v in term.variables), *named]:
            if variable.shape != shapes[variable.name]:
                shown = f"{variable.shape} in a term or constraint, {shapes[variable.name]} in its set"
                raise ModelError(f"problem {name!r} has {variable.name!r} of shape {shown}; use one variable in both")
        for key, value in self.start.items():
            if shapes.get(key) != np.shape(value) or not np.isfinite(value).all():
                given = f"{key!r} of shape {np.shape(value)}"
                raise ModelError(f"problem {name!r} starts at {given}; give finite arrays of shapes {shapes}")
        if evaluations is not None and evaluations < 1:
            raise ModelError(f"problem {name!r} asks for {evaluations} evaluations; ask for one at least, or None")

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables, in the order of the memberships."""
        return tuple(membership.variable for membership in self.memberships)

    @property
    def curvature(self) -> Curvature:
        """Curvature of the function to be minimized, from the declared curvature of its terms."""
        sign = 1.0 if self.objective.sense is Sense.MINIMIZE else -1.0
        kinds = {(term * sign).curvature for term in self.objective.terms} - {Curvature.AFFINE}
        if not kinds:
            return Curvature.AFFINE
        return kinds.pop() if len(kinds) == 1 else Curvature.UNKNOWN

    def fix(self, **values: FloatArray) -> Problem:
        """Return the problem in the other variables, with the named ones constant.

        Raises `ModelError` if a name is not a variable, a value has another shape, or no variable would be left.
        """
        known = {variable.name for variable in self.variables}
        if unknown := sorted(set(values) - known):
            raise ModelError(f"problem {self.name!r} has no variable {unknown[0]!r}; it has {sorted(known)}")
        if not known - set(values):
            raise ModelError(f"problem {self.name!r}: fixing every variable leaves nothing to solve")
        for variable in self.variables:
            if variable.name in values and np.shape(values[variable.name]) != variable.shape:
                given = np.shape(values[variable.name])
                raise ModelError(f"{variable.name!r} is fixed at an array of shape {given}; it has {variable.shape}")
        constant = self.objective.constant
        constant += sum(term.value_and_gradient(values)[0] for term in self.objective.terms if _within(term, values))
        free = tuple(term.fix(values) for term in self.objective.terms if not _within(term, values))
        memberships = tuple(member for member in self.memberships if member.variable.name not in values)
        constraints = {key: item for key, item in self.constraints.items() if item[0].name not in values}
        objective = replace(self.objective, terms=free, constant=constant)
        start = {key: value for key, value in self.start.items() if key not in values}
        return Problem(
            self.name, objective, *memberships, constraints=constraints, start=start, evaluations=self.evaluations
        )

    def stage(
        self, name: str, *, start: Mapping[str, FloatArray] | None = None, evaluations: int | None = None
    ) -> Problem:
        """Return the same problem under another name, with its own start and number of evaluations.

        The objective's constant is left out: beside a large one every relative tolerance would be met at once.
        """
        return Problem(
            name,
            replace(self.objective, constant=0.0),
            *self.memberships,
            constraints=self.constraints,
            start=start,
            evaluations=evaluations,
        )

    def latex(self) -> str:
        """Return the problem as one display of LaTeX."""
        verb = "max" if self.objective.sense is Sense.MAXIMIZE else "min"
        names = ", ".join(variable.name for variable in self.variables)
        formula = self._sum([term.latex() for term in self.objective.terms])
        sets = [member.set.latex(member.variable.name) for member in self.memberships]
        limits = r",\ ".join(
            [text for text in sets if text] + [rf"\text{{{_escaped(name)}}}" for name in self.constraints]
        )
        return rf"\{verb}_{{{names}}}\; {formula}" + (rf" \quad\text{{s.t.}}\quad {limits}" if limits else "")

    def _sum(self, terms: list[str]) -> str:
        constant = self.objective.constant
        parts = [*terms, f"{constant:g}"] if constant or not terms else terms
        return " + ".join(parts).replace("+ -", "- ")

    def __str__(self) -> str:
        formula = self._sum([str(term) for term in self.objective.terms])
        sets = ", ".join(str(member) for member in self.memberships)
        shapes = ", ".join(f"{variable.name} of shape {variable.shape}" for variable in self.variables)
        named = "".join(f"\n  and {name}" for name in self.constraints)
        return f"{self.name}: {self.objective.sense.value} {formula}\n  subject to {sets}{named}\n  with {shapes}"


def _escaped(name: str) -> str:
    return name.replace("_", r"\_")


def _within(term: Applied, values: Mapping[str, FloatArray]) -> bool:
    return all(variable.name in values for variable in term.variables)
