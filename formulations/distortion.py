"""How well pairs of matches agree: distances between two points of the part against those between their images."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from nonrigid.formulations.candidates import Candidates
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.certificates import certified_pairs
from nonrigid.geometry.errors import InputError, UnknownNameError

Sides: TypeAlias = Literal["two-sided", "one-sided", "certified"]
SIDES = ("two-sided", "one-sided", "certified")

_TILE = 256


def distortion(
    pair: Pair,
    matches: Candidates,
    *,
    sides: Sides = "two-sided",
    excess_weight: float = 0.3,
    geodesics: str = "dijkstra",
    keep: bool = True,
) -> FloatArray:
    """Return (n, n) disagreements of pairs of matches, in units of sqrt(full area).

    With d and D the geodesic distances on the part and on the full surface, "two-sided" is |d - D|. A path that the cut
    removed can only make d longer, never shorter, than the true D; so "one-sided" is max(0, D - d) + excess_weight *
    max(0, d - D), and "certified" is two-sided for pairs of points whose distance the cut left alone, one-sided for the
    others. That is read off distances along mesh edges without a margin, and so holds up to their error and to the
    length of boundary edges; see `nonrigid.geometry.certificates.certified_pairs`. `geodesics` says how both are
    measured: "bridged" ones may cross what was cut out, and be too short, so that only "two-sided" has a meaning for
    them.

    `keep=False` says that these candidates' distances will not be asked for again, and are not worth a place in the
    cache.

    Raises
    ------
    UnknownNameError
        If `sides` is not one of the three.
    InputError
        If `excess_weight` is not between 0 and 1, or other `sides` than "two-sided" meet "bridged" geodesics.
    """
    if sides not in SIDES:
        raise UnknownNameError("kind of distortion", sides, SIDES)
    if not 0.0 <= excess_weight <= 1.0:
        raise InputError(f"excess_weight is {excess_weight}", remedy="give a number between 0 and 1")
    if sides != "two-sided" and geodesics == "bridged":
        raise InputError(f"{sides} distortion of bridged distances", remedy='give geodesics="dijkstra" as well')
    part, of_part = _distinct(matches.part)
    full, of_full = _distinct(matches.full)
    on_part = pair.part.distances_between(part, geodesics)
    excess = between_all(on_part, of_part)
    excess -= between_all(pair.full.distances_between(full, geodesics, keep=keep), of_full)
    if sides == "two-sided":
        return np.abs(excess, out=excess)
    weight = np.full(on_part.shape, excess_weight)
    if sides == "certified":
        weight[certified_pairs(pair.part.mesh, pair.part.distances(part), part)] = 1.0
    longer = excess > 0.0
    np.abs(excess, out=excess)
    excess[longer] *= between_all(weight, of_part)[longer]
    return excess


def consistency(
    pair: Pair,
    matches: Candidates,
    *,
    kernel_width: float = 0.03,
    sides: Sides = "two-sided",
    excess_weight: float = 0.3,
    geodesics: str = "dijkstra",
    keep: bool = True,
) -> FloatArray:
    """Return the (n, n) payoff of pairs of matches: 1 for perfect agreement, 1/2 at a distortion of `kernel_width`.

    A = exp(-alpha eps^2) with alpha = ln 2 / kernel_width^2. The diagonal, and pairs that share a vertex, are zero:
    otherwise every vertex of the simplex would be optimal.

    Raises
    ------
    InputError
        If `kernel_width` is not positive.

    Source: SHREC'16 eq. (9).
    """
    if not kernel_width > 0.0:
        raise InputError(
            f"kernel_width is {kernel_width}", remedy="give a length in units of sqrt(full area), e.g. 0.03"
        )
    return payoff_of(
        distortion(pair, matches, sides=sides, excess_weight=excess_weight, geodesics=geodesics, keep=keep),
        matches,
        kernel_width,
    )


def payoff_of(disagreement: FloatArray, matches: Candidates, kernel_width: float) -> FloatArray:
    """Return the (n, n) payoff of disagreements between n matches, written over them; see `consistency`.

    Examples
    --------
    >>> two = Candidates(np.array([0, 1]), np.array([5, 6]), np.zeros(2))
    >>> payoff_of(np.array([[0.0, 0.03], [0.03, 0.0]]), two, 0.03).round(3)
    array([[0. , 0.5],
           [0.5, 0. ]])
    """
    payoff = np.square(disagreement, out=disagreement)
    payoff *= -np.log(2.0) / kernel_width**2
    np.exp(payoff, out=payoff)
    payoff[matches.conflicts()] = 0.0
    # Distances on a mesh are symmetric up to rounding only. A transposed copy of the whole would take far longer.
    for i in range(0, len(payoff), _TILE):
        for j in range(0, i + _TILE, _TILE):
            upper, lower = payoff[j : j + _TILE, i : i + _TILE], payoff[i : i + _TILE, j : j + _TILE]
            lower[:] = 0.5 * (lower + upper.T)
            upper[:] = lower.T
    return payoff


def between_all(square: FloatArray, rows: IntArray) -> FloatArray:
    """Return square[rows][:, rows], columns first: far faster than both at once where `rows` are many.

    Examples
    --------
    >>> between_all(np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([1, 1, 0]))
    array([[0., 0., 1.],
           [0., 0., 1.],
           [1., 1., 0.]])
    """
    return square.take(rows, axis=1).take(rows, axis=0)


def _distinct(vertices: IntArray) -> tuple[IntArray, IntArray]:
    """Return the distinct vertices, and the place of each given one among them."""
    distinct, place = np.unique(vertices, return_inverse=True)
    return distinct, np.asarray(place, dtype=np.int64)
