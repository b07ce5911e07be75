"""A lower bound on the step of partial functional maps in C: the dual of its convex part, for any multipliers."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from nonrigid.formulations.model import Problem
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.solvers.backends.native.reweighted import RobustRegression, robust_regression
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.solve import solve

_EPS = float(np.finfo(float).eps)
_FITTED = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
"""Residuals shorter than such a share of the longest count as zero; each gives a bound, and the highest is taken."""


@dataclass(frozen=True)
class ConvexDual:
    r"""Bound w ||C A - B||_{2,1} + ||C o W||_F^2 + penalties >= 0 from below, over all matrices C.

    For any Y whose columns are no longer than w, the data is at least <Y, C A - B>; then each entry of C can be
    minimized by itself:

        bound = -<Y, B> + sum_ij min over |c - C0_ij| <= rho of (Y A')_ij c + W_ij^2 c^2.

    Y comes from the residual of a reweighted solve C0, so an inexact solve gives a looser bound, never a wrong one. On
    columns that are fitted exactly the solve is slow to say so: several guesses of which these are give several Y. No
    minimizer C is farther from C0 than rho = 2 f(C0) / (w s), s the least singular value of A: the data at both is at
    most f(C0). A penalty of the Gram matrix is dropped, being nowhere negative, so the bound then holds, but is that of
    the convex part. Rounding of the sums is taken off.

    Source: Fenchel's inequality; the dual of the second-order cone program of the convex part.
    """

    reach: int = 10_000

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = _convex_part(problem)
        return found if isinstance(found, str) else None

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the bound of the multipliers that a reweighted solve ends with."""
        begun = time.perf_counter()
        convex = _convex_part(problem)
        assert isinstance(convex, Problem)
        limits = Limits(seconds=max(seconds, 0.01), evaluations=200, tolerance=1e-9)
        solution = solve(convex, "native:reweighted", limits=limits)
        regression = robust_regression(convex)
        assert isinstance(regression, RobustRegression)
        nothing = np.zeros(convex.variables[0].shape)  # any matrix gives a bound, also where no pass was ended in time
        found = solution.values.get(convex.variables[0].name, nothing)
        value = max(_dual_value(regression, found, fitted) for fitted in _FITTED)
        detail = f"convex part {solution.objective:.9g} by {solution.evaluations:.0f} passes"
        constant = problem.objective.constant
        return Bound(constant + value, "convex_dual", time.perf_counter() - begun, detail)


def _convex_part(problem: Problem) -> Problem | str:
    """Return the problem without its penalties, or say in words what the bound would need."""
    kept = tuple(
        applied
        for applied in problem.objective.terms
        if not (isinstance(applied.term, GramPenalty) and applied.weight >= 0.0)
    )
    objective = replace(problem.objective, terms=kept, constant=0.0)
    convex = Problem(problem.name, objective, *problem.memberships, constraints=problem.constraints)
    found = robust_regression(convex)
    return found if isinstance(found, str) else convex


def _dual_value(regression: RobustRegression, C: FloatArray, fitted: float) -> float:
    """Return the bound, rounding taken off; `fitted`: one of `_FITTED`."""
    A, B, w, W = regression.data.source, regression.data.target, regression.weight, regression.mask
    residual = C @ A - B
    lengths = np.linalg.norm(residual, axis=0)
    Y = _multipliers(regression, C, residual, lengths <= fitted * float(lengths.max(initial=0.0)))
    count = A.shape[1]
    slope = Y @ A.T
    doubt = 2.0 * count * _EPS * (np.abs(Y) @ np.abs(A).T)
    least = _least_singular_value(A)
    primal = w * float(lengths.sum()) + float(np.sum((C * W) ** 2))
    radius = 1.01 * 2.0 * primal / (w * least) if least > 0.0 else np.inf
    entries = _least_of_parabolas(np.abs(slope) + doubt, np.sign(slope), W, C, radius)
    linear = -float(np.sum(Y * B))
    rounding = 4.0 * (count * len(B) + C.size) * _EPS * (float(np.sum(np.abs(Y * B))) + float(np.abs(entries).sum()))
    value: float = linear + float(entries.sum()) - rounding
    return max(value, 0.0) if np.isfinite(value) else 0.0  # no term is negative


def _multipliers(regression: RobustRegression, C: FloatArray, residual: FloatArray, fitted: BoolArray) -> FloatArray:
    """Return columns no longer than the weight: along the residuals, and where these vanish to balance the rest.

    At the optimum Y A' + 2 C o W o W = 0; a column that is fitted exactly gives Y no direction of its own.
    """
    A, weight = regression.data.source, regression.weight
    shrink = weight * (1.0 - 4.0 * (len(residual) + 4) * _EPS)  # whatever the rounding
    lengths = np.linalg.norm(residual, axis=0)
    Y = residual * np.divide(shrink, lengths, out=np.zeros_like(lengths), where=~fitted)
    if fitted.any():
        rest = Y @ A.T + 2.0 * C * regression.mask**2
        Y[:, fitted] = np.linalg.lstsq(A[:, fitted], -rest.T, rcond=None)[0].T
        Y *= np.minimum(1.0, shrink / np.maximum(np.linalg.norm(Y, axis=0), 1e-300))
    return np.asarray(Y)


def _least_of_parabolas(slope: FloatArray, sign: FloatArray, W: FloatArray, C: FloatArray, radius: float) -> FloatArray:
    """Return the least of sign * slope * c + W^2 c^2 over c within `radius` of C, entry by entry; may be -inf."""
    centre = -sign * C  # in t = -sign c the parabola falls at t = 0: -slope t + W^2 t^2
    low, high = centre - radius, centre + radius
    square = W * W
    if not np.isfinite(radius):
        free = np.divide(slope * slope, 4.0 * square, out=np.full_like(square, np.inf), where=square > 0.0)
        return -np.where(slope > 0.0, free, 0.0)
    turning = np.divide(slope, 2.0 * square, out=np.full_like(square, np.inf), where=square > 0.0)
    t = np.clip(turning, low, high)
    return np.asarray(-slope * t + square * t * t)


def _least_singular_value(A: FloatArray) -> float:
    """Return a lower bound of the least |x'A| / |x|, 0 where A has not full row rank beyond rounding."""
    if A.shape[0] > A.shape[1]:
        return 0.0
    values = np.linalg.svd(A, compute_uv=False).tolist()
    doubt: float = 10.0 * max(A.shape) * _EPS * values[0]
    return max(float(values[-1]) - doubt, 0.0)


CERTIFICATE = ConvexDual()
