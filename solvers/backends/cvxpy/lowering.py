"""A problem's sets and terms as CVXPY expressions, and its flat vector as CVXPY variables."""

from __future__ import annotations

import warnings
from typing import Any

import cvxpy
import numpy as np

from nonrigid.formulations.model import Applied, Curvature, Problem, Sense, Variable
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.solvers.backends.cvxpy.ops import CvxpyOps
from nonrigid.solvers.capability import too_many_conditions
from nonrigid.solvers.layout import Layout
from nonrigid.solvers.oracle import Oracle

cp: Any = cvxpy  # its types are incomplete


class Lowered:
    """Hold the CVXPY variables and constraints of a problem, and pass flat vectors to and fro."""

    def __init__(self, oracle: Oracle) -> None:
        self.layout = oracle.layout
        self.problem = oracle.problem
        self.sign = 1.0 if self.problem.objective.sense is Sense.MINIMIZE else -1.0
        self.variables: dict[str, Any] = {
            m.variable.name: _variable(m.variable, integral_entries(m.set, m.variable.shape))
            for m in self.problem.memberships
        }
        self.constraints = [row for member in self.problem.memberships for row in self._membership(member)]
        for variable, condition in self.problem.constraints.values():
            self.constraints.append(self._affine(variable, condition))

    def term(self, applied: Applied) -> Any:
        """Return a weighted term as it stands in the function to be minimized."""
        term: Any = applied.term
        arguments = [self.variables[variable.name] for variable in applied.variables]
        return self.sign * applied.weight * term.lower(*arguments, CvxpyOps())

    def objective(self) -> Any:
        """Return the function to be minimized, its constant left out."""
        return sum(self.term(applied) for applied in self.problem.objective.terms)

    def linear(self) -> tuple[Any, dict[str, Any]]:
        """Return a linear form in all variables and its coefficients as parameters."""
        slopes = {name: cp.Parameter(variable.shape) for name, variable in self.variables.items()}
        return sum(cp.sum(cp.multiply(slopes[name], self.variables[name])) for name in slopes), slopes

    def squares(self) -> Any:
        """Return the sum of the squares of all unknowns."""
        return sum(cp.sum_squares(variable) for variable in self.variables.values())

    def set(self, flat: FloatArray) -> None:
        """Give the variables their values."""
        for name, value in self.layout.split(flat).items():
            self.variables[name].value = value

    def point(self) -> FloatArray | None:
        """Return the variables' values, None where a solver left none; those in no term or constraint have none."""
        values = {name: variable.value for name, variable in self.variables.items()}
        if all(value is None for value in values.values()):
            return None
        for member in self.problem.memberships:
            if values[member.variable.name] is None:
                values[member.variable.name] = member.set.center(member.variable.shape)
        return self.layout.join(values)

    def _membership(self, member: Any) -> list[Any]:
        variable = self.variables[member.variable.name]
        if hasattr(member.set, "lower"):
            return list(member.set.lower(variable, CvxpyOps()))
        low, high = member.set.bounds(member.variable.shape)
        rows = [
            variable[np.isfinite(low)] >= low[np.isfinite(low)],
            variable[np.isfinite(high)] <= high[np.isfinite(high)],
        ]
        linear = member.set.constraints(member.variable.shape)
        return [row for row in rows if row.size] + [self._affine(member.variable, item) for item in linear]

    def _affine(self, variable: Any, condition: Any) -> Any:
        offset, jacobian = condition.value_and_jacobian(np.zeros(variable.shape))
        expression = jacobian @ cp.vec(self.variables[variable.name], order="C") + offset
        return expression == 0 if condition.kind == "equal" else expression <= 0


def solve_quietly(program: Any, **options: Any) -> str:
    """Solve a CVXPY program and return its status; a solver that fails is a status, a doubt of CVXPY's no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            program.solve(**options)
        except cp.error.SolverError as failure:
            return f"solver error: {failure}"
    return str(program.status)


def is_convex(problem: Problem) -> bool:
    """Whether a problem declares itself convex and offers its formulas, so that one solve can answer it."""
    return problem.curvature in (Curvature.CONVEX, Curvature.AFFINE) and all(
        hasattr(applied.term, "lower") for applied in problem.objective.terms
    )


def keeps(applied: Applied, sign: float) -> bool:
    """Whether a term may stay as it is in a convex model: declared convex, with its formula."""
    return hasattr(applied.term, "lower") and (sign * applied).curvature is Curvature.CONVEX


def set_obstacle(problem: Problem, *, quadratic: bool, integral: bool = False) -> str | None:
    """Return why sets or constraints cannot be handed to CVXPY.

    `quadratic` where the solver takes curved ones, `integral` where it branches.
    """
    large = too_many_conditions(problem)
    if large is not None:
        return large
    for name, (_, condition) in problem.constraints.items():
        if not condition.linear:
            return f"CVXPY cannot see into the curved constraint {name!r}; use casadi:ipopt"
    for member in problem.memberships:
        curved = not all(condition.linear for condition in member.set.constraints(member.variable.shape))
        if curved and not hasattr(member.set, "lower"):
            return f"CVXPY needs the formula of {member.set}, which has no `lower`; use casadi:ipopt"
        if curved and not quadratic:
            return f"it takes linear constraints only, and {member.set} is curved; use CLARABEL or SCS"
    whole = sum(int(integral_entries(m.set, m.variable.shape).sum()) for m in problem.memberships)
    if whole and not integral:
        return f"it cannot branch, and {whole} entries are integral; use casadi:bonmin or cvxpy:HIGHS"
    if whole and not (problem.curvature is Curvature.AFFINE and is_convex(problem)):
        return f"it branches on linear objectives only, and {problem.name!r} has {whole} integral entries and another"
    return None


def _variable(variable: Variable, integral: BoolArray) -> Any:
    if integral.all():
        return cp.Variable(variable.shape, name=variable.name, boolean=True)
    return cp.Variable(variable.shape, name=variable.name, boolean=np.nonzero(integral) if integral.any() else False)


def size_of(problem: Problem) -> int:
    """Return the number of unknowns."""
    return Layout(problem).size
