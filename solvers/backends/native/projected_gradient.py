"""Projected gradient with exact line search on every elastic-net surface."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.model import ElasticNet
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.native.payoff import Ascent
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame

_PATIENCE = 50  # steps that may pass without a visible gain: the gap falls on after the objective has settled


def projected_gradient(
    game: QuadraticGame, oracle: Oracle, start: FloatArray, limits: Limits
) -> tuple[FloatArray, str]:
    """Move from x towards P(x + s Ax) by exact line search, then out to the surface; s is a spectral step length.

    P projects onto the convex body of the surface, in closed form. Along the chord x'Ax is a parabola, maximized
    exactly; scaling out to the surface raises it further, since A >= 0: the objective never falls. The product A d
    touches only columns where x or its target is not 0.

    Source: Birgin, Martinez and Raydan, nonmonotone spectral projected gradient methods (SIAM J. Optim. 2000).
    """
    ascent = Ascent(game, oracle, limits)
    surface = game.surface
    x, g = ascent.begin(start)
    mean = float(x @ g)
    length, reference, idle = 1.0 / max(float(g.max()), 1e-300), mean, 0
    while True:
        excess = float(g @ surface.linear_max(g)) - mean
        target = _project(surface, x + length * g)
        if ascent.met(excess, mean):
            return _cleaned(ascent, x, target, mean), "gap below tolerance"
        direction = target - x
        # On the simplex 1'd = 0 but for rounding, which would drown a small slope.
        slope = float((g - mean) @ direction) if surface.mix == 0.0 else float(g @ direction)
        squared = float(direction @ direction)
        idle = 0 if mean > reference * (1.0 + 1e-13) else idle + 1
        if squared == 0.0 or idle > _PATIENCE:
            return x, "no ascent beyond rounding"
        reference = max(reference, mean) if idle == 0 else reference
        change = ascent.product(direction)
        bend = float(direction @ change)
        step = min(1.0, max(0.0, -slope / bend)) if bend < 0.0 else 1.0
        x, g = x + step * direction, g + step * change
        np.maximum(x, 0.0, out=x)
        level = float(surface.gauge_and_gradient(x)[0])
        x, g = x / level, g / level
        mean = float(x @ g)
        ascent.show(x, mean)
        length = squared / max(abs(bend), 1e-12 * squared)


def _cleaned(ascent: Ascent, x: FloatArray, target: FloatArray, mean: float) -> FloatArray:
    """Return the projection itself, whose zeros are exact, where it is no worse than the point of the chord."""
    target = ascent.surface.restore(target)
    g = ascent.product(target)
    value = float(target @ g)
    settled = ascent.met(float(g @ ascent.surface.linear_max(g)) - value, value)
    if not settled or value < mean * (1.0 - 1e-12):
        return x
    ascent.show(target, value)
    return target


def _project(surface: ElasticNet, z: FloatArray) -> FloatArray:
    """Project onto the body; on the simplex entries more than 1 below the largest are 0 and need no sorting."""
    if surface.mix > 0.0:
        return surface.body().project(z)
    kept = np.flatnonzero(z > z.max() - 1.0)
    projected = np.zeros_like(z)
    projected[kept] = surface.project(z[kept])
    return projected
