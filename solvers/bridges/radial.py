"""From a surface to the unit box by scaling, for solvers that know bounds only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applied, Box, Membership, Objective, Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.judge import Values, restore


@dataclass(frozen=True, eq=False)
class OnRays:
    """Evaluate a term at y / gauge(y): constant along rays, so that bounds suffice."""

    term: Any
    surface: Any

    def value_and_gradient(self, *y: FloatArray) -> tuple[float, FloatArray]:
        """Return f(y / g) and its gradient (f' - (f'x) g') / g, with g the gauge of y and x = y / g.

        The origin, which lies on every ray, stands for the surface's center, as it does on the way back.
        """
        gauge, normal = self.surface.gauge_and_gradient(y[0])
        if gauge <= 0.0:
            return self.term.value_and_gradient(self.surface.center(y[0].shape))[0], np.zeros_like(y[0])
        x = y[0] / gauge
        value, gradient = self.term.value_and_gradient(x)
        return value, (gradient - float(gradient @ x) * normal) / gauge


@dataclass(frozen=True)
class Radial:
    """Replace u on a surface {x >= 0, gauge(x) = 1} by 0 <= y <= 1 with u = y / gauge(y).

    Exact: every ray meets the surface once, inside the box. The objective is flat along rays, which suits quasi-Newton
    methods and misleads interior-point ones; without the upper bound some drift outward, where gradients vanish.
    """

    name: str = "radial"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why rays cannot stand for points."""
        if problem.constraints:
            return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
        if not any(hasattr(member.set, "gauge_and_gradient") for member in problem.memberships):
            return "a variable on a simplex, elastic net or sphere"
        surfaces = {m.variable.name for m in problem.memberships if hasattr(m.set, "gauge_and_gradient")}
        for applied in problem.objective.terms:
            if len(applied.variables) > 1 and any(variable.name in surfaces for variable in applied.variables):
                return f"terms of one variable, and {applied} has {len(applied.variables)}"
        return None

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem over rays."""
        sets: dict[str, Any] = {member.variable.name: member.set for member in problem.memberships}
        terms = tuple(_on_rays(applied, sets) for applied in problem.objective.terms)
        memberships = tuple(
            Membership(m.variable, Box(0.0, 1.0) if hasattr(m.set, "gauge_and_gradient") else m.set)
            for m in problem.memberships
        )
        objective = Objective(problem.objective.sense, terms, problem.objective.constant)

        def inverse(values: Values) -> Values:
            return restore(problem, values)

        return Rewritten(Problem(problem.name, objective, *memberships), lambda values: values, inverse)


def _on_rays(applied: Applied, sets: dict[str, Any]) -> Applied:
    surface = sets[applied.variables[0].name]
    if not hasattr(surface, "gauge_and_gradient"):
        return applied
    return Applied(OnRays(applied.term, surface), applied.variables, applied.weight)
