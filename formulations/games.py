"""Games between candidate matches: what the methods that maximize u'Au over shares of candidates have in common."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from nonrigid.formulations.candidates import Candidates, candidate_matches
from nonrigid.formulations.distortion import Sides, consistency
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.localisation import local_matches
from nonrigid.formulations.model import Problem, QuadraticForm, Set, Variable, maximize
from nonrigid.geometry.arrays import FloatArray


class GameSettings(Protocol):
    """Name the hyper-parameters that such a method has; `GameTheoretic` explains them."""

    @property
    def kernel_width(self) -> float:
        """Distortion that halves a payoff."""

    @property
    def part_samples(self) -> int:
        """Samples of the part."""

    @property
    def full_samples(self) -> int:
        """Samples of the full surface."""

    @property
    def per_sample(self) -> int:
        """Candidates of each sample of the part."""

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii of the descriptors."""

    @property
    def sides(self) -> Sides:
        """Which distortion."""

    @property
    def excess_weight(self) -> float:
        """Weight of distances that a cut may have lengthened."""

    @property
    def local_candidates(self) -> int:
        """Candidates of each sample in the second game."""

    @property
    def local_reach(self) -> float:
        """Largest distance to an anchor in the second game."""


def players(settings: GameSettings, pair: Pair) -> Candidates:
    """Return the candidates of the first game."""
    return candidate_matches(
        pair,
        part_samples=settings.part_samples,
        full_samples=settings.full_samples,
        per_sample=settings.per_sample,
        radii=settings.radii,
    )


def local_players(settings: GameSettings, pair: Pair, matches: Candidates, anchors: Candidates) -> Candidates:
    """Return the candidates of the second game: for each sample near an anchor, where the anchors place it."""
    return local_matches(
        pair,
        np.unique(matches.part),
        anchors,
        count=settings.local_candidates,
        farthest=settings.local_reach,
        radii=settings.radii,
    )


def payoffs(settings: GameSettings, pair: Pair, matches: Candidates, *, keep: bool) -> FloatArray:
    """Return the (n, n) payoff of a game; see `consistency`."""
    return consistency(
        pair,
        matches,
        kernel_width=settings.kernel_width,
        sides=settings.sides,
        excess_weight=settings.excess_weight,
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
