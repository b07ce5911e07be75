"""Anchored matching: a game finds anchors, distances to them place every sample, functional maps reach every point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from nonrigid.formulations.formulation import Correspondence, Pair, Stages
from nonrigid.formulations.games import game
from nonrigid.formulations.interpolation import closest_feature_points
from nonrigid.formulations.model import ElasticNet
from nonrigid.formulations.sampled_distances import sampled_distances
from nonrigid.formulations.spectral_growth import bases, grown
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.maps import nearest_rows


@dataclass(frozen=True, kw_only=True)
class Anchored:
    """Match every vertex of the part to a point of the full surface, between its vertices where that fits better.

    1. "game": candidate matches that look alike compete on an elastic net; the winners are anchors.
    2. Distances to the anchors place every sample of the part. Those whose distances to their neighbours agree best
       become the next anchors, nearer ones; and again.
    3. "map": a functional map with orthonormal columns is fitted to the samples and better images are read off it, with
       ever more eigenfunctions. The last map reads off every vertex, and a point of a triangle around the best vertex.

    Descriptors take part in each step, by how far they can be trusted: near its boundary a part does not look like the
    whole.

    Parameters
    ----------
    radii
        Radii of the SHOT descriptors, in units of sqrt(full area).
    trust_power
        Power of the fall of trust in descriptors near the part's boundary; 0 for full trust everywhere.
    part_samples, full_samples, per_sample
        Samples of the game, and candidates of each sample of the part.
    kernel_width, mix, floor
        The game; see `nonrigid.formulations.elastic_net.ElasticNetMatching`.
    reach, local_reach
        Distance at which an anchor counts 1/e, in units of sqrt(full area): the game's, and the following ones.
    rounds, kept
        How often new anchors are chosen, and the share of the samples that become one.
    placing_weight, growing_weight
        Squared length, in units of the full area, that a squared difference 1 of unit descriptors is worth when samples
        are placed by distances, and beside eigenfunctions.
    fitted_samples
        Samples of the part to which functional maps are fitted.
    first_size, steps
        Eigenfunctions of the part in the first map, and number of maps.
    part_size, full_size
        Largest numbers of eigenfunctions.

    Examples
    --------
    >>> Anchored(steps=3).steps
    3
    """

    radii: tuple[float, ...] = (0.04, 0.10)
    trust_power: float = 2.0
    part_samples: int = 300
    full_samples: int = 1500
    per_sample: int = 10
    kernel_width: float = 0.03
    mix: float = 0.8
    floor: float = 0.05
    reach: float = 0.25
    local_reach: float = 0.12
    rounds: int = 3
    kept: float = 0.6
    placing_weight: float = 0.015
    growing_weight: float = 0.004
    fitted_samples: int = 1000
    first_size: int = 20
    steps: int = 5
    part_size: int = 100
    full_size: int = 200

    method: ClassVar[str] = "anchored"

    def stages(self, pair: Pair) -> Stages:
        """State the game, then one map a step; return one point a vertex of the part."""
        if self.steps < 1:
            raise InputError(f"steps is {self.steps}", remedy="fit one functional map at least")
        descriptors = trusted_descriptors(pair, self.radii, power=self.trust_power)
        samples = sampled_distances(
            pair,
            descriptors,
            part_samples=self.part_samples,
            placed_samples=self.fitted_samples,
            full_samples=self.full_samples,
        )
        matches = samples.candidates(self.per_sample)
        share = (yield game("game", samples.payoff(matches, self.kernel_width), ElasticNet(mix=self.mix)))["u"]
        anchors = matches[matches.greedy(share, floor=self.floor)]
        images = samples.placed(anchors.part, anchors.full, reach=self.reach, descriptor_weight=self.placing_weight)
        for _ in range(self.rounds):
            sure = samples.surest(images, self.kept)
            images = samples.placed(sure, images[sure], reach=self.local_reach, descriptor_weight=self.placing_weight)
        basis = bases(
            pair, descriptors, part_size=self.part_size, full_size=self.full_size, descriptor_weight=self.growing_weight
        )
        sizes = basis.sizes(self.first_size, self.steps)
        C, _ = yield from grown(basis, samples.points, samples.grid[images], sizes)
        queries, features = basis.features(C, slice(None))
        nearest = nearest_rows(queries, features)[0]
        found = closest_feature_points(queries, features, pair.full.mesh, nearest)
        # Where the repair split a vertex in several, its first copy speaks for it.
        raw, first = np.unique(pair.part.clean_view.raw_of_vertex, return_index=True)
        confidence = samples.confidence(pair, nearest, width=self.kernel_width)
        return Correspondence(raw, pair.full.clean_view.to_raw(found)[first], confidence[first])
