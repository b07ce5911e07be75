"""From a surface to free unknowns by squaring, for quasi-Newton methods that lose their memory at each bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applied, Membership, Objective, Problem, free
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim, Rewritten
from nonrigid.solvers.bridges.radial import OnRays, Radial
from nonrigid.solvers.judge import Values


@dataclass(frozen=True, eq=False)
class OfSquares:
    """Evaluate a term at the squares of its argument."""

    term: Any

    def value_and_gradient(self, *z: FloatArray) -> tuple[float, FloatArray]:
        """Return f(z * z) and its gradient 2 f' * z."""
        value, gradient = self.term.value_and_gradient(z[0] * z[0])
        return value, 2.0 * gradient * z[0]


@dataclass(frozen=True)
class Squares:
    """Replace u on a surface {x >= 0, gauge(x) = 1} by a free z with u = z^2 / gauge(z^2).

    Exact: z -> z^2 maps open sets to open sets of the orthant, so local optima correspond both ways. An entry that
    starts at zero has a zero derivative and stays there, so the start must be interior, as for the replicator.
    """

    name: str = "squares"
    claim: Claim = Claim.EXACT

    def obstacle(self, problem: Problem) -> str | None:
        """Return why squares cannot stand for points."""
        return Radial().obstacle(problem)

    def apply(self, problem: Problem) -> Rewritten:
        """Return the problem over free unknowns."""
        rays = Radial().apply(problem)
        terms = tuple(
            Applied(OfSquares(applied.term), applied.variables, applied.weight)
            if isinstance(applied.term, OnRays)
            else applied
            for applied in rays.problem.objective.terms
        )
        surfaces = {m.variable.name for m in problem.memberships if hasattr(m.set, "gauge_and_gradient")}
        memberships = tuple(
            Membership(m.variable, free()) if m.variable.name in surfaces else m for m in problem.memberships
        )
        objective = Objective(problem.objective.sense, terms, problem.objective.constant)

        def forward(values: Values) -> Values:
            return {key: np.sqrt(np.maximum(x, 0.0)) if key in surfaces else x for key, x in values.items()}

        def inverse(values: Values) -> Values:
            return rays.inverse({key: z * z if key in surfaces else z for key, z in values.items()})

        return Rewritten(Problem(problem.name, objective, *memberships), forward, inverse)
