"""Compare two solvers pair by pair, with a bootstrap interval of the mean difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, kw_only=True)
class PairedDifference:
    """Hold how the costs of one solver differ from those of another on the same pairs.

    Parameters
    ----------
    pair_count
        Pairs that both solved: the mean and its interval are over these.
    mean, low, high
        Mean of a - b and its confidence interval, in the unit of the costs; NaN without such pairs.
    wins, losses, ties
        Pairs on which a costs less, more, the same as b. A failure is an infinite cost; two failures tie.
    """

    pair_count: int
    mean: float
    low: float
    high: float
    wins: int
    losses: int
    ties: int


def paired_difference(
    a: ArrayLike, b: ArrayLike, *, level: float = 0.95, resamples: int = 2000, seed: int = 0
) -> PairedDifference:
    """Compare costs a and b, (n,) each, over the same n pairs; inf or NaN is a failure.

    The interval is the bias-corrected and accelerated bootstrap of the mean difference over pairs, the difference
    itself where all are equal, and NaN where there is one pair only.

    Raises
    ------
    InputError
        If the lengths differ.

    Examples
    --------
    >>> paired_difference([1.0, 2.0, 4.0, np.inf], [2.0, 2.0, 7.0, 1.0]).wins
    2

    Source: Efron 1987, "Better bootstrap confidence intervals", section 2.
    """
    first, second = _costs(a), _costs(b)
    if len(first) != len(second):
        raise InputError(f"{len(first)} costs against {len(second)}", remedy="give both solvers the same pairs")
    both = np.isfinite(first) & np.isfinite(second)
    difference = first[both] - second[both]
    mean = float(difference.mean()) if len(difference) else float("nan")
    low, high = _interval(difference, level, resamples, seed)
    return PairedDifference(
        pair_count=len(difference),
        mean=mean,
        low=low,
        high=high,
        wins=int((first < second).sum()),
        losses=int((first > second).sum()),
        ties=int((first == second).sum()),
    )


def _interval(difference: FloatArray, level: float, resamples: int, seed: int) -> tuple[float, float]:
    if len(difference) < 2:
        return float("nan"), float("nan")
    # Without spread the acceleration is zero over zero, and every resample has the same mean.
    if np.ptp(difference) <= 1e-12 * max(1.0, float(np.abs(difference).max())):
        return float(difference[0]), float(difference[0])
    generator = np.random.default_rng(seed)
    from scipy.stats import bootstrap  # takes a second to load; no run needs it

    found = bootstrap(
        (difference,), np.mean, confidence_level=level, n_resamples=resamples, method="BCa", rng=generator
    ).confidence_interval
    return float(found.low), float(found.high)


def _costs(values: ArrayLike) -> FloatArray:
    costs = np.array(values, dtype=np.float64)
    costs[np.isnan(costs)] = np.inf
    return costs
