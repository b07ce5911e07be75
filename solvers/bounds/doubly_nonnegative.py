"""The doubly nonnegative relaxation: the tightest bound on a quadratic game that a minute buys, to n = 500."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh, eigvalsh

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.bounds.standard_quadratic import (
    Reduced,
    edge_limit,
    reduced,
    standard_quadratic,
)
from nonrigid.solvers.solution import Bound

_MOST = 1500
_CHECK_EVERY = 20
_RELAXATION = 1.85  # of the two cones' steps; measured: 1.6 needs a quarter more iterations


@dataclass(frozen=True)
class DoublyNonnegative:
    r"""Bound x'Bx on the simplex by max <B, X> over X psd, X >= 0, <J, X> = 1, with J all ones.

    Solved by the alternating direction method of multipliers between the two cones. Its multipliers give at any moment
    N >= 0 and a number l; with S = l J - B - N and e = max(0, -lambda_min(S)) every x on the simplex has
    x'Bx <= l + e x'x and x'Bx <= off (1 - x'x) + on x'x, off and on the largest entries off and on the diagonal: the
    smaller of the two, at the worst x'x, is the bound. It holds however inexact the multipliers are; rounding of the
    eigenvalue is added.

    Parameters
    ----------
    iterations
        Largest number of iterations.
    tolerance
        Gap to a locally found value, relative to max(1, |value|), at which to stop.

    Source: Bomze, Dur, de Klerk, Roos, Quist and Terlaky, on copositive programming and standard quadratic optimization
    problems (J. Global Optim. 2000); safe bound as in Jansson, Chaykin and Keil (SIAM J. Numer. Anal. 2007).
    """

    iterations: int = 100_000
    tolerance: float = 1e-8
    reach: int = 800

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = standard_quadratic(problem, most=_MOST)
        return found if isinstance(found, str) else None

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the best bound reached."""
        begun = time.perf_counter()
        game = standard_quadratic(problem)
        assert not isinstance(game, str)
        start = reduced(game.matrix)
        value, count = _ascend(start, self.iterations, self.tolerance, begun + seconds)
        detail = (
            f"{count} iterations on {len(start.kept)} of {len(game.matrix)} strategies, known value {start.known:.9g}"
        )
        return Bound(game.objective(value), "doubly_nonnegative", time.perf_counter() - begun, detail)


def _ascend(start: Reduced, iterations: int, tolerance: float, deadline: float) -> tuple[float, int]:
    """Run the splitting in units of the largest payoff; return the bound and the number of iterations."""
    scale = max(float(np.abs(start.matrix).max()), 1e-300)
    B, n = start.matrix / scale, len(start.matrix)
    best = float(B.max())
    target = (start.known + tolerance * max(1.0, abs(start.known))) / scale
    Y = np.outer(start.point, start.point)
    U, penalty, level, rank, count = np.zeros((n, n)), n / 4.0, -np.inf, n, 0
    for count in range(1, iterations + 1):
        X, rank = _positive_part(Y - U, rank)
        Z = _RELAXATION * X + (1.0 - _RELAXATION) * Y + U + B / penalty
        level = _water_level(Z, level)
        new = np.maximum(Z - level, 0.0)
        U = Z - B / penalty - new
        last = count == iterations or time.perf_counter() > deadline
        if last or count % _CHECK_EVERY == 0:
            best = min(best, _safe_bound(B, penalty * level, penalty * U))
            primal = float(np.linalg.norm(X - new)) / float(np.linalg.norm(new))
            dual = float(np.linalg.norm(new - Y)) / max(float(np.linalg.norm(U)), 1e-300)
            if last or best <= target or max(primal, dual) < 1e-10:
                break
            factor = 1.5 if primal > 5.0 * dual else 1.0 / 1.5 if dual > 5.0 * primal else 1.0
            penalty, level, U = penalty * factor, level / factor, U / factor
        Y = new
    return scale * best, count


def _positive_part(matrix: FloatArray, rank: int) -> tuple[FloatArray, int]:
    """Return the nearest positive semidefinite matrix and its rank; a guess of the rank saves most of the work."""
    n = len(matrix)
    wanted = rank + 3
    while wanted <= 0.3 * n:
        values, vectors = eigh(matrix, subset_by_index=(n - wanted, n - 1), driver="evr", check_finite=False)
        if values[0] <= 0.0:
            break
        wanted *= 2
    else:
        values, vectors = np.linalg.eigh(matrix)
    kept = values > 0.0
    return (vectors[:, kept] * values[kept]) @ vectors[:, kept].T, int(kept.sum())


def _water_level(z: FloatArray, level: float) -> float:
    """Return t with sum max(0, z - t) = 1, by Newton's method from a guess: finitely many steps, from the left."""
    top = float(z.max())
    level = level if top - 1.0 < level < top else top - 1.0
    for _ in range(200):
        above = z[z > level]
        new = (float(above.sum()) - 1.0) / len(above) if len(above) else top - 1.0
        if abs(new - level) <= 1e-15 * max(1.0, abs(level)):
            return new
        level = new
    return level


def _safe_bound(B: FloatArray, level: float, slack: FloatArray) -> float:
    """Return the bound proved by any level l and any estimate of S; see the class."""
    n = len(B)
    off, on = edge_limit(B)
    N = np.maximum(level - B - slack, 0.0)
    S = level - B - 0.5 * (N + N.T)
    error = n * float(np.finfo(float).eps) * float(np.linalg.norm(S))
    e = max(0.0, error - float(eigvalsh(S, subset_by_index=(0, 0), check_finite=False)[0]))
    if on >= off:  # both lines rise with x'x, so the worst is x'x = 1
        return min(level + e, on)
    if level >= off:
        return off
    return level + e * min(1.0, (off - level) / (off - on + e))


CERTIFICATE = DoublyNonnegative()
