"""Replicator dynamics: the method that the game-theoretic matching papers use."""

from __future__ import annotations

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame


def replicator(game: QuadraticGame, oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Iterate x_i <- x_i (Ax)_i / x'Ax until the Frank-Wolfe gap meets the tolerance.

    For a symmetric A >= 0 the objective never falls. A strategy at zero stays there, so the start must be interior.

    Source: Pavan and Pelillo, dominant sets and pairwise clustering (TPAMI 2007).
    """
    x = start.copy()
    while True:
        value, gradient = oracle.value_and_gradient(x)
        payoff = -0.5 * gradient
        mean = float(x @ payoff)
        if mean <= 0.0:
            return x, "every strategy played has payoff 0"
        if 2.0 * (float(payoff.max()) - mean) <= limits.tolerance * max(1.0, abs(value)):
            return x, "gap below tolerance"
        if 2.0 * (float(payoff[x > 0.0].max()) - mean) <= limits.tolerance * max(1.0, abs(value)):
            return x, "gap below tolerance among the strategies played; others never enter"
        x = x * payoff / mean
