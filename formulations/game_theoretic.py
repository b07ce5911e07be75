"""Game-theoretic matching: candidate matches compete, and mutually consistent groups survive."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np

from nonrigid.formulations.candidates import Candidates
from nonrigid.formulations.formulation import Pair, Solved, Stages
from nonrigid.formulations.games import GameSettings, game, local_players, payoffs, players, read_out
from nonrigid.formulations.model import Problem, Simplex
from nonrigid.formulations.ranges import COUNT, SHARE, check_ranges
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError

NEGLIGIBLE = 1e-3
"""Share of the largest entry below which a strategy counts as extinct: first-order solvers leave dust behind."""


@dataclass(frozen=True, kw_only=True)
class GameTheoretic(GameSettings):
    """Match by the stable groups of a game between candidate matches: maximize u'Au over the simplex.

    Two candidates earn A = exp(-alpha eps^2) from each other if distances agree up to eps, nothing if they share a
    point. The support of a maximizer is a group of matches that agree. Groups are peeled off one after another, and
    those that agree with one another are merged, so that the true and the mirrored map never mix. A second game,
    between the full surface's vertices around where the first one's matches place each sample, makes the answer
    denser and finer.

    Parameters
    ----------
    groups
        Largest number of groups peeled off in the first game.
    group_quality
        A group is kept while x'Ax / (1 - 1/m), its mean payoff, is at least this share of the first group's.
    agreement
        Mean payoff between two groups at which they may be merged.
    kernel_width, part_samples, full_samples, per_sample, radii, sides, excess_weight, geodesics, local_candidates,
    local_reach
        See `nonrigid.formulations.games.GameSettings`.

    Source: Rodola, Bronstein, Albarelli, Bergamasco and Torsello, a game-theoretic approach to deformable shape
    matching (CVPR 2012); SHREC'16 eqs. (9), (10). The numbers are this package's choice: the papers do not give them.

    Examples
    --------
    >>> GameTheoretic(kernel_width=0.02).kernel_width
    0.02
    """

    groups: int = 3
    group_quality: float = 0.8
    agreement: float = 0.5

    method: ClassVar[str] = "gt"

    def stages(self, pair: Pair) -> Stages:
        """State the game (once a peeled group), then the local game; return one match a surviving sample."""
        check_ranges(vars(self), {"groups": COUNT, "group_quality": SHARE, "agreement": SHARE})
        matches = players(self, pair)
        share = yield from self._play("game", pair, matches, groups=self.groups)
        if self.local_candidates:
            matches = local_players(self, pair, matches, matches[share > 0.0])
            share = yield from self._play("local", pair, matches, groups=1)
        return read_out(pair, matches, share, floor=NEGLIGIBLE)

    def _play(
        self, name: str, pair: Pair, matches: Candidates, *, groups: int
    ) -> Generator[Problem, Solved, FloatArray]:
        """Solve a game, set its survivors and their rivals aside, solve the rest, and so on; merge what agrees.

        Return the share of each candidate in the winning coalition.
        """
        if len(matches) < 2:
            raise InputError(
                f"{len(matches)} candidate matches are no game", remedy="give more samples, or more candidates of each"
            )
        payoff = payoffs(self, pair, matches, keep=name == "game")
        found: list[tuple[IntArray, FloatArray]] = []
        rest = np.arange(len(matches))
        best = 0.0
        while len(found) < groups and len(rest) > 1:
            solution = yield game(name, payoff if not found else payoff[np.ix_(rest, rest)], Simplex())
            members, share = _survivors(solution["u"])
            quality = solution.objective / (1.0 - 1.0 / max(len(members), 2))
            if found and quality < self.group_quality * best:
                break
            best = max(best, quality)
            found.append((rest[members], share))
            rest = rest[~matches[rest].in_conflict_with(matches[rest[members]])]
        return self._merge(payoff, found)

    def _merge(self, payoff: FloatArray, groups: list[tuple[IntArray, FloatArray]]) -> FloatArray:
        """Return the shares in the coalition of agreeing groups that earns most over all its pairs of matches."""
        mean = np.array([[payoff[np.ix_(a, b)].mean() for b, _ in groups] for a, _ in groups])
        size = np.array([len(members) for members, _ in groups], dtype=float)

        def worth(coalition: tuple[int, ...]) -> float:
            inside = np.ix_(coalition, coalition)
            apart = mean[inside][~np.eye(len(coalition), dtype=bool)]
            if len(apart) and apart.min() < self.agreement:
                return -np.inf
            return float(size[list(coalition)] @ mean[inside] @ size[list(coalition)])

        every = [c for count in range(1, len(groups) + 1) for c in combinations(range(len(groups)), count)]
        winner = max(every, key=worth)
        shares = np.zeros(len(payoff))
        for members, share in (groups[index] for index in winner):
            shares[members] = share
        return shares


def _survivors(u: FloatArray) -> tuple[IntArray, FloatArray]:
    members = np.flatnonzero(u > NEGLIGIBLE * u.max())
    return members, u[members]
