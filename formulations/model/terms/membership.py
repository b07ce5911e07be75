"""The soft membership of a point in a region: an unbounded unknown pressed into (0, 1)."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray

STEEPNESS = 6.0


def membership(v: FloatArray) -> FloatArray:
    """Return eta(v) = (1 + tanh(6 (v - 1/2))) / 2, between 0 and 1, entry by entry.

    Source: Rodola, Cosmo, Bronstein, Torsello and Cremers, partial functional correspondence (CGF 2017).

    Examples
    --------
    >>> membership(np.array([0.0, 0.5, 1.0])).round(4)
    array([0.0025, 0.5   , 0.9975])
    """
    return np.asarray(0.5 * np.tanh(STEEPNESS * (v - 0.5)) + 0.5)


def membership_slope(v: FloatArray) -> FloatArray:
    """Return the derivative of `membership`, entry by entry.

    Examples
    --------
    >>> float(membership_slope(np.array(0.5)))
    3.0
    """
    return np.asarray(0.5 * STEEPNESS * (1.0 - np.tanh(STEEPNESS * (v - 0.5)) ** 2))
