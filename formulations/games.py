"""Games between candidate matches: what the methods that maximize u'Au over shares of candidates have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.candidates import Candidates, candidate_matches
from nonrigid.formulations.distortion import Sides, consistency
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.localisation import local_matches
from nonrigid.formulations.model import Problem, QuadraticForm, Set, Variable, maximize
from nonrigid.formulations.ranges import COUNT_OR_NONE, NOT_NEGATIVE, POSITIVE, SHARE, check_ranges
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class GameSettings:
    """Hold the settings that methods of this kind share.

    Parameters
    ----------
    kernel_width
        Distortion at which two matches earn one half, in units of sqrt(full area).
    part_samples, full_samples, per_sample, radii
        Candidates of the first game; see `nonrigid.formulations.candidates.candidate_matches`.
    sides, excess_weight
        Which distortion; see `nonrigid.formulations.distortion.distortion`.
    geodesics
        How distances on the part and on the full surface are measured; see
        `nonrigid.geometry.geodesics.make_geodesics`. Published: plain ones, as "dijkstra".
    local_candidates
        Candidates of each sample in the second game; 0 for no second game.
    local_reach
        Distance to the nearest match, in units of sqrt(full area), up to which a sample takes part in the second game.
    """

    kernel_width: float = 0.03
    part_samples: int = 300
    full_samples: int = 1000
    per_sample: int = 10
    radii: tuple[float, ...] = (0.04, 0.10)
    sides: Sides = "two-sided"
    excess_weight: float = 0.3
    geodesics: str = "bridged"
    local_candidates: int = 6
    local_reach: float = 0.15


_RANGES = {
    **dict.fromkeys(("kernel_width", "radii"), POSITIVE),
    "local_candidates": COUNT_OR_NONE,
    "local_reach": NOT_NEGATIVE,
    "excess_weight": SHARE,
}


def players(settings: GameSettings, pair: Pair) -> Candidates:
    """Return the candidates of the first game, with the distances between all samples of the full surface known.

    Those depend on no part: in the cache, they serve every part of that surface.

    Raises
    ------
    InputError
        If a setting is out of range, or most vertices have no descriptor.
    """
    check_ranges(vars(settings), _RANGES)
    matches = candidate_matches(
        pair,
        part_samples=settings.part_samples,
        full_samples=settings.full_samples,
        per_sample=settings.per_sample,
        radii=settings.radii,
    )
    samples = pair.full.samples(min(settings.full_samples, len(pair.full.mesh.vertices)))
    pair.full.distances_between(samples, settings.geodesics)
    return matches


def local_players(settings: GameSettings, pair: Pair, matches: Candidates, anchors: Candidates) -> Candidates:
    """Return the candidates of the second game: for each sample near an anchor, where the anchors place it."""
    return local_matches(
        pair,
        np.unique(matches.part),
        anchors,
        count=settings.local_candidates,
        farthest=settings.local_reach,
        radii=settings.radii,
        geodesics=settings.geodesics,
    )


def payoffs(settings: GameSettings, pair: Pair, matches: Candidates, *, keep: bool) -> FloatArray:
    """Return the (n, n) payoff of a game; see `consistency`."""
    return consistency(
        pair,
        matches,
        kernel_width=settings.kernel_width,
        sides=settings.sides,
        excess_weight=settings.excess_weight,
        geodesics=settings.geodesics,
        keep=keep,
    )


def game(name: str, payoff: FloatArray, surface: Set) -> Problem:
    """Return the problem of maximizing u'Au over a surface of shares.

    Examples
    --------
    >>> from nonrigid.formulations.model import Simplex
    >>> print(game("game", np.zeros((2, 2)), Simplex()))
    game: maximize QuadraticForm(u)
      subject to u in Simplex()
      with u of shape (2,)
    """
    u = Variable("u", len(payoff))
    return Problem(name, maximize(QuadraticForm(payoff)(u)), u @ surface)


def read_out(pair: Pair, matches: Candidates, share: FloatArray, *, floor: float) -> Correspondence:
    """Return the conflict-free matches of the largest shares, down to `floor` of the largest."""
    kept = matches.greedy(share, floor=floor)
    return Correspondence.between_vertices(pair, matches.part[kept], matches.full[kept], share[kept] / share.max())
