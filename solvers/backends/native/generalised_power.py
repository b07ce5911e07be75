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
    once c >= -lambda_min(A): then no step lowers it. c starts at 0 and grows to the curvature met where a step would
    lower the objective. At mix = 1 this is the power method.

    Source: Journee, Nesterov, Richtarik and Sepulchre, generalized power method (JMLR 2010), section 3.
    """
    ascent = Ascent(game, oracle, limits)
    surface = game.surface
    tilt = (1.0 - surface.mix) / surface.mix
    x, g = ascent.begin(start)
    mean, shift = float(x @ g), 0.0
    while True:
        excess = float(g @ surface.linear_max(g)) - mean
        if ascent.met(excess, mean):
            return x, "gap below tolerance"
        target = surface.linear_max(2.0 * (g + shift * x) + shift * tilt)
        reached = ascent.product(target)
        value = float(target @ reached)
        if value < mean:
            step = target - x
            squared = float(step @ step)
            bend = value - 2.0 * float(target @ g) + mean  # step' A step
            if squared == 0.0 or value >= mean * (1.0 - 1e-15):
                return x, "no ascent beyond rounding"
            shift = max(2.0 * shift, -bend / squared)
            continue
        x, g, mean = target, reached, value
        ascent.show(x, mean)
