"""Anchored matching: a game finds anchors, distances to them place every sample, functional maps reach every point."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from nonrigid.formulations.formulation import Correspondence, Pair, Solved, Stages
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.formulations.games import game
from nonrigid.formulations.judged_maps import KEEPING, Ground, Grown
from nonrigid.formulations.local_rigidity import moved_together
from nonrigid.formulations.model import ElasticNet, Problem
from nonrigid.formulations.orientation import Orientation
from nonrigid.formulations.ranges import (
    ABOVE_NONE,
    BELOW_ONE,
    COUNT,
    COUNT_OR_NONE,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    check_ranges,
)
from nonrigid.formulations.sampled_distances import SampledDistances, sampled_distances
from nonrigid.formulations.spectral_growth import bases, grown
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.arrays import IntArray

_GAIN = 0.002
"""Worth that a map has to gain when it grows again, for another time to be worth its while; see `Grown`."""

_HELD = 0.02
"""Worth that a map has to gain on a leash: it is held to images that keep distances, wrong ones as well."""

_WITNESSES = 2
"""Other starts that have to lead to the best map, for no other to be tried. One is not enough: starts share candidates,
and two of them may go wrong in the same way."""

_SETTLED = 0.005
"""Share of the samples in patches that are turned over, up to which a map need not be fitted once more."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """Say how one start's anchors differ from the settings': shapes differ in which start fails.

    Parameters
    ----------
    kernel_width, mix
        Factors of the settings of the same name.
    bridged
        Whether distances on the part may cross what was cut out, or go along it.
    peeled
        Whether the anchors are those of `GameTheoretic` without its second game, on that method's samples of the full
        surface: groups peeled off, and merged.
    """

    kernel_width: float = 1.0
    mix: float = 1.0
    bridged: bool = True
    peeled: bool = False


STARTS = (Start(), Start(peeled=True), Start(bridged=False))
"""Starts in the order in which they are tried."""

LAST_STARTS = (
    Start(kernel_width=5 / 3, mix=1.6),
    Start(kernel_width=2 / 3, mix=0.6),
    Start(kernel_width=5 / 3, mix=1.6, bridged=False),
)
"""Starts that are tried where these do not suffice: many anchors, and few. They come last, because on thin strips many
anchors may slide along the strip and agree all the better."""


_RANGES = {
    **dict.fromkeys(("part_samples", "full_samples", "per_sample", "fitted_samples", "steps"), COUNT),
    **dict.fromkeys(("first_size", "components", "last_components", "part_size", "full_size"), COUNT),
    **dict.fromkeys(("last_steps", "rounds", "repeats", "rigid_rounds"), COUNT_OR_NONE),
    "starts": (1, len(STARTS + LAST_STARTS)),
    **dict.fromkeys(("radii", "kernel_width", "reach", "local_reach", "rigid_reach", "rigid_tolerance"), POSITIVE),
    **dict.fromkeys(("trust_power", "placing_weight", "growing_weight"), NOT_NEGATIVE),
    **dict.fromkeys(("enough", "agreement", "unsure", "leash", "straying"), NOT_NEGATIVE),
    "mix": SHARE,
    "floor": BELOW_ONE,
    "kept": ABOVE_NONE,
}


@dataclass(frozen=True, kw_only=True)
class Anchored:
    """Match every vertex of the part to a point of the full surface, between its vertices where that fits better.

    1. "game": candidate matches that look alike compete on an elastic net; the winners are anchors.
    2. Distances to the anchors place every sample of the part. Those whose distances to their neighbours agree best
       become the next anchors, nearer ones; and again.
    3. "map": a functional map with orthonormal columns is fitted to the samples and better images are read off it, with
       ever more eigenfunctions. Before each fit, patches that are laid down as their own mirror images, such as an arm
       whose front and back are exchanged, are turned back. Where its mean confidence is low, as on parts torn by many
       holes, it also grows on a leash: images far from where the surest ones place them are put there.
    4. Several starts are tried, which differ in the game and in whether ways on the part may cross what was cut out,
       until a map is sure or three starts have led to the same one. Of two maps the better one has the higher mean
       confidence, with the likeness of descriptors counted in.
    5. Where the mean confidence of the best map stays low, its best images become anchors in their turn, and steps 2
       and 3 are done again while that makes it better.
    6. The last map reads off every vertex, images that stray looked for again near where the surest ones place them,
       and a point of a triangle around the best vertex.
    7. Each image moves to where the rigid motion puts it that takes its neighbours to their images.

    Descriptors take part in each step; after the games, by how far they can be trusted: near its boundary a part does
    not look like the whole.

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
    first_size, steps, last_steps
        Eigenfunctions of the part in the first map, number of maps of each start, and of the best one once more, 0 for
        not once more: slower growth is mostly, but not always, better.
    components, last_components
        Principal components of the descriptors that stand beside eigenfunctions while maps grow, and in the end.
    bridged
        Whether starts may measure ways on the part across what was cut out; see
        `nonrigid.geometry.geodesics.BridgedGeodesics`.
    starts, enough, agreement
        Largest number of starts, of `STARTS` and then of `LAST_STARTS`; no other is tried once the best map has a mean
        confidence of `enough`, or two other starts' maps put a share `agreement` of its samples in the same places:
        starts that go wrong rarely all do so in the same way.
    repeats
        How often, at most, the images of a map that is not sure enough become anchors again.
    unsure
        Mean confidence below which maps grow on a leash, too.
    leash, straying
        How far an image may lie from where the surest samples' distances place it, in units of sqrt(full area): while
        a map grows on a leash, and in the end.
    oriented
        Whether patches that a growing map turns over are turned back; see
        `nonrigid.formulations.orientation.Orientation`.
    part_size, full_size
        Largest numbers of eigenfunctions.
    rigid_rounds, rigid_reach, rigid_tolerance
        How often, in the end, each image moves to where its neighbours' put it, 0 for never; see
        `nonrigid.formulations.local_rigidity.locally_rigid`. Lengths in units of sqrt(full area).
    between_vertices
        Whether a match may lie inside a triangle of the full surface; else it is the best vertex.

    Examples
    --------
    >>> Anchored(steps=3).steps
    3
    """

    radii: tuple[float, ...] = (0.04, 0.10)
    trust_power: float = 1.0
    part_samples: int = 300
    full_samples: int = 1500
    per_sample: int = 10
    kernel_width: float = 0.03
    mix: float = 0.5
    floor: float = 0.05
    reach: float = 0.25
    local_reach: float = 0.12
    rounds: int = 3
    kept: float = 0.6
    placing_weight: float = 0.03
    growing_weight: float = 0.004
    fitted_samples: int = 1000
    first_size: int = 20
    steps: int = 5
    last_steps: int = 20
    components: int = 80
    last_components: int = 200
    bridged: bool = True
    starts: int = 6
    enough: float = 0.85
    agreement: float = 0.9
    repeats: int = 3
    unsure: float = 0.8
    leash: float = 0.04
    straying: float = 0.1
    oriented: bool = True
    part_size: int = 100
    full_size: int = 200
    rigid_rounds: int = 2
    rigid_reach: float = 0.05
    rigid_tolerance: float = 0.005
    between_vertices: bool = True

    method: ClassVar[str] = "anchored"

    def stages(self, pair: Pair) -> Stages:
        """State the game, then one map a step; return one point a vertex of the part."""
        check_ranges(vars(self), _RANGES)
        descriptors = trusted_descriptors(pair, self.radii, power=self.trust_power)
        along = sampled_distances(
            pair,
            descriptors,
            part_samples=self.part_samples,
            placed_samples=self.fitted_samples,
            full_samples=self.full_samples,
        )
        basis = bases(
            pair,
            descriptors,
            part_size=self.part_size,
            full_size=self.full_size,
            descriptor_weight=self.growing_weight,
            components=self.components,
            last_components=self.last_components,
        )
        bridged = along.measured(pair, "bridged") if self.bridged else along
        ground = Ground(pair, basis, along, bridged, Orientation.of(pair, along.points))
        best = yield from self._searched(ground)
        if self.last_steps:
            best = max(best, (yield from self._grown(ground, best.rows, self.last_steps)))
            best = yield from self._leashed(ground, best)
        everywhere = np.arange(len(pair.part.mesh.vertices))
        strays = partial(self._strays, ground, everywhere)
        found, nearest = basis.read_off(best.C, pair.full.mesh, strays=strays, length=self.straying)
        for _ in range(self.rigid_rounds):
            found = moved_together(pair, found, reach=self.rigid_reach, tolerance=self.rigid_tolerance)
        nearest = found.nearest_corner(pair.full.mesh) if self.rigid_rounds else nearest
        confidence = ground.confidence(everywhere, nearest)
        if not self.between_vertices:
            return Correspondence.between_vertices(pair, everywhere, nearest, confidence)
        return Correspondence.of_every_vertex(pair, found, confidence)

    def _searched(self, ground: Ground) -> Generator[Problem, Solved, Grown]:
        """Grow a map from each start until the best is sure, and return that one."""
        first, last = ([start for start in group if start.bridged or self.bridged] for group in (STARTS, LAST_STARTS))
        maps: list[Grown] = []
        for start in first[: self.starts]:
            rows = yield from self._anchored(ground, start)
            maps.append((yield from self._tried(ground, rows)))
            if self._sure(ground, maps):
                break
        best = maps.index(max(maps))
        maps[best] = yield from self._repeated(ground, maps[best])
        for start in last[: max(0, self.starts - len(first))]:
            if self._sure(ground, maps):
                break
            rows = yield from self._anchored(ground, start)
            maps.append((yield from self._tried(ground, rows)))
            if not self._sure(ground, maps):
                maps[-1] = yield from self._repeated(ground, maps[-1])
        return max(maps)

    def _sure(self, ground: Ground, maps: list[Grown]) -> bool:
        """Tell whether the best map has enough confidence, or other starts have led to nearly the same one."""
        best = max(maps)
        agreeing = [ground.agreement(best, other) >= self.agreement for other in maps if other is not best]
        return best.score >= self.enough or sum(agreeing) >= _WITNESSES

    def _anchored(self, ground: Ground, start: Start) -> Generator[Problem, Solved, IntArray]:
        """Play the games of a start, and place the samples by their winners and then by one another."""
        samples = ground.bridged if start.bridged else ground.along
        width = self.kernel_width * start.kernel_width
        weight = self.placing_weight
        if start.peeled:
            peeling = GameTheoretic(
                radii=self.radii,
                part_samples=self.part_samples,
                per_sample=self.per_sample,
                kernel_width=width,
                geodesics=samples.geodesics,
                local_candidates=0,
            )
            part, full = (yield from peeling.stages(ground.pair)).view_vertices(ground.pair)
            on_part = ground.pair.part.distances(part, samples.geodesics)[:, samples.points]
            on_full = ground.pair.full.distances(full)[:, samples.grid]
            images = samples.placed_by(on_part, on_full, reach=self.reach, descriptor_weight=weight)
        else:
            matches = samples.candidates(self.per_sample)
            share = (
                yield game("game", samples.payoff(matches, width), ElasticNet(mix=min(self.mix * start.mix, 1.0)))
            )["u"]
            anchors = matches[matches.greedy(share, floor=self.floor)]
            images = samples.placed(anchors.part, anchors.full, reach=self.reach, descriptor_weight=weight)
        return self._settled(samples, images)

    def _settled(self, samples: SampledDistances, images: IntArray) -> IntArray:
        """Place all samples by those whose images agree best with their neighbours', and again."""
        for _ in range(self.rounds):
            sure = samples.surest(images, self.kept)
            images = samples.placed(sure, images[sure], reach=self.local_reach, descriptor_weight=self.placing_weight)
        return images

    def _again(self, ground: Ground, images: IntArray) -> IntArray:
        """Place all samples anew from the images of a map."""
        return self._settled(ground.bridged, ground.bridged.on_grid(ground.pair, images))

    def _tried(self, ground: Ground, rows: IntArray) -> Generator[Problem, Solved, Grown]:
        """Grow a map from images of the samples, and where it is unsure, on a leash as well; return the better one."""
        free = yield from self._grown(ground, rows, self.steps)
        if free.score >= self.unsure:
            return free
        held = yield from self._grown(ground, rows, self.steps, leash=self.leash)
        return held if held.worth >= free.worth + _HELD else free

    def _repeated(self, ground: Ground, best: Grown) -> Generator[Problem, Solved, Grown]:
        """Grow a map again from its own images, placed anew, while that makes it better."""
        for _ in range(self.repeats if best.score < self.enough else 0):
            before, best = best, max(best, (yield from self._tried(ground, self._again(ground, best.images))))
            if best.worth < before.worth + _GAIN:
                break
        return best

    def _leashed(self, ground: Ground, best: Grown) -> Generator[Problem, Solved, Grown]:
        """Grow a map on a leash, and again from its own images, while the best is unsure and that makes it better."""
        rows = best.rows
        for _ in range(self.repeats):
            if best.score >= self.unsure:
                break
            other = yield from self._grown(ground, rows, self.last_steps, leash=self.leash)
            if other.worth < best.worth + _GAIN:
                break
            best, rows = other, self._again(ground, other.images)
        return best

    def _grown(
        self, ground: Ground, rows: IntArray, steps: int, *, leash: float = np.inf
    ) -> Generator[Problem, Solved, Grown]:
        """Grow a map from images of the samples, and score it by its images, strays among them put right."""
        samples = ground.bridged
        held = partial(
            samples.leashed,
            ground.pair,
            length=leash,
            share=self.kept,
            reach=self.local_reach,
            descriptor_weight=self.placing_weight,
        )

        def corrected(images: IntArray) -> IntArray:
            images = held(images) if leash < np.inf else images
            return ground.orientation.turned_back(images) if self.oriented else images

        C, images = yield from grown(
            ground.basis,
            samples.points,
            samples.grid[rows],
            ground.basis.sizes(self.first_size, steps),
            grid=samples.grid,
            corrected=corrected,
            unsettled=lambda images: self.oriented and float(ground.orientation.turned_over(images).mean()) > _SETTLED,
        )
        far, around = self._strays(ground, samples.points, images)
        images[far] = around
        return ground.judged(C, rows, images)

    def _strays(self, ground: Ground, vertices: IntArray, nearest: IntArray) -> tuple[IntArray, IntArray]:
        """Return which images are not believed, and near which vertices they should lie."""
        return ground.along.strays(
            ground.pair, vertices, nearest, self.straying, share=self.kept, reach=self.local_reach, keeping=KEEPING
        )
