"""Partial functional maps: a functional map and the region of the whole it covers, found by turns."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from nonrigid.formulations.candidates import describe, principal_axes, require_descriptors
from nonrigid.formulations.formulation import Correspondence, Pair, Solved, Stages
from nonrigid.formulations.functional_maps import (
    diagonal_start,
    estimated_rank,
    matched_rows,
    orthonormal_map,
    region_of_matches,
    slanted_mask,
    spectral_closest_points,
)
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.formulations.model import Problem, Variable, free, minimize
from nonrigid.formulations.model.terms.area_gap import AreaGap
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.formulations.model.terms.masked_data import MaskedBasis, MaskedData
from nonrigid.formulations.model.terms.mumford_shah import MumfordShah
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.formulations.ranges import COUNT, COUNT_OR_NONE, NOT_NEGATIVE, POSITIVE, check_ranges
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.geodesics import make_geodesics
from nonrigid.geometry.maps import nearest_rows
from nonrigid.geometry.spectrum import Spectrum

Start = Literal["several", "mask", "descriptors", "anchors"]
_STARTS = ("several", "mask", "descriptors", "anchors")
_ENOUGH = 2e-3  # share of its energy by which a step in C has to lie below the one before it for another round
_TRIAL = 2  # rounds after which starts are compared: one region found for each
_NEAR = 1.05  # starts with an energy up to this many times the lowest go on to the end
_APART = 0.01  # unless their images lie nearer than this to those of one that does, mean, in sqrt(full area)


_RANGES = {
    **dict.fromkeys(("eigenfunctions", "rounds", "closest_point_samples", "start_samples", "components"), COUNT),
    **dict.fromkeys(("map_evaluations", "region_evaluations"), COUNT),
    **dict.fromkeys(("landmarks", "closest_point_iterations"), COUNT_OR_NONE),
    **dict.fromkeys(("mask_weight", "orthogonality_weight", "area_weight", "edge_weight"), NOT_NEGATIVE),
    **dict.fromkeys(("radii", "landmark_decay"), POSITIVE),
}


@dataclass(frozen=True, kw_only=True)
class PartialFunctionalMap:
    """Match densely by a functional map C and a soft region eta(v) of the whole that explain the part's descriptors.

    Minimize over C, (k, k), and v, one number a vertex of the whole,

        ||C A - B(eta(v))||_{2,1} + mask_weight ||C o W||_F^2 + orthogonality_weight ||C'C - diag(d)||_F^2
        + area_weight (|part| - |eta(v)|)^2 + edge_weight * integral of xi(v) |grad v|,

    A and B the coefficients of descriptors, W 0 along a slanted diagonal, d one for as many columns as the part has
    eigenfunctions with a counterpart. C and v are found by turns; between them C is made orthonormal by closest
    points. The alternation ends, one round back, when a step in C ends no lower than the one before it did, the terms
    in v alone not counted; and when it ends lower by less than 0.2 %. Then it runs again on functions of the distances
    to landmarks that the first run matched.

    Parameters
    ----------
    eigenfunctions
        k; a surface with fewer vertices gives fewer.
    radii
        Radii of the SHOT descriptors, in units of sqrt(full area).
    start
        Where the first run begins. "mask": C is large where W is small, as published but for its scale; see
        `diagonal_start`; the region is the whole. "descriptors": C is the robust orthonormal map of the nearest
        descriptors at the last of `start_radii`, the region where most of them lie. "several": the former, and the
        latter at each of `start_radii`, run for two rounds each; the one whose last step in C ends lowest goes on,
        and so does one that ends up to 5 % higher and matches samples elsewhere, by 0.01 sqrt(full area) in the mean.
        Whichever ends its last run lowest is the answer.
        "anchors": as "mask", with landmarks instead of descriptors, the matches of `GameTheoretic`.
    start_radii
        Radii of the SHOT descriptors that starts are made from, in units of sqrt(full area).
    start_samples
        Number of samples of the part whose nearest descriptors make a start.
    components
        Principal components of the descriptors that the energy sees, as far as there are more; starts see all of them.
    mask_weight, orthogonality_weight, area_weight, edge_weight
        Weights for a full surface of area 1. The published ones, 1, 1e3, 1 and 1e2, hold for an area of about 1.75e4:
        lengths there are 132 times longer, and the terms change as its powers 0, 0, 4 and 1, the data as its power 1.
    rounds
        Largest number of alternations of a run.
    landmarks
        Number of landmarks of the second run; 0 for no second run.
    landmark_decay
        Landmark functions are exp(-decay * distance), decay in units of 1 / sqrt(full area).
    closest_point_iterations, closest_point_samples
        Of the step between C and v: steps at most, and samples of the part.
    map_evaluations, region_evaluations
        Evaluations granted to each problem in C and in v: exact answers of the blocks gain nothing.

    Source: Rodola, Cosmo, Bronstein, Torsello and Cremers, partial functional correspondence (CGF 2017).

    Examples
    --------
    >>> PartialFunctionalMap(start="anchors").eigenfunctions
    90
    """

    eigenfunctions: int = 90
    radii: tuple[float, ...] = (0.04,)
    start: Start = "several"
    start_radii: tuple[float, ...] = (0.04, 0.10)
    start_samples: int = 1000
    components: int = 80
    mask_weight: float = 7.6e-3
    orthogonality_weight: float = 7.6
    area_weight: float = 2.3e6
    edge_weight: float = 1e2
    rounds: int = 6
    landmarks: int = 50
    landmark_decay: float = 46.0
    closest_point_iterations: int = 10
    closest_point_samples: int = 500
    map_evaluations: int = 200
    region_evaluations: int = 40

    method: ClassVar[str] = "pfm"

    def stages(self, pair: Pair) -> Stages:
        """State the problems in C and in v by turns; return one match a vertex of the part."""
        self._check()
        bases = Bases.of(pair, self.eigenfunctions, self.closest_point_samples)
        if self.start == "anchors":
            anchors = yield from GameTheoretic().stages(pair)
            descriptors = self._near(pair, *anchors.view_vertices(pair))
        else:
            require_descriptors(pair, self.radii)
            descriptors = describe(pair.part, self.radii), describe(pair.full, self.radii)
        joint = self.joint(pair, bases, descriptors)
        starts = self._starts(pair, bases)
        trial = min(_TRIAL, self.rounds) if len(starts) > 1 else self.rounds
        tried = []
        for start in starts:
            tried.append((yield from self._alternate(joint, bases, start, trial)))
        ends = []
        for state in bases.contenders(tried):
            ended = state
            if trial < self.rounds and not state.ended:
                ended = yield from self._alternate(joint, bases, state, self.rounds - trial)
            ends.append((yield from self._again(pair, bases, ended)) if self.landmarks else ended)
        kept = min(ends, key=lambda state: state.energy)
        everywhere = np.arange(len(pair.part.mesh.vertices))
        return Correspondence.between_vertices(pair, everywhere, bases.matched(kept.C, everywhere))

    def joint(self, pair: Pair, bases: Bases, descriptors: tuple[FloatArray, FloatArray]) -> Problem:
        """Return the problem in C and v for descriptors (n, q) of the part and of the whole."""
        C, v = Variable("C", (bases.size, bases.size)), Variable("v", len(bases.full.mass))
        axes = principal_axes(descriptors[1], self.components)
        kept = descriptors[1] @ axes
        whole = MaskedBasis(bases.full.eigenfunctions, bases.full.mass, kept, np.float32, mixing=axes)
        mesh = pair.full.mesh
        energy = (
            MaskedData(bases.part.project(descriptors[0] @ axes) @ axes.T, whole)(C, v)
            + self.mask_weight * WeightedSquares(slanted_mask(bases.size, bases.rank))(C)
            + self.area_weight * AreaGap(bases.full.mass, float(bases.part.mass.sum()))(v)
            + self.edge_weight * MumfordShah(mesh.vertices, mesh.faces)(v)
        )
        if self.orthogonality_weight:
            wanted = (np.arange(bases.size) < bases.rank).astype(float)
            energy = energy + self.orthogonality_weight * GramPenalty(wanted)(C)
        return Problem("partial functional map", minimize(energy), C @ free(), v @ free())

    def _check(self) -> None:
        if self.start not in _STARTS:
            raise UnknownNameError("start", self.start, _STARTS)
        check_ranges(vars(self), _RANGES)
        if self.start in ("several", "descriptors") and not self.start_radii:
            raise InputError(f"start_radii is empty and start {self.start!r}", remedy="give a radius, such as 0.1")

    def _starts(self, pair: Pair, bases: Bases) -> list[_State]:
        """Return the maps and regions that the first run begins with."""
        everything = np.ones(len(bases.full.mass))
        mask = _State(C=diagonal_start(slanted_mask(bases.size, bases.rank), bases.rank), v=everything)
        if self.start in ("mask", "anchors"):
            return [mask]
        if self.start == "descriptors":
            return [self._of_descriptors(pair, bases, self.start_radii[-1])]
        return [mask, *(self._of_descriptors(pair, bases, radius) for radius in self.start_radii)]

    def _of_descriptors(self, pair: Pair, bases: Bases, radius: float) -> _State:
        """Return the orthonormal map and the region of the nearest descriptors of samples."""
        chosen = pair.part.samples(min(self.start_samples, len(pair.part.mesh.vertices)))
        found, _ = nearest_rows(describe(pair.part, (radius,))[chosen], describe(pair.full, (radius,)))
        C = bases.padded(orthonormal_map(bases.part.eigenfunctions[chosen, : bases.rank], bases.full_rows[found]))
        weights = bases.part.mass[chosen]
        return _State(C=C, v=region_of_matches(found, weights, bases.full, float(bases.part.mass.sum())))

    def _alternate(
        self, joint: Problem, bases: Bases, state: _State, rounds: int
    ) -> Generator[Problem, Solved, _State]:
        """Solve for v, unless it is given with the start, and for C by turns, while the energy of C falls."""
        for _ in range(rounds):
            v = state.v
            if state.mapped:
                image = bases.full.eigenfunctions @ (state.C @ bases.part.project(np.ones(len(bases.part.mass))))
                solved = yield joint.fix(C=state.C).stage("v", start={"v": image}, evaluations=self.region_evaluations)
                v = solved["v"]
            solved = yield joint.fix(v=v).stage("C", start={"C": state.C}, evaluations=self.map_evaluations)
            if solved.objective >= state.energy:
                return replace(state, ended=True)
            C = bases.orthonormal(solved["C"], self.closest_point_iterations)
            settled = solved.objective >= (1.0 - _ENOUGH) * state.energy
            energy = solved.objective if state.mapped else np.inf
            state = _State(C=C, v=v, energy=energy, mapped=True, ended=settled)
            if settled:
                break
        return state

    def _again(self, pair: Pair, bases: Bases, state: _State) -> Generator[Problem, Solved, _State]:
        """Run once more, on functions of the distances to landmarks that a first run matched."""
        chosen = pair.part.samples(min(self.landmarks, len(pair.part.mesh.vertices)))
        joint = self.joint(pair, bases, self._near(pair, chosen, bases.matched(state.C, chosen)))
        begin = _State(C=state.C, v=np.ones_like(state.v))
        return (yield from self._alternate(joint, bases, begin, self.rounds))

    def _near(self, pair: Pair, part: IntArray, full: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return functions that fall off exponentially from matched vertices, one a match, on either surface."""
        around_part = pair.part.distances(part)
        around_full = make_geodesics(pair.full.mesh, "dijkstra").distances(full)  # no other run asks for these again
        return np.exp(-self.landmark_decay * around_part.T), np.exp(-self.landmark_decay * around_full.T)


