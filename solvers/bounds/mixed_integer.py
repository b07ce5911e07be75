"""The equilibrium conditions as a mixed-integer program: exact on quadratic games to 60 or 80 strategies."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.bounds.clique import colour_classes
from nonrigid.solvers.bounds.standard_quadratic import reduced, standard_quadratic
from nonrigid.solvers.solution import Bound

_MOST = 400


@dataclass(frozen=True)
class MixedInteger:
    r"""Bound x'Bx on the simplex by max l with (Bx)_i <= l <= (Bx)_i + M_i (1 - z_i), 0 <= x <= z, 1'x = 1, z binary.

    At a maximiser every strategy played earns l = x'Bx and none earns more. Strategies i, j with
    B_ii + B_jj >= 2 B_ij need not be played together: along e_i - e_j the objective is convex. HiGHS proves its dual
    bound in floating point, with reduced costs held to 1e-7: 5e-7 of the largest payoff is added to it.

    Source: Xia, Vera and Zuluaga, globally solving nonconvex quadratic programs via linear integer programming
    (INFORMS J. Comput. 2020).
    """

    reach: int = 0

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = standard_quadratic(problem, most=_MOST)
        return found if isinstance(found, str) else None

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the dual bound that HiGHS has when it ends."""
        begun = time.perf_counter()
        game = standard_quadratic(problem)
        assert not isinstance(game, str)
        start = reduced(game.matrix)
        B = start.matrix
        top = float(B.max())
        scale = max(1.0, float(np.abs(B).max()))
        rows = _rows(B, top)
        n = len(B)
        # The level is known to be at least `known`; a range as narrow as its tolerances would be collapsed by HiGHS.
        low = np.concatenate([np.zeros(2 * n), [start.known - 0.01 * scale]])
        high = np.concatenate([np.ones(2 * n), [top]])
        answer = milp(
            np.concatenate([np.zeros(2 * n), [-1.0]]),
            integrality=np.concatenate([np.zeros(n), np.ones(n), [0.0]]),
            bounds=Bounds(low, high),
            constraints=rows,
            options={"time_limit": max(seconds - (time.perf_counter() - begun), 0.01), "mip_rel_gap": 1e-7},
        )
        dual = getattr(answer, "mip_dual_bound", None)
        proved = top if dual is None or not np.isfinite(dual) else max(-float(dual), start.known)
        value = min(proved + 5e-7 * scale, top)
        detail = f"{n} of {len(game.matrix)} strategies; HiGHS: {answer.message}"
        return Bound(game.objective(value), "mixed_integer", time.perf_counter() - begun, detail)


def _rows(B: FloatArray, top: float) -> list[LinearConstraint]:
    n = len(B)
    one, nothing = np.eye(n), np.zeros((n, n))
    ones, zeros = np.ones((n, 1)), np.zeros((n, 1))
    slack = top - B.min(axis=1)  # M_i: no level exceeds `top` and no payoff falls below the row's smallest entry
    earns = np.hstack([B, nothing, -ones])
    played = np.hstack([-B, np.diag(slack), ones])
    linked = np.hstack([one, -one, zeros])
    total = np.concatenate([np.ones(n), np.zeros(n + 1)])[None, :]
    diagonal = np.diag(B)
    together = diagonal[:, None] + diagonal[None, :] < 2.0 * B
    groups = [members for members in colour_classes(together) if len(members) > 1]
    exclusive = np.zeros((len(groups), 2 * n + 1))
    for row, members in enumerate(groups):
        exclusive[row, n + members] = 1.0
    rows = [
        LinearConstraint(earns, -np.inf, 0.0),
        LinearConstraint(played, -np.inf, slack),
        LinearConstraint(linked, -np.inf, 0.0),
        LinearConstraint(total, 1.0, 1.0),
    ]
    return rows + ([LinearConstraint(exclusive, -np.inf, 1.0)] if groups else [])


CERTIFICATE = MixedInteger()
