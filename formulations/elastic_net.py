"""Elastic-net matching: soft groups of candidate matches, between the sparse game and the spectral relaxation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from nonrigid.formulations.formulation import Pair, Stages
from nonrigid.formulations.games import GameSettings, game, local_players, payoffs, players, read_out
from nonrigid.formulations.model import ElasticNet
from nonrigid.formulations.ranges import BELOW_ONE, SHARE, check_ranges


@dataclass(frozen=True, kw_only=True)
class ElasticNetMatching(GameSettings):
    """Match by the shares that maximize u'Au over the elastic net (1 - mix) 1'u + mix u'u = 1, u >= 0.

    mix = 0 is the game of `GameTheoretic`, whose maximizers are sparse; mix = 1 the leading eigenvector of spectral
    matching, which spreads over all candidates. Matches are read out greedily by falling share, at most one a point.

    The text of SHREC'16 prints `min` before u'Au. With a similarity A >= 0 of zero diagonal that problem is
    degenerate: every vertex, one candidate alone, attains the least value 0. So it is no option here; a test states
    it as the negative control.

    Parameters
    ----------
    mix
        Weight of the squared 2-norm, in [0, 1].
    floor
        Share, relative to the largest, down to which candidates are read out.
    kernel_width, part_samples, full_samples, per_sample, radii, sides, excess_weight, geodesics, local_candidates,
    local_reach
        See `nonrigid.formulations.games.GameSettings`.

    Source: Rodola, Torsello, Harada, Kuniyoshi and Cremers, elastic net constraints for shape matching (ICCV 2013);
    SHREC'16 eqs. (11) to (13). The numbers but `mix` are this package's choice.

    Examples
    --------
    >>> ElasticNetMatching(mix=0.5).mix
    0.5
    """

    mix: float = 0.8
    floor: float = 0.35

    method: ClassVar[str] = "en"

    def stages(self, pair: Pair) -> Stages:
        """State the problem on the candidates, then on those around its matches; read the matches out."""
        check_ranges(vars(self), {"mix": SHARE, "floor": BELOW_ONE})
        matches = players(self, pair)
        surface = ElasticNet(mix=self.mix)
        share = (yield game("elastic-net", payoffs(self, pair, matches, keep=True), surface))["u"]
        if self.local_candidates:
            anchors = matches[matches.greedy(share, floor=self.floor)]
            matches = local_players(self, pair, matches, anchors)
            share = (yield game("local", payoffs(self, pair, matches, keep=False), surface))["u"]
        return read_out(pair, matches, share, floor=self.floor)
