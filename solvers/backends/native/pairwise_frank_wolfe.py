"""Pairwise Frank-Wolfe: share flows from the worst strategy played to the best one, at the cost of two columns."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.native.payoff import Ascent
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame

_REFRESHES = 50


def pairwise_frank_wolfe(
    game: QuadraticGame, oracle: Oracle, start: FloatArray, limits: Limits
) -> tuple[FloatArray, str]:
    """Move along e_i - e_j, i the strategy of largest payoff, j the one played of smallest, by exact line search.

    The objective never falls; a strategy whose share is used up stays at exactly 0.

    Source: Lacoste-Julien and Jaggi, on the global linear convergence of Frank-Wolfe variants (NeurIPS 2015).
    """
    ascent = Ascent(game, oracle, limits)
    payoff = ascent.payoff
    x, g = ascent.begin(start)
    played = np.where(x > 0.0, 0.0, np.inf)
    mean, refreshed = float(x @ g), 0
    while True:
        i, j = int(g.argmax()), int((g + played).argmin())
        high, low = float(g[i]), float(g[j])
        if ascent.met(high - mean, mean):
            x /= x.sum()
            g = ascent.product(x)
            mean = float(x @ g)
            refreshed += 1
            if ascent.met(float(g.max()) - mean, mean) or refreshed > _REFRESHES:
                return x, "gap below tolerance" if refreshed <= _REFRESHES else "stopped by rounding"
            continue
        bend = float(payoff.diagonal[i] + payoff.diagonal[j]) - 2.0 * payoff.entry(i, j)
        step = held = float(x[j])
        if bend < 0.0:
            step = min(held, (low - high) / bend)
        x[i] += step
        played[i] = 0.0
        x[j] -= step
        if step == held:
            x[j], played[j] = 0.0, np.inf
        payoff.add_column(g, i, step)
        payoff.add_column(g, j, -step)
        mean += step * (2.0 * (high - low) + step * bend)
        if ascent.spend(2, x, mean):
            mean = float(x @ g)
