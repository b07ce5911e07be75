"""Sets {x >= 0, gauge(x) = 1}: simplex, sphere and the elastic-net surface between them, and their convex bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import ModelError
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True)
class ElasticNet:
    r"""Hold x >= 0 with (1 - mix) 1'x + mix x'x = 1.

    mix = 0 is the standard simplex, mix = 1 the nonnegative part of the unit sphere. With b = 1 - mix, s = 1'x and
    q = x'x the gauge is the positive root of g^2 = b s g + mix q. Projection and linear maximisation onto the convex
    body {gauge <= 1} have closed forms; the linear maximiser always lies on the surface.

    Parameters
    ----------
    mix
        Weight of the squared 2-norm, in [0, 1].

    Source: elastic-net ball of Rodola, Torsello, Harada, Kuniyoshi and Cremers (ICCV 2013); SHREC'16 eq. (12).

    Examples
    --------
    >>> x = ElasticNet(mix=0.8).restore(np.array([3.0, 1.0, -1.0]))
    >>> float(round(0.2 * x.sum() + 0.8 * x @ x, 12))
    1.0
    """

    mix: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.mix <= 1.0:
            raise ModelError(f"mix is {self.mix}; it must lie in [0, 1]")

    @property
    def convex(self) -> bool:
        """Whether the surface is flat: only for mix = 0."""
        return self.mix == 0.0

    def body(self) -> Body:
        """Return the convex set {x >= 0, gauge(x) <= 1}."""
        return Body(self)

    def gauge_and_gradient(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return the gauge of x >= 0 and its gradient; the gauge is homogeneous of degree 1."""
        linear, s, q = 1.0 - self.mix, float(x.sum()), float(x @ x)
        root = np.sqrt((linear * s) ** 2 + 4.0 * self.mix * q)
        gauge = 0.5 * (linear * s + root)
        if root == 0.0:
            return 0.0, np.zeros_like(x)
        return gauge, (linear * gauge + 2.0 * self.mix * x) / root

    def violation(self, x: FloatArray) -> float:
        """Return the larger of the most negative entry and |(1 - mix) 1'x + mix x'x - 1|."""
        return max(float(np.max(-x, initial=0.0)), abs(self._level(x)))

    def restore(self, x: FloatArray) -> FloatArray:
        """Drop negative entries and scale onto the surface; the center where nothing is left."""
        kept = np.maximum(x, 0.0)
        gauge = self.gauge_and_gradient(kept)[0]
        return kept / gauge if gauge > 0.0 and np.isfinite(gauge) else self.center(x.shape)

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= x <= 1."""
        return np.zeros(shape), np.ones(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the one equation of the surface."""
        return (SmoothConstraint("equal", self._level_and_jacobian, linear=self.mix == 0.0),)

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the point with all entries equal."""
        return np.full(shape, 1.0 / self.gauge_and_gradient(np.ones(shape))[0])

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return exponential entries scaled onto the surface (uniform for the simplex)."""
        return self.restore(rng.exponential(size=shape))

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return argmax g'x over the body: max(0, g - m b) / (2 mix m) with one multiplier m; a vertex for mix = 0."""
        if self.mix == 0.0 or float(g.max()) <= 0.0:
            vertex = np.zeros_like(g)
            vertex[int(g.argmax())] = 1.0
            return vertex
        linear, positive = 1.0 - self.mix, np.sort(g[g > 0.0])[::-1]
        count = np.arange(1, len(positive) + 1)
        multiplier = np.sqrt(np.cumsum(positive**2) / (4.0 * self.mix + count * linear**2))
        within = np.flatnonzero(positive > multiplier * linear)
        if not len(within):  # mix below rounding: the maximiser is a vertex
            return Simplex().linear_max(g)
        return self.restore(np.maximum(g - multiplier[within[-1]] * linear, 0.0))

    def project(self, x: FloatArray) -> FloatArray:
        """Return the point of the surface nearest to x, for x outside the body; inside, the radial point is returned.

        Source: KKT conditions of min |y - x|^2; y = max(0, x - m b) / (1 + 2 mix m).
        """
        linear, positive = 1.0 - self.mix, np.sort(x)[::-1]
        if self.mix > 0.0:
            positive = positive[positive > 0.0]
            if self._level(np.maximum(x, 0.0)) <= 0.0:
                return self.restore(x)
        count, s, q = np.arange(1, len(positive) + 1), np.cumsum(positive), np.cumsum(positive**2)
        # The root of a quadratic, in the form that loses no digits as mix -> 0 (there it is (s - 1) / count).
        excess = (linear * s + self.mix * q - 1.0) / (4.0 * self.mix + count * linear**2)
        multiplier = 2.0 * excess / (1.0 + np.sqrt(np.maximum(1.0 + 4.0 * self.mix * excess, 0.0)))
        within = np.flatnonzero(positive > multiplier * linear)
        if not len(within):  # so far outside that 1 is below rounding
            return self.linear_max(x)
        return self.restore(np.maximum(x - multiplier[within[-1]] * linear, 0.0))

    def slope_along(self, x: FloatArray, ascent: FloatArray) -> float | None:
        """Return the largest entry of the ascent (n,) along the surface at x (n,); None where it pushes off the body.

        Entries can fall to 0 and no further.
        """
        normal = self.gauge_and_gradient(x)[1]
        outward = float(ascent @ x) / float(normal @ x)
        if outward >= 0.0:
            return None
        rest = ascent - outward * normal
        return float(np.abs(np.maximum(rest, -x)).max(initial=0.0))

    def lower(self, x: Any, ops: Any) -> list[Any]:
        """Write the surface as constraints; not convex unless mix = 0."""
        return [ops.at_most(0.0, x), ops.equal(self._lowered_level(x, ops), 1.0)]

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        if self.mix == 0.0:
            return rf"{name} \ge 0,\ 1^\top {name} = 1"
        return rf"{name} \ge 0,\ {1 - self.mix:g}\,1^\top {name} + {self.mix:g}\,\|{name}\|^2 = 1"

    def _level(self, x: FloatArray) -> float:
        return float((1.0 - self.mix) * x.sum() + self.mix * (x @ x) - 1.0)

    def _level_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([self._level(x)]), ((1.0 - self.mix) + 2.0 * self.mix * x)[None, :]

    def _lowered_level(self, x: Any, ops: Any) -> Any:
        if self.mix == 0.0:
            return ops.sum(x)
        quadratic = self.mix * ops.sum_squares(x)
        return quadratic if self.mix == 1.0 else quadratic + (1.0 - self.mix) * ops.sum(x)

    def __str__(self) -> str:
        return f"ElasticNet(mix={self.mix:g})"


