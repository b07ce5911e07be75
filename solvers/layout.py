"""Variables of a problem laid out in one flat vector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.model import Problem, SmoothConstraint, Variable
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class FlatConstraint:
    """Hold c(x) = 0 or c(x) <= 0 over the flat vector of all variables."""

    name: str
    constraint: SmoothConstraint
    variable: Variable
    where: slice
    size: int

    def value_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c, (m,), and its Jacobian, (m, size)."""
        value, part = self.constraint.value_and_jacobian(x[self.where].reshape(self.variable.shape))
        jacobian = np.zeros((len(value), self.size))
        jacobian[:, self.where] = part
        return value, jacobian


@dataclass(frozen=True, eq=False)
class Layout:
    """Place each variable in a slice of a flat vector, in the order of the memberships.

    Examples
    --------
    >>> from nonrigid.formulations.model import Simplex, QuadraticForm, maximize
    >>> u = Variable("u", 2)
    >>> layout = Layout(Problem("game", maximize(QuadraticForm(np.eye(2))(u)), u @ Simplex()))
    >>> layout.split(np.array([0.5, 0.5]))
    {'u': array([0.5, 0.5])}
    """

    problem: Problem

    @property
    def size(self) -> int:
        """Length of the flat vector."""
        return sum(variable.size for variable in self.problem.variables)

    def slices(self) -> dict[str, slice]:
        """Return the place of each variable."""
        places, start = {}, 0
        for variable in self.problem.variables:
            places[variable.name] = slice(start, start + variable.size)
            start += variable.size
        return places

    def split(self, flat: FloatArray) -> dict[str, FloatArray]:
        """Return the variables' arrays."""
        places = self.slices()
        return {v.name: flat[places[v.name]].reshape(v.shape) for v in self.problem.variables}

    def join(self, values: Mapping[str, FloatArray]) -> FloatArray:
        """Return the flat vector."""
        parts = [np.asarray(values[v.name], dtype=float).ravel() for v in self.problem.variables]
        return np.concatenate(parts) if len(parts) > 1 else parts[0].copy()

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the flat lower and upper bounds."""
        pairs = [member.set.bounds(member.variable.shape) for member in self.problem.memberships]
        return np.concatenate([low.ravel() for low, _ in pairs]), np.concatenate([high.ravel() for _, high in pairs])

    def constraints(self) -> tuple[FlatConstraint, ...]:
        """Return the conditions of the sets beyond their bounds, and the named constraints."""
        places, size = self.slices(), self.size
        found = [
            FlatConstraint(str(member), condition, member.variable, places[member.variable.name], size)
            for member in self.problem.memberships
            for condition in member.set.constraints(member.variable.shape)
        ]
        found += [
            FlatConstraint(name, condition, variable, places[variable.name], size)
            for name, (variable, condition) in self.problem.constraints.items()
        ]
        return tuple(found)
