"""Statistics against hand-made cases and independent implementations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from nonrigid.benchmark.statistics.averages import pareto_front, rank_correlation, shifted_geometric_mean
from nonrigid.benchmark.statistics.paired import paired_difference
from nonrigid.benchmark.statistics.profiles import cost_to_reach, data_profile, performance_profile
from nonrigid.geometry.errors import InputError

COST = st.floats(0.01, 1e3) | st.just(math.inf)


def test_profile_of_a_case_worked_by_hand() -> None:
    """Four problems, three solvers; the last problem nobody solves. Ratios: a 1 1 4 -, b 2 3 1 -, c 10 - 1 -."""
    costs = [[1, 2, 10], [2, 6, np.nan], [4, 1, 1], [np.inf, np.inf, np.nan]]
    profile = performance_profile(costs, ["a", "b", "c"])
    assert profile.share("a", [1, 2, 3.9, 4, 1e9]).tolist() == [0.5, 0.5, 0.5, 0.75, 0.75]
    assert profile.share("b", [1, 2, 3]).tolist() == [0.25, 0.5, 0.75]
    assert profile.share("c", [1, 9.9, 10, 1e9]).tolist() == [0.25, 0.25, 0.5, 0.5]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(COST, min_size=3, max_size=3), min_size=1, max_size=12), st.floats(1, 1e4))
def test_profiles_agree_with_the_definition_by_loops(costs: list[list[float]], factor: float) -> None:
    profile = performance_profile(costs, ["x", "y", "z"])
    for column, name in enumerate("xyz"):
        solved = 0
        for row in costs:
            best = min(row)
            solved += math.isfinite(row[column]) and row[column] / best <= factor * (1 + 1e-12)
        assert profile.share(name, factor) == solved / len(costs)
    sizes = np.arange(len(costs))
    budgets = data_profile(costs, sizes, ["x", "y", "z"])
    expected = sum(row[0] / (n + 1) <= factor * (1 + 1e-12) for row, n in zip(costs, sizes, strict=True)) / len(costs)
    assert budgets.share("x", factor) == expected


def test_some_solver_is_cheapest_on_every_solved_problem() -> None:
    costs = np.random.default_rng(0).lognormal(size=(40, 5))
    profile = performance_profile(costs, list("abcde"))
    assert sum(profile.share(name, 1.0) for name in "abcde") == pytest.approx(1.0)


def test_costs_that_make_no_profile_are_refused() -> None:
    for costs in ([[0.0, 1.0]], [[-1.0, 1.0]], [[1.0]], []):
        with pytest.raises(InputError):
            performance_profile(costs, ["a", "b"])
    with pytest.raises(InputError):
        data_profile([[1.0, 2.0]], [1, 2], ["a", "b"])


def test_convergence_follows_the_decrease() -> None:
    values, costs = [10.0, 5.0, 2.0, 1.1, 1.0], [1, 2, 4, 8, 16]
    assert [cost_to_reach(values, costs, start=10, best=1, tolerance=t) for t in (0.5, 0.1, 1e-3)] == [2, 8, 16]
    assert cost_to_reach(values, costs, start=10, best=0, tolerance=0.01) == math.inf
    assert cost_to_reach([1.0], [3], start=1.0, best=1.0, tolerance=1e-3) == 3


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=20), st.floats(0.1, 100))
def test_shifted_geometric_mean_by_the_product(values: list[float], shift: float) -> None:
    product = math.prod((value + shift) ** (1 / len(values)) for value in values) - shift
    mean = shifted_geometric_mean(values, shift=shift)
    assert mean == pytest.approx(product, rel=1e-9, abs=1e-9 * (1 + max(values)))
    assert mean <= np.mean(values) * (1 + 1e-9) + 1e-9


def test_means_without_values_are_refused() -> None:
    for values, shift in (([], 1.0), ([-1.0], 1.0), ([1.0], 0.0)):
        with pytest.raises(InputError):
            shifted_geometric_mean(values, shift=shift)


@given(st.lists(st.tuples(COST, COST), min_size=1, max_size=15))
def test_the_front_is_what_nobody_beats(costs: list[tuple[float, float]]) -> None:
    front = pareto_front(costs)
    for i, mine in enumerate(costs):
        beaten = any(
            other[0] <= mine[0] and other[1] <= mine[1] and other != mine for other in costs if max(other) < math.inf
        )
        assert front[i] == (max(mine) < math.inf and not beaten)


def test_rank_correlation_by_ranks() -> None:
    x, y = [3.0, 1.0, 2.0, 2.0, 9.0], [1.0, 5.0, 4.0, 4.5, 0.0]
    rank_x, rank_y = [4, 1, 2.5, 2.5, 5], [2, 5, 3, 4, 1]
    assert rank_correlation(x, y) == pytest.approx(np.corrcoef(rank_x, rank_y)[0, 1])
    assert rank_correlation([1, 2], [1, 2]) is None
    assert rank_correlation([1, np.nan, 2, 3], [3, 9, 2, 1]) == -1.0


def test_differences_count_failures_as_infinite() -> None:
    found = paired_difference([1, np.nan, np.inf, 3, 2], [2, 1, np.inf, 3, np.nan])
    assert (found.wins, found.losses, found.ties, found.pair_count) == (2, 1, 2, 2)
    assert found.mean == -0.5
    assert math.isnan(paired_difference([np.inf], [1.0]).mean)
    same = paired_difference([1.0, 2.0], [0.5, 1.5])
    assert (same.low, same.mean, same.high) == (0.5, 0.5, 0.5)
    with pytest.raises(InputError):
        paired_difference([1.0], [1.0, 2.0])


def test_the_interval_agrees_with_an_independent_bootstrap() -> None:
    generator = np.random.default_rng(5)
    a, b = generator.exponential(size=60), generator.normal(0.5, 0.2, size=60)
    found = paired_difference(a, b, resamples=20_000, seed=1)
    low, high = _accelerated_interval(a - b, np.random.default_rng(2), 20_000)
    assert found.low == pytest.approx(low, abs=0.01)
    assert found.high == pytest.approx(high, abs=0.01)
    assert found == paired_difference(a, b, resamples=20_000, seed=1)


def _accelerated_interval(d: np.ndarray, generator: np.random.Generator, resamples: int) -> tuple[float, float]:
    """Efron's interval, written out from the formulas of his section 2."""
    n = len(d)
    means = np.array([d[generator.integers(0, n, n)].mean() for _ in range(resamples)])
    bias = norm.ppf((means < d.mean()).mean())
    left_out = np.array([np.delete(d, i).mean() for i in range(n)])
    u = left_out.mean() - left_out
    acceleration = (u**3).sum() / (6 * (u**2).sum() ** 1.5)
    ends = []
    for z in (norm.ppf(0.025), norm.ppf(0.975)):
        level = norm.cdf(bias + (bias + z) / (1 - acceleration * (bias + z)))
        ends.append(float(np.quantile(means, level)))
    return ends[0], ends[1]


def test_the_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    generator = np.random.default_rng(11)
    inside = 0
    for seed in range(100):
        found = paired_difference(generator.normal(1.0, 1.0, 40), np.zeros(40), resamples=400, seed=seed)
        inside += found.low <= 1.0 <= found.high
    assert 86 <= inside <= 100


def test_one_pair_has_no_interval() -> None:
    found = paired_difference([1.0], [0.5])
    assert found.mean == 0.5
    assert np.isnan([found.low, found.high]).all()
