"""The generalised power method: maximise the linearised objective over the elastic net, in closed form."""

from __future__ import annotations

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.native.payoff import Ascent
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import QuadraticGame


def generalised_power(game: QuadraticGame, oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    r"""Iterate x <- argmax_y y'(2 (A + cI) x + c (1 - mix) / mix 1) over the elastic net.

    On the surface mix x'x = 1 - (1 - mix) 1'x, so x'Ax = x'(A + cI)x + c (1 - mix) / mix 1'x - c / mix, which is convex
    once c >= -lambda_min(A): then a step gains at least what the linearised objective promises. c starts at 0 and grows
    to the curvature met wherever a step gains less than a quarter of it; a step that would lose is not taken. At
    mix = 1 this is the power method.

    Source: Journee, Nesterov, Richtarik and Sepulchre, generalized power method (JMLR 2010).
    """
    ascent = Ascent(game, oracle, limits)
    surface = game.surface
    tilt = (1.0 - surface.mix) / surface.mix
    x, g = ascent.begin(start)
    mean, shift = float(x @ g), 0.0
    while True:
        if ascent.met(float(g @ surface.linear_max(g)) - mean, mean):
            return x, "gap below tolerance"
        slope = 2.0 * (g + shift * x) + shift * tilt
        target = surface.linear_max(slope)
        step = target - x
        promised, squared = float(slope @ step), float(step @ step)
        if promised <= 1e-16 * mean or squared == 0.0:
            return x, "no ascent beyond rounding"
        reached = ascent.product(target)
        value = float(target @ reached)
        if value - mean < 0.25 * promised:
            bend = value - 2.0 * float(target @ g) + mean  # step' A step
            shift = max(2.0 * shift, -bend / squared)
        if value >= mean:
            x, g, mean = target, reached, value
            ascent.show(x, mean)
