"""Where a point must lie on the full surface, given anchors that are matched already."""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

from nonrigid.formulations.candidates import Candidates, describe
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray, IntArray


def multilateration_cost(
    pair: Pair,
    points: IntArray,
    anchors: Candidates,
    *,
    reach: float,
    descriptor_weight: float,
    radii: tuple[float, ...],
    geodesics: str = "dijkstra",
) -> FloatArray:
    """Return, for vertices of the part and all vertices of the full surface, how badly they fit as a match.

    cost(x, y) = `placing_cost` + descriptor_weight |s(x) - S(y)|^2.

    Parameters
    ----------
    points
        (p,) vertices of the part.
    anchors
        Matches taken to be true.
    reach
        Distance at which an anchor counts 1/e, in units of sqrt(full area).
    descriptor_weight
        Weight of the squared difference of unit SHOT rows (0 to 4) against squared lengths.
    geodesics
        How distances are measured; see `nonrigid.geometry.geodesics.make_geodesics`.

    Returns
    -------
    (p, n_full), in units of the full area.
    """
    on_part = pair.part.distances(anchors.part, geodesics)[:, points]
    cost = placing_cost(on_part, pair.full.distances(anchors.full, geodesics), reach=reach)
    rows, columns = describe(pair.part, radii)[points], describe(pair.full, radii)
    cost += descriptor_weight * (2.0 - 2.0 * rows @ columns.T)
    return np.asarray(cost)


def placing_cost(
    on_part: FloatArray, on_full: FloatArray, *, reach: float, dtype: DTypeLike = np.float64
) -> FloatArray:
    """Return (p, n) how badly distances to anchors place each of p points at each of n others.

    cost(x, y) = sum_a w_a(x) (d(x, a) - D(y, a'))^2 / sum_a w_a(x) with w_a(x) = exp(-((d(x, a) - m) / reach)^2) and m
    the distance of x to its nearest anchor: near anchors count most, because long distances are those a cut disturbs.

    Parameters
    ----------
    on_part, on_full
        (a, p) and (a, n) distances to the anchors and to their images.
    reach
        Distance at which an anchor counts 1/e, in units of sqrt(full area).
    dtype
        Precision of the products: float32 takes half the time, and rounds to 1e-7 of the largest squared distance.

    Examples
    --------
    >>> placing_cost(np.array([[0.0], [1.0]]), np.array([[0.0, 1.0], [1.0, 0.0]]), reach=1.0).round(6)
    array([[0., 1.]])
    """
    weight = np.exp(-np.square((on_part - on_part.min(axis=0)) / reach))
    weight /= weight.sum(axis=0)
    own = (weight * on_part**2).sum(axis=0)[:, None]
    left = np.vstack([weight * (-2.0 * on_part), weight]).astype(dtype)
    right = np.vstack([on_full, np.square(on_full)]).astype(dtype)
    return np.asarray(own + left.T @ right, dtype=np.float64)


def local_matches(
    pair: Pair,
    points: IntArray,
    anchors: Candidates,
    *,
    count: int,
    farthest: float,
    radii: tuple[float, ...],
    reach: float = 0.25,
    descriptor_weight: float = 0.02,
    geodesics: str = "dijkstra",
) -> Candidates:
    """Return, for points of the part near an anchor, the `count` vertices of the full surface that fit best.

    Parameters
    ----------
    points
        (p,) vertices of the part.
    farthest
        Points farther than this from every anchor are left out, in units of sqrt(full area).
    reach, descriptor_weight, radii, geodesics
        See `multilateration_cost`.
    """
    near = pair.part.distances(anchors.part, geodesics)[:, points].min(axis=0) <= farthest
    points = points[near]
    cost = multilateration_cost(
        pair, points, anchors, reach=reach, descriptor_weight=descriptor_weight, radii=radii, geodesics=geodesics
    )
    count = min(count, cost.shape[1])
    best = np.sort(np.argpartition(cost, count - 1, axis=1)[:, :count], axis=1)
    return Candidates(np.repeat(points, count), best.ravel(), np.take_along_axis(cost, best, axis=1).ravel())
