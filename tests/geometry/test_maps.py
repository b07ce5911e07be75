"""Nearest rows equal an exhaustive search in double precision."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.maps import RowSearch, nearest_rows


def exhaustive(queries: np.ndarray, targets: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    squared = np.square(queries[:, None] - targets[None]).sum(axis=2)
    order = np.argsort(squared, axis=1, kind="stable")[:, :count]
    return order, np.take_along_axis(squared, order, axis=1)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 3), apart=st.sampled_from([0.0, 10.0, 1000.0]))
def test_prepared_targets_answer_near_and_far_queries_alike(seed: int, count: int, apart: float) -> None:
    generator = np.random.default_rng(seed)
    targets = generator.standard_normal((40, 3))
    search = RowSearch(targets)
    for shift in (apart, 0.0):  # far queries leave no trace
        queries = generator.standard_normal((9, 3)) + shift
        indices, squared = search.nearest(queries, count=count, block=4)
        expected, distances = exhaustive(queries, targets, count)
        np.testing.assert_array_equal(indices.reshape(9, count), expected)
        np.testing.assert_array_equal(squared.reshape(9, count), distances)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    columns=st.integers(1, 6),
    count=st.integers(1, 3),
    uneven=st.sampled_from([1.0, 1e6]),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_a_search_by_the_first_columns_is_one_among_targets_cut_short(
    seed: int, columns: int, count: int, uneven: float, dtype: type
) -> None:
    generator = np.random.default_rng(seed)
    targets = generator.standard_normal((40, 6)) * np.where(np.arange(6) < 3, 1.0, uneven) + generator.standard_normal()
    queries = generator.standard_normal((9, columns))
    indices, squared = RowSearch(targets, dtype=dtype).first(columns).nearest(queries, count=count)
    expected, distances = exhaustive(queries, targets[:, :columns], count)
    np.testing.assert_array_equal(indices.reshape(9, count), expected)
    np.testing.assert_array_equal(squared.reshape(9, count), distances)


def test_no_search_by_more_columns_than_there_are() -> None:
    for columns in (0, 4):
        with pytest.raises(InputError, match=f"first {columns} columns of 3"):
            RowSearch(np.zeros((2, 3))).first(columns)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 5),
    dimension=st.integers(1, 12),
    scale=st.sampled_from([1e-100, 1e-6, 1.0, 1e12]),
    offset=st.sampled_from([0.0, 1e4]),
    digits=st.sampled_from([0, 1, 16]),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_equal_to_exhaustive_search(
    seed: int, count: int, dimension: int, scale: float, offset: float, digits: int, dtype: type
) -> None:
    generator = np.random.default_rng(seed)
    queries = scale * (generator.standard_normal((23, dimension)).round(digits) + offset)  # few digits: many ties
    targets = scale * (generator.standard_normal((40, dimension)).round(digits) + offset)
    indices, squared = nearest_rows(queries, targets, count=count, block=7, dtype=dtype)
    expected, distances = exhaustive(queries, targets, count)
    np.testing.assert_array_equal(indices, expected[:, 0] if count == 1 else expected)
    np.testing.assert_array_equal(squared, distances[:, 0] if count == 1 else distances)


def test_near_ties_that_single_precision_cannot_tell_apart() -> None:
    generator = np.random.default_rng(0)
    targets = np.repeat(generator.standard_normal((50, 100)), 4, axis=0)
    targets += 1e-9 * generator.standard_normal(targets.shape)
    queries = targets + 1e-10 * generator.standard_normal(targets.shape)
    indices, _ = nearest_rows(queries, targets)
    np.testing.assert_array_equal(indices, np.arange(200))


def test_all_targets_alike_give_the_lowest_numbers() -> None:
    indices, squared = nearest_rows(np.ones((3, 2)), np.zeros((5, 2)), count=2)
    assert indices.tolist() == [[0, 1]] * 3
    assert squared.tolist() == [[2.0, 2.0]] * 3


@pytest.mark.parametrize(
    ("queries", "targets", "options", "complaint"),
    [
        (np.zeros((2, 3)), np.zeros((2, 4)), {}, "queries have 3 columns, targets 4"),
        (np.zeros(3), np.zeros((2, 3)), {}, r"queries have shape \(3,\)"),
        (np.zeros((2, 3)), np.full((2, 3), np.nan), {}, "2 targets are not finite, the first is row 0"),
        (np.zeros((2, 3)), np.zeros((2, 3)), {"count": 3}, "3 neighbours among 2 targets"),
        (np.zeros((2, 3)), np.zeros((2, 3)), {"dtype": np.int32}, "matrix products in int32"),
    ],
)
def test_bad_input_is_refused(queries: np.ndarray, targets: np.ndarray, options: dict, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        nearest_rows(queries, targets, **options)
