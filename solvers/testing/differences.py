"""Derivatives by central differences, to which analytic ones are held."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

from nonrigid.geometry.arrays import FloatArray

_Value = TypeVar("_Value", float, FloatArray)


def along(function: Callable[[FloatArray], _Value], x: FloatArray, direction: FloatArray, step: float = 1e-3) -> _Value:
    """Return the derivative of a function along a direction by Richardson's extrapolation of central differences.

    (64 D(h/4) - 20 D(h/2) + D(h)) / 45 with D(h) = (f(x + h d) - f(x - h d)) / 2h: the error falls as h^6, so that h
    need not be small and rounding does no harm.

    Examples
    --------
    >>> round(along(lambda x: float(x[0] ** 3), np.array([2.0]), np.array([1.0])), 8)
    12.0
    """
    coarse, fine, finest = (_central(function, x, direction, share * step) for share in (1.0, 0.5, 0.25))
    return (64.0 * finest - 20.0 * fine + coarse) / 45.0


def directions(shape: tuple[int, ...], rng: np.random.Generator, most: int = 24) -> Iterator[FloatArray]:
    """Yield unit coordinate directions, all or a random choice of them, and three random unit directions."""
    size = int(np.prod(shape))
    for index in range(size) if size <= most else rng.choice(size, most, replace=False):
        unit = np.zeros(size)
        unit[index] = 1.0
        yield unit.reshape(shape)
    for _ in range(3):
        random = rng.standard_normal(shape)
        yield random / np.linalg.norm(random)


def _central(function: Callable[[FloatArray], _Value], x: FloatArray, direction: FloatArray, step: float) -> _Value:
    return (function(x + step * direction) - function(x - step * direction)) / (2.0 * step)
