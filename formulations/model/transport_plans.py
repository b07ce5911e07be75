"""The transportation problem: move given masses at least cost, into columns of limited capacity, and prove it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array

from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray
from nonrigid.geometry.errors import NonrigidError

_SMALL = 4000
"""Number of cells up to which all of them are handed to the simplex method at once."""

_NEAR = 15
"""Cells of each row, and of each column, with the least reduced costs, that are tried at first."""

_SOFTNESS = (0.1, 0.03, 0.01, 0.003, 0.001)
"""Temperatures, in units of the range of costs, at which prices are estimated; the last two where a guess is given."""

_ROUNDS = 12
"""Updates of all prices at each temperature."""

_EXACT = 1e-10
"""Reduced cost, in units of the range of costs, above which a cell cannot improve a plan."""


@dataclass(frozen=True, eq=False)
class TransportPlan:
    """Hold a plan and the prices that prove it.

    Parameters
    ----------
    moved
        (k, n) mass from each row to each column.
    row_prices, column_prices
        (k,) u and (n,) v <= 0: for any v, sum_i mass_i min_j (cost_ij - v_j) + sum_j capacity_j v_j is a lower bound of
        every plan's cost; for these it is the cost of the plan.
    """

    moved: FloatArray
    row_prices: FloatArray
    column_prices: FloatArray


def cheapest_transport(
    cost: FloatArray, mass: FloatArray, capacity: FloatArray, *, guess: FloatArray | None = None
) -> TransportPlan:
    """Return the plan T >= 0 with T 1 = mass, T'1 <= capacity and the least sum of cost_ij T_ij.

    Few cells carry mass, so the simplex method gets few: those whose reduced costs are least by prices that a softened
    problem gives. Cells that the plan's own prices show to be cheaper are added until there are none: the plan is then
    optimal among all cells.

    Parameters
    ----------
    cost
        (k, n), finite.
    mass, capacity
        (k,) and (n,), positive; the masses sum to no more than the capacities.
    guess
        (n,) column prices of a similar problem, from which the estimate sets out.

    Raises
    ------
    NonrigidError
        If the simplex method ends without a plan.

    Source: column generation, Gilmore and Gomory (Operations Research 1961); softened prices, Cuturi (NeurIPS 2013).

    Examples
    --------
    >>> plan = cheapest_transport(np.array([[0.0, 2.0], [1.0, 5.0]]), np.array([1.0, 1.0]), np.array([1.5, 1.0]))
    >>> plan.moved
    array([[0.5, 0.5],
           [1. , 0. ]])
    >>> plan.row_prices @ [1.0, 1.0] + plan.column_prices @ [1.5, 1.0] == np.sum([[0.0, 2.0], [1.0, 5.0]] * plan.moved)
    np.True_
    """
    least, scale = float(cost.min()), float(np.ptp(cost)) or 1.0
    unit = float(mass.mean())
    relative, rows, columns = (cost - least) / scale, mass / unit, capacity / unit
    tried = _first_cells(relative, rows, columns, None if guess is None else guess / scale)
    while True:
        i, j = np.nonzero(tried)
        moved, u, v = _simplex(relative[i, j], i, j, rows, columns)
        reduced = relative - u[:, None] - v
        better = (reduced < -_EXACT) & ~tried
        if not better.any():
            break
        tried |= better & _least(reduced, _NEAR)
    plan = np.zeros(cost.shape)
    plan[i, j] = moved * unit
    return TransportPlan(plan, scale * u + least, scale * v)


def _first_cells(cost: FloatArray, mass: FloatArray, capacity: FloatArray, guess: FloatArray | None) -> BoolArray:
    if cost.size <= _SMALL:
        return np.ones(cost.shape, dtype=bool)
    u, v = _softened_prices(cost, mass, capacity, guess)
    return np.asarray(_least(cost - u[:, None] - v, _NEAR) | _corner(mass, capacity))


def _least(reduced: FloatArray, count: int) -> BoolArray:
    """Return the `count` least entries of each row and of each column."""
    chosen = np.zeros(reduced.shape, dtype=bool)
    k, n = reduced.shape
    few = min(count, n)
    chosen[np.arange(k)[:, None], np.argpartition(reduced, few - 1, axis=1)[:, :few]] = True
    few = min(count, k)
    chosen[np.argpartition(reduced, few - 1, axis=0)[:few], np.arange(n)] = True
    return chosen


def _corner(mass: FloatArray, capacity: FloatArray) -> BoolArray:
    """Return the cells of the plan that fills columns one after another: with them there is a plan."""
    ends, limits = np.cumsum(mass), np.cumsum(capacity)
    starts = np.concatenate([[0.0], ends[:-1], limits])
    starts = np.sort(starts[starts < ends[-1]])
    used = np.zeros((len(mass), len(capacity)), dtype=bool)
    row = np.minimum(np.searchsorted(ends, starts, side="right"), len(mass) - 1)
    column = np.minimum(np.searchsorted(limits, starts, side="right"), len(capacity) - 1)
    used[row, column] = True
    return used


def _softened_prices(
    cost: FloatArray, mass: FloatArray, capacity: FloatArray, guess: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return prices of the problem with entropy, at falling temperature."""
    v = np.zeros(len(capacity)) if guess is None else guess.copy()
    u = np.zeros(len(mass))
    for heat in _SOFTNESS if guess is None else _SOFTNESS[-2:]:
        for _ in range(_ROUNDS):
            u = heat * np.log(mass) - _soft_sum(cost.T - v[:, None], heat)
            v = np.minimum(heat * np.log(capacity) - _soft_sum(cost - u[:, None], heat), 0.0)
    return u, v


def _soft_sum(values: FloatArray, heat: float) -> FloatArray:
    """Return heat * log(sum of exp(-values / heat)) of each column."""
    least = values.min(axis=0)
    return np.asarray(heat * np.log(np.exp((least - values) / heat).sum(axis=0)) - least)


def _simplex(
    cost: FloatArray, row: IntArray, column: IntArray, mass: FloatArray, capacity: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    cells = len(cost)
    tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    solve: Any = linprog  # its stubs know the options of other methods only
    found = solve(
        cost,
        A_eq=_sums(row, (len(mass), cells)),
        b_eq=mass,
        A_ub=_sums(column, (len(capacity), cells)),
        b_ub=capacity,
        method="highs-ds",
        options=tight,
    )
    if found.x is None or found.status != 0:
        raise NonrigidError(
            f"no transport of mass {mass.sum():.6g} into capacity {capacity.sum():.6g} was found: {found.message}"
        )
    return np.asarray(found.x), np.asarray(found.eqlin.marginals), np.asarray(found.ineqlin.marginals)


def _sums(place: IntArray, shape: tuple[int, int]) -> Any:
    """Return the matrix that sums cells by their row or column."""
    ones: FloatArray = np.ones(shape[1])
    return csr_array((ones, (place, np.arange(shape[1]))), shape=shape)
