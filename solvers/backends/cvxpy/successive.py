"""Successive convexification: convex terms kept, the rest linearised, steps held near by a proximal term."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cvxpy
import numpy as np

from nonrigid.formulations.model import Applied
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.cvxpy.lowering import Lowered, keeps, solve_quietly
from nonrigid.solvers.backends.cvxpy.settings import CONIC, convex_options
from nonrigid.solvers.judge import restore
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle

cp: Any = cvxpy  # its types are incomplete

_GROWTH, _FADE = 4.0, 0.25  # factors of the proximal weight after a step refused, and its least after one accepted
_LEAST = 1e-3  # least proximal weight, in terms of the first: smaller ones scale the inner problem badly
_PATIENCE = 8  # refused steps in a row after which the inner solver's accuracy is spent


@dataclass(frozen=True, eq=False)
class _Step:
    """Hold a point tried: its step d, and how much the kept and linearised parts say the objective falls."""

    point: FloatArray
    d: FloatArray
    fall: float


class _Model:
    """Minimize kept(y) / s + (g / s - x)'y + |y|^2 / 2 over the sets: compiled once, re-solved with new vectors.

    Dividing by the proximal weight s leaves the quadratic part constant where no term is kept.
    """

    def __init__(self, lowered: Lowered, oracle: Oracle, algorithm: str, limits: Limits) -> None:
        self.oracle, self.algorithm, self.limits, self.lowered = oracle, algorithm, limits, lowered
        self.kept: list[Applied] = []
        linear, self.slopes = lowered.linear()
        objective = linear + 0.5 * lowered.squares()
        self.inverse = cp.Parameter(nonneg=True)
        for applied in oracle.problem.objective.terms:
            if keeps(applied, lowered.sign) and _takes(algorithm, expression := lowered.term(applied)):
                self.kept.append(applied)
                objective = objective + self.inverse * expression
        self.status = "not solved"
        constraints = lowered.constraints
        if algorithm == "SCS" and not constraints:  # it takes no program without rows
            unused = cp.Variable()
            objective, constraints = objective + unused, [unused >= 0]
        self.program = cp.Problem(cp.Minimize(objective), constraints)

    def compile(self, x: FloatArray) -> None:
        """Translate the program once, so that the solves only exchange vectors."""
        self._place(x, np.zeros_like(x), 1.0)
        self.program.get_problem_data(getattr(cp, self.algorithm), solver_opts={})

    def kept_value_and_gradient(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return the part of the objective that is kept as it is, and its gradient."""
        layout, sign = self.lowered.layout, self.lowered.sign
        values = layout.split(x)
        total, gradient = 0.0, {name: np.zeros_like(value) for name, value in values.items()}
        for applied in self.kept:
            value, parts = applied.value_and_gradient(values)
            total += sign * value
            for name, part in parts.items():
                gradient[name] += sign * part
        return total, layout.join(gradient)

    def step(self, x: FloatArray, gradient: FloatArray, weight: float) -> _Step | None:
        """Return the minimizer of the model at x, brought exactly onto the sets; None where the solver has none."""
        kept, kept_gradient = self.kept_value_and_gradient(x)
        rest = gradient - kept_gradient
        self._place(x, rest, weight)
        seconds = self.limits.seconds
        left = None if seconds is None else seconds - self.oracle.seconds
        options = convex_options(self.algorithm, self.limits, left)
        self.status = solve_quietly(self.program, solver=self.algorithm, warm_start=True, **options)
        found = self.lowered.point()
        if self.status.startswith("solver error") or found is None or not np.isfinite(found).all():
            return None
        layout = self.lowered.layout
        point = layout.join(restore(self.lowered.problem, layout.split(found)))
        d = point - x
        return _Step(point, d, kept - self.kept_value_and_gradient(point)[0] - float(rest @ d))

    def _place(self, x: FloatArray, rest: FloatArray, weight: float) -> None:
        self.inverse.value = 1.0 / weight
        for name, value in self.lowered.layout.split(rest / weight - x).items():
            self.slopes[name].value = value


def _takes(algorithm: str, expression: Any) -> bool:
    """Whether a solver takes an expression within its convex model: solvers of quadratic programs know no cones."""
    return bool(expression.is_convex() and (algorithm in CONIC or expression.is_quadratic()))


def successive(
    lowered: Lowered, oracle: Oracle, start: FloatArray, algorithm: str, limits: Limits
) -> tuple[FloatArray, str]:
    """Step to the minimizer of the convex model, and keep steps that do not worsen the objective.

    The proximal weight grows after a step refused; after one accepted it follows the curvature met along the step.
    Ends when both the fall that the model predicts and the proximal force meet the tolerance.
    """
    model = _Model(lowered, oracle, algorithm, limits)
    layout = lowered.layout
    x = layout.join(restore(lowered.problem, layout.split(start)))
    model.compile(x)
    oracle.built()
    value, gradient = oracle.value_and_gradient(x)
    weight = max(float(np.linalg.norm(gradient)), 1e-8)
    least = _LEAST * weight
    refused = 0
    while True:
        step = model.step(x, gradient, weight)
        if step is None:
            oracle.charge(0.0)  # raises where it was the clock that stopped the inner solver
            if refused >= _PATIENCE:
                return x, f"{algorithm}: {model.status}"
            weight, refused = _GROWTH * weight, refused + 1
            continue
        length = float(np.linalg.norm(step.d))
        enough = 0.1 * limits.tolerance * max(1.0, abs(value))
        if step.fall <= enough and weight * length <= enough:
            return x, f"{algorithm}: {model.status}; predicted fall {step.fall:.1e}"
        if refused >= _PATIENCE:
            return x, f"{algorithm}: {model.status}; {refused} steps in a row did not improve"
        new_value, new_gradient = oracle.value_and_gradient(step.point)
        if new_value <= value:
            weight = max(_after_success(model, x, step, gradient, new_gradient, weight), least)
            x, value, gradient, refused = step.point, new_value, new_gradient, 0
        else:
            weight, refused = _GROWTH * weight, refused + 1


def _after_success(
    model: _Model, x: FloatArray, step: _Step, gradient: FloatArray, new_gradient: FloatArray, weight: float
) -> float:
    before, after = (model.kept_value_and_gradient(point)[1] for point in (x, step.point))
    change = (new_gradient - after) - (gradient - before)
    square = float(step.d @ step.d)
    curvature = float(step.d @ change) / square if square > 0.0 else 0.0
    return float(np.clip(curvature, _FADE * weight, 2.0 * weight))
