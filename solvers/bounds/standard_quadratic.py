"""The standard quadratic program: the largest x'Bx on the simplex, for any symmetric B."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nonrigid.formulations.model import Problem, QuadraticForm, Sense, Simplex, Variable, maximize
from nonrigid.formulations.model.gauge_sets import ElasticNet
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solve import solve


@dataclass(frozen=True, eq=False)
class StandardQuadratic:
    """Hold a problem whose objective is constant + sign * x'Bx with x'Bx to be maximized over a surface."""

    matrix: FloatArray
    sign: float
    constant: float
    surface: ElasticNet

    def objective(self, value: float) -> float:
        """Return the user's objective at x'Bx = value."""
        return self.constant + self.sign * value


def standard_quadratic(problem: Problem, *, simplex: bool = True, most: int | None = None) -> StandardQuadratic | str:
    """Return the problem in standard form, or say in words what it would need to be so.

    `most` is the largest number of strategies taken; `simplex=False` takes every elastic net.
    """
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or len(problem.objective.terms) != 1:
        return "one variable and one quadratic term"
    surface, applied = problem.memberships[0].set, problem.objective.terms[0]
    if not isinstance(surface, ElasticNet) or (simplex and surface.mix != 0.0):
        return f"a variable on {'a simplex' if simplex else 'a simplex, elastic net or sphere'}, not in {surface}"
    if not isinstance(applied.term, QuadraticForm):
        return f"a quadratic form, not {applied}"
    size = applied.term.matrix.shape[0]
    if most is not None and size > most:
        return f"at most {most} strategies, and the problem has {size}"
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    matrix: Any = applied.term.matrix
    dense = np.asarray(matrix if isinstance(matrix, np.ndarray) else matrix.toarray())
    dense = 0.5 * (dense + dense.T)  # what rounding left unequal, a shift could make large beside the rest
    return StandardQuadratic(sign * applied.weight * dense, sign, problem.objective.constant, surface)


@dataclass(frozen=True, eq=False)
class Reduced:
    """Hold the strategies that can be played at a maximum, and the value of a known point."""

    matrix: FloatArray
    kept: NDArray[np.intp]
    known: float
    point: FloatArray


def reduced(matrix: FloatArray) -> Reduced:
    """Drop strategies that no maximiser on the simplex plays.

    At a maximiser x every strategy played earns (Bx)_i = x'Bx, at least the value f of any known point, and at most
    max_j B_ij over the strategies kept: one whose largest payoff is below f is not played. f comes from local solves.
    """
    n = len(matrix)
    shift = min(float(matrix.min()), 0.0)
    u = Variable("u", n)
    game = Problem("game", maximize(QuadraticForm(matrix - shift)(u)), u @ Simplex())
    limits = Limits(seconds=None, evaluations=200, tolerance=1e-9)
    x = solve(game, "native", starts=5, limits=limits)["u"]
    known = float(x @ matrix @ x)
    margin = 1e-9 * max(1.0, float(np.abs(matrix).max()))
    kept = np.arange(n)
    while True:
        stay = matrix[np.ix_(kept, kept)].max(axis=1) >= known - margin
        if stay.all() or not stay.any():
            return Reduced(np.ascontiguousarray(matrix[np.ix_(kept, kept)]), kept, known, x[kept])
        kept = kept[stay]


def edge_limit(matrix: FloatArray) -> tuple[float, float]:
    """Return the largest entry off and on the diagonal: x'Bx <= off (1 - x'x) + on x'x, on the simplex."""
    off = matrix[~np.eye(len(matrix), dtype=bool)]
    on = float(np.diag(matrix).max())
    return (float(off.max()) if len(off) else on), on
