"""Averages and correlations that outliers and failures do not turn upside down."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import BoolArray
from nonrigid.geometry.errors import InputError


def shifted_geometric_mean(values: ArrayLike, *, shift: float = 1.0) -> float:
    """Return the shifted geometric mean, in the unit of the values; inf if one is a failure (inf or NaN).

    exp(mean(log(v_i + shift))) - shift

    The shift, in the same unit, keeps values far below it from dominating.

    Raises
    ------
    InputError
        If there are no values, one is negative, or the shift is not positive.

    Examples
    --------
    >>> round(shifted_geometric_mean([1.0, 3.0, 7.0], shift=1.0), 6), shifted_geometric_mean([1.0, np.inf])
    (3.0, inf)

    Source: Achterberg 2007, "Constraint Integer Programming", appendix A.3.
    """
    costs = np.array(values, dtype=np.float64)
    costs[np.isnan(costs)] = np.inf
    if not len(costs) or costs.min() < 0 or shift <= 0:
        least = costs.min() if len(costs) else float("nan")
        raise InputError(
            f"{len(costs)} values, the smallest {least}, with shift {shift}",
            remedy="give at least one value, none negative, and a positive shift",
        )
    return float(np.exp(np.log(costs + shift).mean()) - shift)


def rank_correlation(x: ArrayLike, y: ArrayLike) -> float | None:
    """Return Spearman's rank correlation over the rows where both are finite, ties sharing their mean rank.

    None where fewer than three such rows are left or one side is constant: it is then not defined.

    Examples
    --------
    >>> rank_correlation([1, 2, 3, np.inf], [10, 40, 90, 0]), rank_correlation([1, 1, 1], [1, 2, 3])
    (1.0, None)
    """
    a, b = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    if len(a) < 3 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    from scipy.stats import spearmanr  # takes a second to load; no run needs it

    return round(float(spearmanr(a, b).statistic), 12)


def pareto_front(costs: ArrayLike) -> BoolArray:
    """Tell which rows of an (n, d) table of costs no other row is at least as good as everywhere and better somewhere.

    Rows with a failure (inf or NaN) are never on the front; equal rows are on it together.

    Examples
    --------
    >>> pareto_front([[1.0, 5.0], [2.0, 2.0], [3.0, 2.0], [0.5, np.inf]])
    array([ True,  True, False, False])
    """
    table = np.asarray(costs, dtype=np.float64)
    whole = np.asarray(np.isfinite(table).all(axis=1))
    front = whole.copy()
    for row in np.flatnonzero(whole):
        beaten = (table[whole] <= table[row]).all(axis=1) & (table[whole] < table[row]).any(axis=1)
        front[row] = not beaten.any()
    return np.asarray(front, dtype=np.bool_)
