"""Performance profiles and data profiles: which share of the problems a solver solves, against what it may cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class Profile:
    """Hold one step function a solver, right-continuous.

    Parameters
    ----------
    solvers
        Their names.
    at
        For each solver the sorted costs (ratios or budgets) at which it solves one problem more; failures left out.
    problem_count
        The problems, those that nobody solves included.
    """

    solvers: tuple[str, ...]
    at: tuple[FloatArray, ...]
    problem_count: int

    def share(self, solver: str, budget: ArrayLike) -> FloatArray:
        """Return the share of all problems that a solver solves within each budget."""
        steps = self.at[self.solvers.index(solver)]
        # A ratio that equals the budget up to rounding is within it.
        within = np.searchsorted(steps, np.asarray(budget, dtype=np.float64) * (1 + 1e-12), side="right")
        return np.asarray(within / self.problem_count, dtype=np.float64)


def performance_profile(costs: ArrayLike, solvers: Sequence[str]) -> Profile:
    """Return the share of problems that each solver solves within a factor of the cheapest solver.

    rho_s(tau) = |{p : t_ps / min_s' t_ps' <= tau}| / |P|

    Parameters
    ----------
    costs
        (problems, solvers) positive costs such as seconds; inf or NaN where a solver fails.
    solvers
        Names of the columns.

    Raises
    ------
    InputError
        If there are no problems, shapes disagree, or a cost is not positive.

    Examples
    --------
    >>> profile = performance_profile([[1, 2], [3, 1], [5, np.inf]], ["a", "b"])
    >>> profile.share("a", [1, 3]).round(3), profile.share("b", [1, 2, 9]).round(3)
    (array([0.667, 1.   ]), array([0.333, 0.667, 0.667]))

    Source: Dolan and More 2002, "Benchmarking optimization software with performance profiles", section 2.
    """
    table = _checked(costs, solvers)
    with np.errstate(invalid="ignore"):
        ratios = table / table.min(axis=1, keepdims=True)
    return _profile(ratios, solvers)


def data_profile(evaluations: ArrayLike, dimensions: ArrayLike, solvers: Sequence[str]) -> Profile:
    """Return the share of problems that each solver solves within a budget of simplex gradients.

    d_s(alpha) = |{p : t_ps / (n_p + 1) <= alpha}| / |P|

    Parameters
    ----------
    evaluations
        (problems, solvers) evaluations until `reached` first holds; inf or NaN where it never does.
    dimensions
        (problems,) numbers of variables n_p. Zeros count evaluations themselves, which suits solvers with gradients.
    solvers
        Names of the columns.

    Raises
    ------
    InputError
        As `performance_profile` does.

    Examples
    --------
    >>> data_profile([[6, 12], [10, np.nan]], [2, 4], ["a", "b"]).share("b", [3, 4])
    array([0. , 0.5])

    Source: More and Wild 2009, "Benchmarking derivative-free optimization algorithms", equation 2.8.
    """
    table = _checked(evaluations, solvers)
    sizes = np.asarray(dimensions, dtype=np.float64)
    if sizes.shape != table.shape[:1]:
        raise InputError(f"{sizes.shape} dimensions for {len(table)} problems", remedy="give one number a problem")
    return _profile(table / (sizes[:, None] + 1.0), solvers)


def cost_to_reach(values: ArrayLike, costs: ArrayLike, *, start: float, best: float, tolerance: float) -> float:
    """Return the cost at which a solver first reached a share of the best decrease; inf where it never did.

    Reached means f(x) <= f_L + tolerance (f(x_0) - f_L), with f_L the best value that any solver found. For
    a problem that is maximized give negated values.

    Examples
    --------
    >>> cost_to_reach([9.0, 1.5, 1.0], [1, 2, 3], start=9.0, best=1.0, tolerance=0.1)
    2.0

    Source: More and Wild 2009, equation 2.2.
    """
    found, spent = np.asarray(values, dtype=np.float64), np.asarray(costs, dtype=np.float64)
    # Where the start is already best, rounding must not keep it from counting.
    target = best + tolerance * max(start - best, 0.0) + 1e-12 * abs(best)
    good = np.flatnonzero(found <= target)
    return float(spent[good[0]]) if len(good) else np.inf


def _checked(costs: ArrayLike, solvers: Sequence[str]) -> FloatArray:
    table = np.array(costs, dtype=np.float64)
    if table.ndim != 2 or not table.size or table.shape[1] != len(solvers):
        raise InputError(
            f"costs have shape {table.shape} for {len(solvers)} solvers",
            remedy="give a row a problem and a column a solver",
        )
    table[np.isnan(table)] = np.inf
    if (table <= 0).any():
        raise InputError(f"the smallest cost is {table.min():.3g}", remedy="costs are positive; round times up")
    return table


def _profile(table: FloatArray, solvers: Sequence[str]) -> Profile:
    steps = tuple(np.sort(column[np.isfinite(column)]) for column in table.T)
    return Profile(solvers=tuple(solvers), at=steps, problem_count=len(table))
