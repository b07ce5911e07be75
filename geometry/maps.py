"""Nearest neighbours among feature vectors, the step from a functional map to points."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError

_PAIR_ENTRIES = 4_000_000
"""How many coordinates of candidate pairs are gathered at a time (32 MB)."""


def nearest_rows(
    queries: FloatArray,
    targets: FloatArray,
    *,
    count: int = 1,
    block: int = 512,
    dtype: DTypeLike = np.float32,
) -> tuple[IntArray, FloatArray]:
    """Return, for each query, the `count` nearest targets and their squared Euclidean distances.

    Distances to all targets come from matrix products in `dtype`; every target that the rounding error of these
    products cannot exclude is measured again in double precision, so the answer is that of an exhaustive search in
    double precision, whatever `dtype` is. The lower number wins among equals. Unlike a search tree it takes the same
    time however badly queries fit, unless very many targets tie.

    Parameters
    ----------
    queries, targets
        (q, d) and (t, d) finite rows.
    count
        How many neighbours, 1 to t.
    block
        How many queries are compared at a time; memory is block * t numbers, some ten times that where nearly all
        targets are equally near.
    dtype
        float32 or float64, the precision of the matrix products.

    Returns
    -------
    indices, squared distances
        (q, count) each, nearest first; (q,) where `count` is 1.

    Raises
    ------
    InputError
        If the shapes disagree, a row is not finite, or there are fewer than `count` targets.

    Examples
    --------
    >>> nearest_rows(np.array([[0.1], [2.2]]), np.array([[0.0], [1.0], [2.0]]))[0]
    array([0, 2])
    """
    return RowSearch(targets, dtype=dtype).nearest(queries, count=count, block=block)


class RowSearch:
    """Hold targets prepared for several searches; see `nearest_rows`, which prepares them for one.

    Parameters
    ----------
    targets
        (t, d) finite rows.
    dtype
        float32 or float64, the precision of the matrix products.

    Raises
    ------
    InputError
        If a row is not finite or the precision is another; in `nearest` as `nearest_rows` does.

    Examples
    --------
    >>> search = RowSearch(np.array([[0.0, 9.0], [1.0, 0.0], [2.0, 0.0]]))
    >>> search.nearest(np.array([[0.1, 0.0]]))[0], search.first(1).nearest(np.array([[0.1]]))[0]
    (array([1]), array([0]))
    """

    def __init__(self, targets: FloatArray, *, dtype: DTypeLike = np.float32) -> None:
        self._targets = _checked(targets, "targets")
        if np.dtype(dtype) not in (np.dtype(np.float32), np.dtype(np.float64)):
            raise InputError(f"matrix products in {np.dtype(dtype)}", remedy="use float32 or float64")
        self._kind: np.dtype[np.floating] = np.dtype(np.float32 if np.dtype(dtype) == np.float32 else np.float64)
        # Products of centred rows of length about one neither overflow nor cancel more than they must.
        self._centre = self._targets.mean(axis=0) if len(self._targets) else np.zeros(self._targets.shape[1])
        size = _largest_offset(self._targets, self._centre)
        self._unit = 1.0 / size if size > 0.0 else 1.0
        right = (self._targets - self._centre) * self._unit
        norms = np.square(right).sum(axis=1)
        self._half_norms = (0.5 * norms).astype(self._kind)
        self._reach = float(np.sqrt(norms.max(initial=0.0)))
        self._right_t = np.ascontiguousarray(right.T.astype(self._kind))

    def first(self, columns: int) -> RowSearch:
        """Return a search by the first `columns` coordinates alone; nothing is prepared again, and little is copied."""
        if not 1 <= columns <= self._targets.shape[1]:
            raise InputError(
                f"first {columns} columns of {self._targets.shape[1]}", remedy="ask for at least 1, at most all"
            )
        fewer, norms = copy(self), self._running_norms[columns - 1]
        fewer._targets, fewer._centre = self._targets[:, :columns], self._centre[:columns]
        fewer._half_norms, fewer._right_t = (0.5 * norms).astype(self._kind), self._right_t[:columns]
        fewer._reach = float(np.sqrt(norms.max(initial=0.0)))
        return fewer

    @cached_property
    def _running_norms(self) -> FloatArray:
        """(d, t) squared lengths of the centred targets by their first 1, 2, ..., d columns."""
        right_t = np.ascontiguousarray(((self._targets - self._centre) * self._unit).T)
        return np.asarray(np.cumsum(np.square(right_t, out=right_t), axis=0, out=right_t))

    def nearest(self, queries: FloatArray, *, count: int = 1, block: int = 512) -> tuple[IntArray, FloatArray]:
        """Return, for each query, the `count` nearest targets and their squared distances; see `nearest_rows`."""
        queries, targets = _checked(queries, "queries"), self._targets
        if queries.shape[1] != targets.shape[1]:
            raise InputError(
                f"queries have {queries.shape[1]} columns, targets {targets.shape[1]}", remedy="use one basis"
            )
        if not 1 <= count <= len(targets):
            raise InputError(f"{count} neighbours among {len(targets)} targets", remedy=f"ask for 1 to {len(targets)}")
        # Queries far outside would overflow: all is divided by how far they are.
        far = max(1.0, _largest_offset(queries, self._centre) * self._unit)
        half_norms = self._half_norms if far == 1.0 else (self._half_norms / far).astype(self._kind)
        indices = np.empty((len(queries), count), dtype=np.int64)
        squared = np.empty((len(queries), count))
        for start in range(0, len(queries), block):
            rows = slice(start, start + block)
            left = (queries[rows] - self._centre) * (self._unit / far)
            scores = left.astype(self._kind) @ self._right_t
            np.subtract(half_norms, scores, out=scores)
            slack = 2.0 * _rounding(np.linalg.norm(left, axis=1), self._reach, queries.shape[1], self._kind)
            near = scores <= _limits(scores, count, slack)[:, None]
            query, target = np.divmod(np.flatnonzero(near), near.shape[1])  # far faster than nonzero in 2D
            indices[rows], squared[rows] = _ranked(query, target, queries[rows], targets, count)
        return (indices[:, 0], squared[:, 0]) if count == 1 else (indices, squared)


def _checked(rows: FloatArray, name: str) -> FloatArray:
    array = np.asarray(rows, dtype=np.float64)
    if array.ndim != 2:
        raise InputError(f"{name} have shape {array.shape}, not (rows, columns)", remedy="give one row a point")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InputError(f"{len(bad)} {name} are not finite, the first is row {bad[0]} (0-based)", remedy="drop them")
    return array


def _largest_offset(rows: FloatArray, centre: FloatArray) -> float:
    if not rows.size:
        return 0.0
    return float(max((rows.max(axis=0) - centre).max(), (centre - rows.min(axis=0)).max()))


def _rounding(lengths: FloatArray, reach: float, dimension: int, kind: np.dtype[np.floating]) -> FloatArray:
    """Bound the error of |t|^2 / 2 - q.t for |q| = lengths and |t| <= reach: storing, multiplying, adding up."""
    unit_roundoff = 0.5 * float(np.finfo(kind).eps)
    return np.asarray(1.01 * unit_roundoff * ((dimension + 4) * lengths * reach + 2.0 * reach**2)) + 1e-30


def _limits(scores: NDArray[np.floating], count: int, slack: FloatArray) -> NDArray[np.floating]:
    """Return, per row, the score that none of the `count` nearest exceeds, rounded up."""
    best = scores.min(axis=1) if count == 1 else np.partition(scores, count - 1, axis=1)[:, count - 1]
    limits = (best + slack).astype(scores.dtype)
    return np.asarray(np.nextafter(limits, np.array(np.inf, dtype=scores.dtype)))


def _ranked(
    query: IntArray, target: IntArray, queries: FloatArray, targets: FloatArray, count: int
) -> tuple[IntArray, FloatArray]:
    """Measure candidate pairs in double precision and keep the `count` nearest of each query."""
    distance = np.empty(len(query))
    step = max(1, _PAIR_ENTRIES // max(1, queries.shape[1]))
    for start in range(0, len(query), step):
        part = slice(start, start + step)
        distance[part] = np.square(queries[query[part]] - targets[target[part]]).sum(axis=1)
    order = np.lexsort((target, distance, query))
    first = np.searchsorted(query[order], np.arange(len(queries)))
    chosen = order[first[:, None] + np.arange(count)]
    return target[chosen], distance[chosen]
