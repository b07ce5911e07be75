"""Infection and immunisation: one strategy at a time is spread, or driven out, at the cost of one column."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.native.payoff import Ascent
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame

_REFRESHES = 50


def infection_immunisation(
    game: QuadraticGame, oracle: Oracle, start: FloatArray, limits: Limits
) -> tuple[FloatArray, str]:
    """Move along x -> (1 - m) x + m e_i for the strategy i whose payoff is farthest from the mean.

    Above the mean it infects (m > 0); played and below the mean it is immunised against (m < 0, at most until x_i = 0).
    m is the exact maximiser of x'Ax on that ray, so the objective never falls; a column, O(n), per iteration.

    Source: Rota Bulo, Pelillo and Bomze, graph-based quadratic optimization: a fast evolutionary approach (CVIU 2011).
    """
    ascent = Ascent(game, oracle, limits)
    payoff = ascent.payoff
    x, g = ascent.begin(start)
    played = np.where(x > 0.0, 0.0, np.inf)  # added to g, it leaves the smallest payoff to a strategy that is played
    mean, refreshed = float(x @ g), 0
    while True:
        best = int(g.argmax())
        excess = float(g[best]) - mean
        if ascent.met(excess, mean):
            x /= x.sum()
            g = ascent.product(x)
            mean = float(x @ g)
            refreshed += 1
            if ascent.met(float(g.max()) - mean, mean) or refreshed > _REFRESHES:
                return x, "gap below tolerance" if refreshed <= _REFRESHES else "stopped by rounding"
            continue
        worst = int((g + played).argmin())
        i = best if excess >= mean - float(g[worst]) else worst
        above = float(g[i]) - mean
        bend = float(payoff.diagonal[i]) - 2.0 * float(g[i]) + mean  # curvature of x'Ax along e_i - x
        share, removed = _share(above, bend, float(x[i]), infecting=i == best)
        x *= 1.0 - share
        x[i] += share
        played[i] = 0.0
        if removed:
            x[i], played[i] = 0.0, np.inf
        g *= 1.0 - share
        payoff.add_column(g, i, share)
        mean += share * (2.0 * above + share * bend)
        if ascent.spend(1, x, mean):
            x /= x.sum()
            mean = float(x @ g)


def _share(above: float, bend: float, held: float, *, infecting: bool) -> tuple[float, bool]:
    """Return the best m of 2 m above + m^2 bend on the ray, and whether the strategy is driven out."""
    if infecting:
        return (min(-above / bend, 1.0) if bend < 0.0 else 1.0), False
    out = held / (held - 1.0)
    if bend < 0.0 and -above / bend > out:
        return -above / bend, False
    return out, True
