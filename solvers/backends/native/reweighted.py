"""Iteratively reweighted least squares for the convex part of the functional-map step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle


@dataclass(frozen=True, eq=False)
class RobustRegression:
    """Hold min w ||C A - B||_{2,1} + ||C o W||_F^2 over all matrices C, the weight of the squares within W."""

    data: GroupNorm21
    weight: float
    mask: FloatArray


def robust_regression(problem: Problem) -> RobustRegression | str:
    """Return the problem as a robust regression, or say in words what keeps it from being one."""
    wanted = "one free matrix, ||C A - B||_{2,1} and at most one ||C o W||_F^2, minimized"
    objective = problem.objective
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or objective.sense is Sense.MAXIMIZE:
        return wanted
    low, high = problem.memberships[0].set.bounds(problem.variables[0].shape)
    data = [applied for applied in objective.terms if isinstance(applied.term, GroupNorm21)]
    squares = [applied for applied in objective.terms if isinstance(applied.term, WeightedSquares)]
    counted = len(data) == 1 and len(squares) <= 1 and len(data) + len(squares) == len(objective.terms)
    if not counted or any(applied.weight <= 0.0 for applied in objective.terms):
        return f"{wanted}, not {' + '.join(str(applied) for applied in objective.terms)}"
    if np.isfinite(low).any() or np.isfinite(high).any() or problem.memberships[0].set.constraints(low.shape):
        return f"{wanted}, not {problem.memberships[0]}"
    mask = np.zeros(low.shape)
    for applied in squares:
        assert isinstance(applied.term, WeightedSquares)
        mask = np.sqrt(applied.weight) * np.broadcast_to(applied.term.mask, low.shape)
    assert isinstance(data[0].term, GroupNorm21)
    return RobustRegression(data[0].term, data[0].weight, mask)


def reweighted(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Solve least squares with each column weighted by the inverse of its last residual norm, again and again.

    With weights fixed the rows c_i of C decouple: c_i (w A D A' + 2 diag(W_i^2)) = w b_i D A', D = diag(1 / |r_j|).
    Each pass minimizes a quadratic that lies above the objective and touches it at the last point: it never rises.

    Source: Daubechies, DeVore, Fornasier and Gunturk, iteratively reweighted least squares (CPAM 2010).
    """
    regression = robust_regression(oracle.problem)
    assert isinstance(regression, RobustRegression)
    source, target, weight = regression.data.source, regression.data.target, regression.weight
    diagonal = np.arange(len(source))
    x = start
    value, gradient = oracle.value_and_gradient(x)
    while np.max(np.abs(gradient)) > 0.1 * limits.tolerance * max(1.0, abs(value)):
        lengths = np.linalg.norm(x.reshape(regression.mask.shape) @ source - target, axis=0)
        scaled = source * (weight / np.maximum(lengths, max(1e-9 * float(lengths.max()), 1e-150)))
        systems = np.broadcast_to(scaled @ source.T, (len(target), len(source), len(source))).copy()
        systems[:, diagonal, diagonal] += 2.0 * regression.mask**2
        rows = _solved(systems, (target @ scaled.T)[:, :, None])[:, :, 0]
        moved = rows.ravel()
        fresh, gradient = oracle.value_and_gradient(moved)
        if fresh >= value:
            return x, "no descent beyond rounding"
        x, value = moved, fresh
    return x, "gradient below tolerance"


def _solved(systems: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solutions of symmetric systems, those of least norm where one is singular: too few descriptors."""
    try:
        return np.asarray(np.linalg.solve(systems, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(systems, rcond=1e-12, hermitian=True) @ right)
