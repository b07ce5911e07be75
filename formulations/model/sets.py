"""Sets in which variables lie: the contract, and the boxes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from nonrigid.formulations.model.term import ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SmoothConstraint:
    """State c(x) = 0 or c(x) <= 0 for a smooth vector function of one variable.

    Parameters
    ----------
    kind
        "equal" for c(x) = 0, "at most" for c(x) <= 0.
    value_and_jacobian
        Takes the variable's array; returns c, (m,), and its Jacobian, (m, size of the variable).
    linear
        Whether c is affine.
    count
        m, where it is large and the Jacobian, which is dense, therefore too.
    """

    kind: Literal["equal", "at most"]
    value_and_jacobian: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    linear: bool = False
    count: int | None = None

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation at x."""
        value = self.value_and_jacobian(x)[0]
        return float(np.max(np.abs(value) if self.kind == "equal" else value, initial=0.0))


@runtime_checkable
class Set(Protocol):
    """Say where a variable may lie.

    Optional members, used where present and checked by `nonrigid.solvers.testing.check_set`: `project(x)`, the nearest
    point of the set; `linear_max(g)`, the point of the set with the largest inner product with g;
    `slope_along(x, g)`, of a surface that is not convex, the largest entry of g along it, None where the gap over its
    hull tells all; `gauge_and_gradient(x)`, for sets {x >= 0, gauge(x) = 1}; `body()`, the convex set whose surface
    this is;
    `lower(x, ops)`, a list of constraints in the operations of a symbolic backend.
    """

    @property
    def convex(self) -> bool:
        """Whether the set is convex."""

    def violation(self, x: FloatArray) -> float:
        """Return how far x is from satisfying the set's conditions, 0 inside."""

    def restore(self, x: FloatArray) -> FloatArray:
        """Return a point exactly on the set (to rounding) near x; x itself if it lies there."""

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return entrywise lower and upper bounds that hold on the set."""

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the conditions beyond the bounds."""

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the point of the set that prefers no entry: the default start."""

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a random point of the set."""

    def latex(self, name: str) -> str:
        """Return the membership of `name` as LaTeX."""


@dataclass(frozen=True)
class Box:
    """Bound every entry: lower <= x <= upper.

    Examples
    --------
    >>> Box(lower=0.0, upper=1.0).restore(np.array([-1.0, 0.5, 3.0]))
    array([0. , 0.5, 1. ])
    """

    lower_bound: float
    upper_bound: float
    convex: bool = True

    def __init__(self, lower: float = -np.inf, upper: float = np.inf) -> None:
        if not lower <= upper:
            raise ModelError(f"a box needs lower <= upper, got {lower} and {upper}")
        object.__setattr__(self, "lower_bound", float(lower))
        object.__setattr__(self, "upper_bound", float(upper))

    def violation(self, x: FloatArray) -> float:
        """Return the largest distance of an entry to its interval."""
        return float(np.max(np.abs(x - self.project(x)), initial=0.0))

    def project(self, x: FloatArray) -> FloatArray:
        """Return the nearest point."""
        return np.clip(x, self.lower_bound, self.upper_bound)

    restore = project

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return the bounds, entry by entry."""
        return np.full(shape, self.lower_bound), np.full(shape, self.upper_bound)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return nothing: the bounds say it all."""
        return ()

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the middle, or 0 brought inside where the box is unbounded."""
        middle = 0.5 * (self.lower_bound + self.upper_bound)
        return self.project(np.full(shape, middle if np.isfinite(middle) else 0.0))

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return uniform entries where bounded, else normal entries brought inside."""
        if np.isfinite(self.upper_bound - self.lower_bound):
            return rng.uniform(self.lower_bound, self.upper_bound, shape)
        return self.project(self.center(shape) + rng.standard_normal(shape))

    def lower(self, x: Any, ops: Any) -> list[Any]:
        """Write the bounds as constraints."""
        low = [ops.at_most(self.lower_bound, x)] if np.isfinite(self.lower_bound) else []
        return low + ([ops.at_most(x, self.upper_bound)] if np.isfinite(self.upper_bound) else [])

    def latex(self, name: str) -> str:
        """Return the bounds as LaTeX."""
        low = rf"{self.lower_bound:g} \le " if np.isfinite(self.lower_bound) else ""
        high = rf" \le {self.upper_bound:g}" if np.isfinite(self.upper_bound) else ""
        return f"{low}{name}{high}" if low or high else ""

    def __str__(self) -> str:
        return f"Box({self.lower_bound:g}, {self.upper_bound:g})"


def free() -> Box:
    """Return the set of all arrays.

    Examples
    --------
    >>> free().bounds((1,))
    (array([-inf]), array([inf]))
    """
    return Box()


def nonnegative() -> Box:
    """Return the set of arrays with no negative entry."""
    return Box(lower=0.0)
