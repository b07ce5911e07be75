"""Limited-memory BFGS for any smooth problem within bounds: the native baseline of other libraries' methods."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import daxpy

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle

_MEMORY = 20  # pairs kept, as many as the other backends' methods of this kind are given
_DECREASE, _CURVATURE = 1e-4, 0.9
_TRIALS = 25

_Pair = tuple[FloatArray, FloatArray, float]
"""A step, the change of the gradient along it, and their product."""


def limited_memory(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Step along the quasi-Newton direction of the entries that no bound holds, by a strong Wolfe line search.

    With bounds the search follows the direction bent onto the box, x(t) = P(x + t d). Entries at a bound whose gradient
    points outward stay there for the step. The objective never rises.

    Source: Nocedal and Wright, Numerical Optimization (2006), algorithms 3.5, 3.6 and 7.4.
    """
    lower, upper = oracle.lower, oracle.upper
    x = np.clip(start, lower, upper)
    f, g = oracle.value_and_gradient(x)
    pairs: deque[_Pair] = deque(maxlen=_MEMORY)
    while True:
        if np.max(np.abs(np.clip(x - g, lower, upper) - x), initial=0.0) <= 0.1 * limits.tolerance * max(1.0, abs(f)):
            return x, "gradient below tolerance"
        held = ((x <= lower) & (g > 0.0)) | ((x >= upper) & (g < 0.0))
        reduced = np.where(held, 0.0, g)
        direction = np.where(held, 0.0, _quasi_newton(reduced, pairs))
        if reduced @ direction > -1e-12 * np.linalg.norm(reduced) * np.linalg.norm(direction):
            pairs.clear()
            direction = -reduced
        first = 1.0 if pairs else 0.1 * max(1.0, float(np.abs(x).max())) / float(np.abs(direction).max())
        found = _wolfe(_Path(oracle, x, direction), _Trial(0.0, f, float(reduced @ direction), x, g), first)
        if found is not None and found.value >= f:
            found = None  # a path bent onto a bound may end where it began
        if found is None and not pairs:
            return x, "no descent along the gradient"
        if found is None:
            pairs.clear()  # the curvature gathered misleads: begin anew from the gradient
            continue
        step, change = found.x - x, found.gradient - g
        curvature = float(step @ change)
        if curvature > 1e-10 * np.linalg.norm(step) * np.linalg.norm(change):
            pairs.append((step, change, curvature))
        x, f, g = found.x, found.value, found.gradient


def _quasi_newton(gradient: FloatArray, pairs: deque[_Pair]) -> FloatArray:
    """Return -H g for the inverse Hessian that the pairs imply: the two-loop recursion."""
    direction = -gradient
    shares = []
    for step, change, curvature in reversed(pairs):
        share = (step @ direction) / curvature
        daxpy(change, direction, a=-share)  # in place
        shares.append(share)
    if pairs:
        _, change, curvature = pairs[-1]
        direction *= curvature / (change @ change)
    for (step, change, curvature), share in zip(pairs, reversed(shares), strict=True):
        daxpy(step, direction, a=share - (change @ direction) / curvature)
    return direction


@dataclass(frozen=True, eq=False)
class _Trial:
    """Hold a step length, the objective and its slope along the path there, the point and its gradient."""

    length: float
    value: float
    slope: float
    x: FloatArray
    gradient: FloatArray


class _Path:
    """Evaluate the objective along P(x + t d)."""

    def __init__(self, oracle: Oracle, x: FloatArray, direction: FloatArray) -> None:
        self._oracle, self._x, self._direction = oracle, x, direction

    def __call__(self, length: float) -> _Trial:
        straight = self._x + length * self._direction
        point = np.clip(straight, self._oracle.lower, self._oracle.upper)
        value, gradient = self._oracle.value_and_gradient(point)
        slope = float(gradient @ np.where(point == straight, self._direction, 0.0))
        return _Trial(length, value, slope, point, gradient)


def _wolfe(path: Callable[[float], _Trial], origin: _Trial, length: float) -> _Trial | None:
    """Return a trial that meets the strong Wolfe conditions, else the lowest that falls enough, else None."""
    low, high = origin, None
    for _ in range(_TRIALS):
        trial = path(length)
        too_high = trial.value > origin.value + _DECREASE * length * origin.slope
        if too_high or (low is not origin and trial.value >= low.value):
            high = trial
        elif abs(trial.slope) <= -_CURVATURE * origin.slope:
            return trial
        else:
            # The minimum lies between the new lowest trial and the old one if the slope points back.
            if trial.slope * ((np.inf if high is None else high.length) - low.length) >= 0.0:
                high = low
            low = trial
        if high is None:
            length *= 4.0
        elif abs(high.length - low.length) <= 1e-14 * max(high.length, low.length):
            break
        else:
            length = _between(low, high)
    return None if low is origin else low


def _between(low: _Trial, high: _Trial) -> float:
    """Return the minimum of the cubic through values and slopes of two trials, kept off both ends."""
    width = high.length - low.length
    mean = low.slope + high.slope - 3.0 * (high.value - low.value) / width
    inside = mean * mean - low.slope * high.slope
    share = 0.5
    if inside >= 0.0:
        root = np.copysign(np.sqrt(inside), width)
        below = high.slope - low.slope + 2.0 * root
        share = 1.0 - (high.slope + root - mean) / below if below != 0.0 else 0.5
    return float(low.length + width * min(max(share, 0.1), 0.9))