@dataclass(frozen=True)
class Simplex(ElasticNet):
    """Hold x >= 0 with 1'x = 1: the elastic net at mix = 0.

    Examples
    --------
    >>> Simplex().project(np.array([0.8, 0.6, -1.0]))
    array([0.6, 0.4, 0. ])
    """

    mix: float = 0.0

    def __post_init__(self) -> None:
        if self.mix != 0.0:
            raise ModelError("a simplex has mix = 0; use ElasticNet(mix=...)")

    def __str__(self) -> str:
        return "Simplex()"


@dataclass(frozen=True)
class Sphere(ElasticNet):
    """Hold x >= 0 with x'x = 1, the nonnegative part of the unit sphere: the elastic net at mix = 1."""

    mix: float = 1.0

    def __post_init__(self) -> None:
        if self.mix != 1.0:
            raise ModelError("a sphere has mix = 1; use ElasticNet(mix=...)")

    def __str__(self) -> str:
        return "Sphere(nonnegative)"


@dataclass(frozen=True)
class Body:
    """Hold the convex body {x >= 0, gauge(x) <= 1} of an elastic-net surface."""

    surface: ElasticNet
    convex: bool = True

    def violation(self, x: FloatArray) -> float:
        """Return the larger of the most negative entry and the excess of the level over 1."""
        return max(float(np.max(-x, initial=0.0)), self.surface._level(x), 0.0)

    def project(self, x: FloatArray) -> FloatArray:
        """Return the nearest point of the body."""
        kept = np.maximum(x, 0.0)
        return kept if self.surface._level(kept) <= 0.0 else self.surface.project(x)

    restore = project

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= x <= 1."""
        return self.surface.bounds(shape)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the one inequality of the body."""
        equation = self.surface.constraints(shape)[0]
        return (SmoothConstraint("at most", equation.value_and_jacobian, linear=equation.linear),)

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return half of the surface's center."""
        return 0.5 * self.surface.center(shape)

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a random point of the surface scaled by a uniform factor."""
        return rng.uniform() * self.surface.sample(shape, rng)

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return argmax g'x: a point of the surface, or 0 where g has no positive entry."""
        return self.surface.linear_max(g) if float(g.max()) > 0.0 else np.zeros_like(g)

    def lower(self, x: Any, ops: Any) -> list[Any]:
        """Write the body as convex constraints."""
        return [ops.at_most(0.0, x), ops.at_most(self.surface._lowered_level(x, ops), 1.0)]

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        head, _, tail = self.surface.latex(name).rpartition("=")
        return rf"{head}\le{tail}"

    def __str__(self) -> str:
        return f"Body({self.surface})"
