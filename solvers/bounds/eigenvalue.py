"""The largest eigenvalue: exact on the nonnegative sphere, valid on every elastic net."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvalsh

from nonrigid.formulations.model import Problem
from nonrigid.solvers.bounds.standard_quadratic import standard_quadratic
from nonrigid.solvers.solution import Bound

_MOST = 5000


@dataclass(frozen=True)
class Eigenvalue:
    """Bound x'Bx by lambda_max(B) x'x, where x'x <= 1 on every elastic net; exact on the sphere for B >= 0 (Perron)."""

    reach: int = 2000

    def obstacle(self, problem: Problem) -> str | None:
        """Return what is missing."""
        found = standard_quadratic(problem, simplex=False, most=_MOST)
        return found if isinstance(found, str) else None

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return the bound, rounding included; one eigenvalue, O(n^3)."""
        begun = time.perf_counter()
        game = standard_quadratic(problem, simplex=False)
        assert not isinstance(game, str)
        n = len(game.matrix)
        largest = float(eigvalsh(game.matrix, subset_by_index=(n - 1, n - 1))[0])
        value = largest + n * float(np.finfo(float).eps) * float(np.linalg.norm(game.matrix))
        if game.surface.mix < 1.0:  # elsewhere than on the sphere x'x may be smaller than 1
            value = max(value, 0.0)
        return Bound(game.objective(value), "eigenvalue", time.perf_counter() - begun, f"lambda_max {largest:.9g}")


CERTIFICATE = Eigenvalue()
