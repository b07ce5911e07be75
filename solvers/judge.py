"""The package's own measurement of a point: restored exactly onto its sets, then judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model import Curvature, Problem, Sense
from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.solvers.layout import Layout

Values = Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Judgement:
    """Hold a restored point with its objective (user's sense), violation and stationarity."""

    values: dict[str, FloatArray]
    objective: float
    violation: float
    stationarity: float


def restore(problem: Problem, values: Values) -> dict[str, FloatArray]:
    """Return the values, each brought exactly onto its set."""
    return {m.variable.name: m.set.restore(np.asarray(values[m.variable.name], float)) for m in problem.memberships}


def violation(problem: Problem, values: Values) -> float:
    """Return the largest violation of a set or named constraint."""
    sets = [member.set.violation(values[member.variable.name]) for member in problem.memberships]
    named = [condition.violation(values[variable.name]) for variable, condition in problem.constraints.values()]
    worst = float(np.max(sets + named))
    return np.inf if np.isnan(worst) else worst


def judge(problem: Problem, values: Values) -> Judgement:
    """Restore a point and measure it.

    Stationarity is, per variable and summed: where the set (or its convex body) has a closed-form linear maximiser, the
    Frank-Wolfe gap max_s g'(s - x) with g the gradient of the function maximized, in units of the objective; where the
    set has only a projection, see `_projected_residual`; where named constraints stand in the problem, the largest
    entry of a KKT residual with multipliers by least squares (an upper bound of the smallest one).

    On a surface that is not convex, under an objective that is not affine, a local optimum may have a gap over the
    convex hull: there the largest slope along the surface counts, if that is less; on an elastic net only where the
    gradient does not point outward.
    """
    point = restore(problem, values)
    objective, gradient = problem.objective.value_and_gradient(point)
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    if not all(np.isfinite(part).all() for part in gradient.values()):
        return Judgement(point, objective, violation(problem, point), np.inf)
    if problem.constraints or not all(_closed_form(member.set) for member in problem.memberships):
        residual = kkt_residual(problem, point)
    else:
        curved = problem.curvature is not Curvature.AFFINE
        residual = sum(
            _set_residual(m.set, point[m.variable.name], sign * gradient[m.variable.name], curved=curved)
            for m in problem.memberships
        )
    return Judgement(point, objective, violation(problem, point), residual)


def _closed_form(set_: Any) -> bool:
    return hasattr(set_, "linear_max") or hasattr(set_, "project")


def _set_residual(set_: Any, x: FloatArray, ascent: FloatArray, *, curved: bool) -> float:
    if not hasattr(set_, "linear_max"):
        return _projected_residual(set_, x, ascent)
    best = set_.linear_max(ascent)
    gap = max(float(np.sum(ascent * best) - np.sum(ascent * x)), 0.0)
    along = set_.slope_along(x, ascent) if curved and not set_.convex and hasattr(set_, "slope_along") else None
    return gap if along is None else min(gap, float(along))


def _projected_residual(set_: Any, x: FloatArray, ascent: FloatArray) -> float:
    """Return the largest entry of |P(x + s g) - x| with s the largest entry of |x|, at least 1, or of g times the room.

    A length has to be seen beside the point's own, or an objective without a bound is flat enough once it is large;
    and a box of width w holds any step to w, so that there, where w < 1, what the step would gain counts too.
    """
    length = max(1.0, float(np.abs(x).max(initial=0.0)))
    moved = float(np.max(np.abs(set_.project(x + length * ascent) - x), initial=0.0))
    lower, upper = set_.bounds(x.shape)
    room = np.minimum(np.where(ascent > 0.0, upper - x, x - lower), 1.0)
    return max(moved, float(np.max(np.abs(ascent) * room, initial=0.0)))


def kkt_residual(problem: Problem, point: Values) -> float:
    """Return the largest entry of a KKT residual, from bounds and constraints alone, multipliers by least squares."""
    layout = Layout(problem)
    sign = 1.0 if problem.objective.sense is Sense.MINIMIZE else -1.0
    x, g = layout.join(point), sign * layout.join(problem.objective.value_and_gradient(point)[1])
    lower, upper = layout.bounds()
    near = 1e-8 * np.maximum(1.0, np.abs(x))
    at_lower, at_upper = x - lower <= near, upper - x <= near
    rows, signed = [], []
    for item in layout.constraints():
        value, jacobian = item.value_and_jacobian(x)
        active = np.ones(len(value), bool) if item.constraint.kind == "equal" else value >= -1e-8
        rows.append(jacobian[active])
        signed.append(np.full(int(active.sum()), item.constraint.kind == "at most"))
    A = np.vstack(rows) if rows else np.zeros((0, len(x)))
    one_sided = np.concatenate(signed) if signed else np.zeros(0, bool)
    guesses = [np.zeros(len(A))]
    # Entries at a bound say nothing of the multipliers, unless the bound is implied by a constraint (a vertex of the
    # simplex, where an entry is 1): each choice of entries gives an upper bound of the residual, the least one is kept.
    for told in (~(at_lower | at_upper), ~at_lower, ~at_upper) if len(A) else ():
        if told.any():
            found = np.linalg.lstsq(A[:, told].T, -g[told], rcond=None)[0]
            guesses.append(np.where(one_sided, np.maximum(found, 0.0), found))
    return min(_slope(g + A.T @ multipliers, at_lower, at_upper) for multipliers in guesses)


def _slope(slope: FloatArray, at_lower: BoolArray, at_upper: BoolArray) -> float:
    slope = np.where(at_lower, np.minimum(slope, 0.0), slope)
    slope = np.where(at_upper, np.maximum(slope, 0.0), slope)
    return float(np.max(np.abs(np.where(at_lower & at_upper, 0.0, slope)), initial=0.0))