@dataclass(frozen=True, eq=False, kw_only=True)
class Bases:
    """Hold the eigenfunctions of either surface, the rank of maps between them, and samples for closest points.

    `vertices`: those of the whole, whose area is 1.
    """

    part: Spectrum
    full: Spectrum
    rank: int
    samples: IntArray
    vertices: FloatArray

    @classmethod
    def of(cls, pair: Pair, eigenfunctions: int, samples: int) -> Bases:
        """Return the bases of a pair, as many eigenfunctions as wanted or as the smaller surface has."""
        fewest = min(len(pair.part.mesh.vertices), len(pair.full.mesh.vertices))
        size = min(eigenfunctions, fewest - 1)
        part, full = pair.part.spectrum(size), pair.full.spectrum(size)
        chosen = pair.part.samples(min(samples, len(pair.part.mesh.vertices)))
        rank = estimated_rank(part.eigenvalues, full.eigenvalues)
        return cls(part=part, full=full, rank=rank, samples=chosen, vertices=pair.full.mesh.vertices)

    @property
    def size(self) -> int:
        """Number of eigenfunctions."""
        return len(self.full.eigenvalues)

    @property
    def full_rows(self) -> FloatArray:
        """One row a vertex of the whole, (n, k)."""
        return self.full.eigenfunctions

    def orthonormal(self, C: FloatArray, iterations: int) -> FloatArray:
        """Return the map that closest points make of C: orthonormal columns up to the rank, zeros beyond it."""
        rows = self.part.eigenfunctions[self.samples, : self.rank]
        D, _ = spectral_closest_points(C[:, : self.rank], rows, self.full_rows, iterations=iterations)
        return self.padded(D)

    def padded(self, D: FloatArray) -> FloatArray:
        """Return the (k, k) map of a (k, rank) one: zeros beyond the rank."""
        return np.hstack([D, np.zeros((self.size, self.size - self.rank))])

    def contenders(self, tried: Sequence[_State]) -> list[_State]:
        """Return the state of lowest energy, and those near it in energy whose matches of samples lie elsewhere."""
        ordered = sorted(tried, key=lambda state: state.energy)
        kept, places = ordered[:1], [self.images(ordered[0].C)]
        for state in ordered[1:]:
            if state.energy > _NEAR * kept[0].energy:
                break
            image = self.images(state.C)
            if all(np.linalg.norm(image - other, axis=1).mean() > _APART for other in places):
                kept.append(state)
                places.append(image)
        return kept

    def images(self, C: FloatArray) -> FloatArray:
        """Return where the samples' matches lie, (samples, 3)."""
        return self.vertices[self.matched(C, self.samples)]

    def matched(self, C: FloatArray, part: IntArray) -> IntArray:
        """Return, for vertices of the part, the vertex of the whole nearest to their image."""
        return matched_rows(C[:, : self.rank], self.part.eigenfunctions[part, : self.rank], self.full_rows)


@dataclass(frozen=True, eq=False, kw_only=True)
class _State:
    """Hold a map, its region, and the energy that its step in C ended with, infinite until a region is solved for.

    `mapped`: a step in C has been taken; `ended`: the next one would end no lower.
    """

    C: FloatArray
    v: FloatArray
    energy: float = np.inf
    mapped: bool = False
    ended: bool = False
