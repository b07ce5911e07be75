"""Sets of transport plans: how masses may be spread over columns of limited capacity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.sets import SmoothConstraint
from nonrigid.formulations.model.term import ModelError
from nonrigid.formulations.model.transport_plans import cheapest_transport
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PartialTransport:
    r"""Hold (k, n) plans T >= 0 that move all of each row's mass, T 1 = p, and overfill no column, T'1 <= q.

    Parameters
    ----------
    mass
        p, (k,), positive.
    capacity
        q, (n,), positive, with a sum of at least that of p.

    Raises
    ------
    ModelError
        If a mass or capacity is not positive and finite, or the capacities cannot hold the masses.

    Examples
    --------
    >>> plans = PartialTransport(np.array([1.0, 1.0]), np.array([1.5, 1.0]))
    >>> plans.linear_max(np.array([[5.0, 3.0], [4.0, 0.0]]))
    array([[0.5, 0.5],
           [1. , 0. ]])
    """

    mass: FloatArray
    capacity: FloatArray
    convex: bool = True

    def __post_init__(self) -> None:
        for name, values in (("masses", self.mass), ("capacities", self.capacity)):
            if values.ndim != 1 or not (np.isfinite(values).all() and (values > 0.0).all() and len(values)):
                raise ModelError(f"the {name} of a transport must be a vector of positive, finite numbers")
        held, wanted = float(self.capacity.sum()), float(self.mass.sum())
        if wanted > held * (1.0 + 1e-12):
            raise ModelError(f"masses sum to {wanted:.9g} and capacities to {held:.9g}; give larger capacities")

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation of a sign, a row or a column."""
        rows, columns = np.abs(x.sum(axis=1) - self.mass), x.sum(axis=0) - self.capacity
        return max(float(np.max(part, initial=0.0)) for part in (-x, rows, columns))

    def restore(self, x: FloatArray) -> FloatArray:
        """Scale rows and columns down to what they may hold, then move what is missing into what is free, evenly.

        Source: Altschuler, Weed and Rigollet, near-linear time approximation algorithms for optimal transport
        (NeurIPS 2017), algorithm 2.
        """
        if self.violation(x) <= 1e-15 * max(1.0, float(self.mass.max())):
            return x.copy()
        kept = np.maximum(x, 0.0)
        for _ in range(2):  # the second time for what rounding left
            kept = kept * _share(self.mass, kept.sum(axis=1))[:, None]
            kept = kept * _share(self.capacity, kept.sum(axis=0))
            missing = np.maximum(self.mass - kept.sum(axis=1), 0.0)
            free = np.maximum(self.capacity - kept.sum(axis=0), 0.0)
            kept = kept + np.outer(missing, free / max(float(free.sum()), float(missing.sum()), 1e-300))
        return np.asarray(kept)

    def linear_max(self, g: FloatArray) -> FloatArray:
        """Return the plan with the largest sum of g_ij T_ij."""
        return self.restore(cheapest_transport(-g, self.mass, self.capacity).moved)

    def bounds(self, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return 0 <= T_ij <= min(p_i, q_j)."""
        self._check(shape)
        return np.zeros(shape), np.minimum(self.mass[:, None], self.capacity)

    def constraints(self, shape: tuple[int, ...]) -> tuple[SmoothConstraint, ...]:
        """Return the row sums and the column sums; their Jacobians are made when asked for, since they are large."""
        self._check(shape)
        k, n = shape
        return (
            SmoothConstraint("equal", _sums(1, self.mass, lambda: np.kron(np.eye(k), np.ones((1, n)))), True, k),
            SmoothConstraint("at most", _sums(0, self.capacity, lambda: np.kron(np.ones((1, k)), np.eye(n))), True, n),
        )

    def center(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the plan that spreads each mass in proportion to the capacities."""
        self._check(shape)
        return np.outer(self.mass, self.capacity / self.capacity.sum())

    def sample(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Return a random mixture of two plans that are optimal for random costs, and of the center."""
        weights = rng.dirichlet(np.ones(3))
        plans = [self.center(shape), *(self.linear_max(rng.random(shape)) for _ in range(2))]
        return np.asarray(sum(weight * plan for weight, plan in zip(weights, plans, strict=True)))

    def latex(self, name: str) -> str:
        """Return the membership as LaTeX."""
        return rf"{name} \ge 0,\ {name} 1 = p,\ {name}^\top 1 \le q"

    def __str__(self) -> str:
        return "PartialTransport()"

    @staticmethod
    def examples() -> list[tuple[PartialTransport, tuple[int, ...]]]:
        """Return what the conformance kit tries the set on: with room to spare, without, and with a single plan."""
        mass = np.array([0.5, 0.2, 0.3])
        return [
            (PartialTransport(mass, np.array([0.4, 0.3, 0.6, 0.2])), (3, 4)),
            (PartialTransport(mass, np.array([0.25, 0.75])), (3, 2)),
        ]

    def _check(self, shape: tuple[int, ...]) -> None:
        if tuple(shape) != (len(self.mass), len(self.capacity)):
            raise ModelError(
                f"a transport of {len(self.mass)} masses into {len(self.capacity)} columns has no shape {tuple(shape)}"
            )


def _share(limit: FloatArray, held: FloatArray) -> FloatArray:
    return np.minimum(1.0, limit / np.maximum(held, limit))


def _sums(
    axis: int, limit: FloatArray, jacobian: Callable[[], Any]
) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    def value_and_jacobian(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.asarray(x.sum(axis=axis) - limit), np.asarray(jacobian(), dtype=float)

    return value_and_jacobian
