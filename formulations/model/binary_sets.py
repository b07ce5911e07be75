"""Sets of 0/1 entries, alone or beside bounded entries; for solvers that branch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import ModelError
from nonrigid.geometry.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class MixedBinary:
    """Hold vectors whose entries are 0 or 1 where `integral`, and in [0, upper] elsewhere.

    A solver that cannot branch must refuse a set with a member `integral`: its convex hull is the box of its bounds.

    Parameters
    ----------
    integral
        (n,) booleans: which entries are 0 or 1.
    upper
        (n,) positive upper bounds; 1 where integral.

    Examples
    --------
    >>> MixedBinary(integral=np.array([True, False]), upper=np.array([1.0, 5.0])).restore(np.array([0.7, 0.7]))
    array([1. , 0.7])
    """

    integral: BoolArray
    upper: FloatArray
    convex: bool = False

    def __post_init__(self) -> None:
        if self.integral.shape != self.upper.shape or self.integral.ndim != 1:
            raise ModelError(
                f"integral has shape {self.integral.shape} and upper {self.upper.shape}; give two equally long vectors"
            )
        if not (self.upper[self.integral] == 1.0).all() or not (self.upper > 0.0).all():
            raise ModelError("upper bounds must be positive, and 1 where integral")

    def violation(self, x: FloatArray) -> float:
        """Return the largest distance of an entry to its values allowed."""
        return float(np.max(np.abs(x - self.project(x)), initial=0.0))

    def project(self, x: FloatArray) -> FloatArray:
        """Return the nearest point: integral entries rounded, the others clipped."""
        return np.where(self.integral, (x > 0.5).astype(float), np.clip(x, 0.0, self.upper))

    restore = project

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return argmax g'x: the upper bound where g is positive."""
        return np.where(g > 0.0, self.upper, 0.0)

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= x <= upper."""
        return np.zeros(shape), self.upper.copy()

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return nothing: bounds and integrality say it all."""
        return ()

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return 0 where integral and the middle elsewhere."""
        return np.where(self.integral, 0.0, 0.5 * self.upper)

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return fair coins where integral and uniform entries elsewhere."""
        return self.project(self.upper * rng.uniform(size=shape))

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        if self.integral.all():
            return rf"{name} \in \{{0, 1\}}^{{{len(self.integral)}}}"
        return rf"{name} \in \{{0, 1\}}^{{{int(self.integral.sum())}}} \times [0, b]"

    def __str__(self) -> str:
        return f"MixedBinary({int(self.integral.sum())} of {len(self.integral)} integral)"


def binary(length: int) -> MixedBinary:
    r"""Return the set of 0/1 vectors.

    Examples
    --------
    >>> binary(2).latex("y")
    'y \\in \\{0, 1\\}^{2}'
    """
    return MixedBinary(integral=np.ones(length, bool), upper=np.ones(length))


def integral_entries(set_: Any, shape: tuple[int, ...]) -> BoolArray:
    """Return which entries a set holds to 0 or 1: none for a set that does not say.

    Examples
    --------
    >>> integral_entries(binary(2), (2,))
    array([ True,  True])
    """
    found = getattr(set_, "integral", None)
    return np.zeros(shape, bool) if found is None else np.broadcast_to(np.asarray(found, bool), shape).copy()
