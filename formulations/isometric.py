"""Scale-invariant isometric matching: a few samples by exact search, then more by linear assignment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from nonrigid.formulations.formulation import Correspondence, Pair, Stages
from nonrigid.formulations.model import Problem, Variable, minimize
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.formulations.ranges import ABOVE_NONE, COUNT, check_ranges
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.surface import Surface

Ratio: TypeAlias = Literal["folded", "logarithmic"]
RATIOS = ("folded", "logarithmic")


@dataclass(frozen=True, kw_only=True)
class IsometricMatching:
    """Match by the injective map of few far samples that comes closest to scaling all distances alike.

    "sparse": the first `sources` of `part_samples` farthest-point samples of the part are mapped to `full_samples`
    samples of the full surface so that the mean of |r_ia - r_ic| is least, with r_ia the ratio of the distances of
    samples i and a on both surfaces. "extension": `matches` samples of the part are assigned to samples of the full
    surface at least total cost, the cost of (p, q) being the mean over the sparse matches (s, t) of
    |d(p, s) / scale - D(q, t)|; the worst are dropped.

    Distances alone cannot tell the true from the mirrored map.

    Parameters
    ----------
    part_samples, full_samples
        Numbers of farthest-point samples for the sparse map. Give up to 20 of the full surface where a part may lack
        its extremities.
    sources
        Number of samples of the part that are mapped, at least 3; all injective maps are searched.
    ratio
        "folded", max(r, 1/r) as published, for which twice and half as long are the same; "logarithmic", log r, which
        tells them apart.
    matches
        Number of samples of the part in the extension.
    extension_samples
        Samples of the full surface among which each of them has its `per_sample` cheapest as candidates.
    per_sample
        See above; the candidates of all samples together are the columns of the assignment.
    kept
        Share of the assigned pairs that are kept, the cheapest.

    Source: SHREC'16, scale-invariant isometric matching; 5 of 10 samples and 100 matches as there. How the matched
    region is found is this package's choice.

    Examples
    --------
    >>> IsometricMatching(ratio="logarithmic").sources
    5
    """

    part_samples: int = 10
    full_samples: int = 10
    sources: int = 5
    ratio: Ratio = "folded"
    matches: int = 100
    extension_samples: int = 500
    per_sample: int = 2
    kept: float = 0.8

    method: ClassVar[str] = "im"

    def stages(self, pair: Pair) -> Stages:
        """State the search for the sparse map, then the assignment that extends it."""
        self._check()
        part, full = self._samples(pair)
        ratio = distance_ratios(pair.part.distances_between(part), pair.full.distances_between(full), self.ratio)
        P = Variable("P", (len(part), len(full)))
        # Relaxations begin where no map is preferred: each map is stationary for many of them.
        even = {"P": np.full(P.shape, 1.0 / len(full))}
        sparse = Problem("sparse", minimize(TripleDistortion(ratio)(P)), P @ PartialPermutation(), start=even)
        chosen = (yield sparse)["P"]
        anchors = full[chosen.argmax(axis=1)]
        rows = _far_samples(pair.part, min(self.matches, len(pair.full.mesh.vertices)))
        cost, columns = self._extension(pair, part, anchors, rows)
        X = Variable("X", cost.shape)
        solution = yield Problem("extension", minimize(Linear(cost)(X)), X @ Assignment())
        # Interior points leave fractions where assignments tie: the nearest map decides.
        to = PartialPermutation().restore(solution["X"]).argmax(axis=1)
        paid = cost[np.arange(len(rows)), to]
        kept = np.argsort(paid, kind="stable")[: max(1, round(self.kept * len(rows)))]
        worst = float(paid.max()) or 1.0
        return Correspondence.between_vertices(pair, rows[kept], columns[to[kept]], 1.0 - paid[kept] / worst)

    def _check(self) -> None:
        if self.ratio not in RATIOS:
            raise UnknownNameError("ratio", self.ratio, RATIOS)
        if not 3 <= self.sources <= min(self.part_samples, self.full_samples):
            raise InputError(
                f"sources is {self.sources}, part_samples {self.part_samples}, full_samples {self.full_samples}",
                remedy="map at least 3 sources, and no more than there are samples on either surface",
            )
        check_ranges(vars(self), {"matches": COUNT, "per_sample": COUNT, "kept": ABOVE_NONE})
        if self.extension_samples < self.matches:
            raise InputError(
                f"extension_samples is {self.extension_samples} and matches {self.matches}",
                remedy="give at least as many samples of the full surface as matches",
            )

    def _samples(self, pair: Pair) -> tuple[IntArray, IntArray]:
        # Farthest points come in falling distance: the first are the evenly spaced ones.
        return _far_samples(pair.part, self.part_samples)[: self.sources], _far_samples(pair.full, self.full_samples)

    def _extension(
        self, pair: Pair, sources: IntArray, targets: IntArray, rows: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Return the (m, c) costs of assigning samples of the part, and the (c,) vertices of the full surface."""
        columns = _far_samples(pair.full, self.extension_samples)
        between = pair.part.distances_between(sources), pair.full.distances_between(targets)
        upper = np.triu_indices(len(sources), 1)
        scale = float(np.exp(np.median(np.log(between[0][upper] / between[1][upper]))))
        on_part = pair.part.distances(sources)[:, rows] / scale
        on_full = pair.full.distances(targets)[:, columns]
        cost = np.abs(on_part[:, :, None] - on_full[:, None, :]).mean(axis=0)
        count = min(self.per_sample, len(columns))
        near = np.unique(np.argpartition(cost, count - 1, axis=1)[:, :count])
        if len(near) < len(rows):
            near = np.sort(np.argsort(cost.min(axis=0), kind="stable")[: len(rows)])
        return np.ascontiguousarray(cost[:, near]), columns[near]


def distance_ratios(part: FloatArray, full: FloatArray, ratio: Ratio = "folded") -> FloatArray:
    """Return (k, k, n, n) ratios of the distances between k samples of the part and n of the full surface.

    Entry (i, a, j, l) compares part[i, a] with full[j, l]: max(r, 1/r) if "folded", log r if "logarithmic", 0 where
    i = a or j = l.

    Raises
    ------
    InputError
        If two samples coincide.

    Examples
    --------
    >>> apart = np.array([[0.0, 2.0], [2.0, 0.0]])
    >>> float(distance_ratios(apart, 2.0 * apart)[0, 1, 0, 1])
    2.0
    """
    logs = []
    for name, distances in (("part", part), ("full surface", full)):
        apart = ~np.eye(len(distances), dtype=bool)
        if not (distances[apart] > 0.0).all():
            one, other = np.argwhere(apart & ~(distances > 0.0))[0]
            raise InputError(
                f"samples {one} and {other} of the {name} coincide: the ratio of their distance is not defined",
                remedy="take fewer samples",
            )
        logs.append(np.log(np.where(apart, 0.5 * (distances + distances.T), 1.0)))
    difference = logs[0][:, :, None, None] - logs[1][None, None]
    table = np.exp(np.abs(difference)) if ratio == "folded" else difference
    k, n = len(part), len(full)
    table[np.arange(k), np.arange(k)] = 0.0
    table[:, :, np.arange(n), np.arange(n)] = 0.0
    return np.asarray(table)


def _far_samples(surface: Surface, count: int) -> IntArray:
    return surface.samples(min(count, len(surface.mesh.vertices)), metric="geodesic")
