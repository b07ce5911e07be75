"""Samples of both surfaces with all distances between them, and what these say of a map between the samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from nonrigid.formulations.candidates import Candidates
from nonrigid.formulations.distortion import between_all, payoff_of
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.localisation import placing_cost
from nonrigid.formulations.trusted_descriptors import TrustedDescriptors
from nonrigid.geometry.arrays import FloatArray, IntArray

NEAR = 0.15
"""Distance, in units of sqrt(full area), at which the agreement with another sample counts 1/e."""

_BLOCK = 2048
"""Vertices that are placed at a time: a number for each point of the grid is in memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledDistances:
    """Hold samples of the part and of the full surface, their distances and their descriptors' differences.

    Candidates and images below are in the numbers of the samples: rows of `points` and of `grid`.

    Parameters
    ----------
    points
        (p,) vertices of the part; distances are known from the first s of them.
    grid
        (g,) vertices of the full surface.
    on_part, on_full
        (s, p) and (g, g) distances, in units of sqrt(full area).
    geodesics
        How distances on the part are measured; see `nonrigid.geometry.geodesics.make_geodesics`.
    unlike
        (p, g) squared differences of descriptors, as far as the part's are trusted.
    looks
        (s, g) the same as if all were trusted.
    """

    points: IntArray
    grid: IntArray
    on_part: FloatArray
    on_full: FloatArray
    geodesics: str
    unlike: FloatArray
    looks: FloatArray

    def measured(self, pair: Pair, geodesics: str) -> SampledDistances:
        """Return the same samples with distances on the part measured in another way.

        Parameters
        ----------
        pair
            The pair that was sampled.
        geodesics
            A name that `nonrigid.geometry.geodesics.make_geodesics` knows.

        Raises
        ------
        InputError
            If it knows no such name.
        """
        first = self.points[: len(self.on_part)]
        return replace(self, geodesics=geodesics, on_part=pair.part.distances(first, geodesics)[:, self.points])

    @property
    def between(self) -> FloatArray:
        """(s, s) distances between those samples of the part from which distances are known."""
        return self.on_part[:, : len(self.on_part)]

    def candidates(self, count: int) -> Candidates:
        """Return, for each of the first samples, the `count` points of the grid with the nearest descriptors.

        All radii count alike: a look distrusted near a boundary still names more true candidates than it drops.
        """
        best = np.argsort(self.looks, axis=1, kind="stable")[:, :count]
        rows = np.repeat(np.arange(len(best)), best.shape[1])
        return Candidates(rows, best.ravel(), self.looks[rows, best.ravel()])

    def payoff(self, matches: Candidates, kernel_width: float) -> FloatArray:
        """Return the (n, n) two-sided payoff; see `nonrigid.formulations.distortion.consistency`."""
        excess = between_all(self.between, matches.part)
        excess -= between_all(self.on_full, matches.full)
        return payoff_of(excess, matches, kernel_width)

    def placed(self, rows: IntArray, images: IntArray, *, reach: float, descriptor_weight: float) -> IntArray:
        """Return, for every sample of the part, the point of the grid where its distances to anchors place it.

        Parameters
        ----------
        rows, images
            (a,) anchors: samples of the part, among the first s, and their images.

        Returns
        -------
        (p,) rows of the grid; see `placed_by`.
        """
        return self.placed_by(
            self.on_part[rows], self.on_full[images], reach=reach, descriptor_weight=descriptor_weight
        )

    def placed_by(
        self, on_part: FloatArray, on_full: FloatArray, *, reach: float, descriptor_weight: float
    ) -> IntArray:
        """Return the same for anchors that are no samples, from (a, p) and (a, g) distances to them and their images.

        The place of x is the y with the least `placing_cost` + descriptor_weight * unlike(x, y).
        """
        cost = placing_cost(on_part, on_full, reach=reach, dtype=np.float32) + descriptor_weight * self.unlike
        return np.asarray(cost.argmin(axis=1), dtype=np.int64)

    def on_grid(self, pair: Pair, vertices: IntArray) -> IntArray:
        """Return, for vertices of the full surface, the nearest points of the grid."""
        places = pair.full.mesh.vertices
        return np.asarray(cKDTree(places[self.grid]).query(places[vertices])[1], dtype=np.int64)

    def disagreement(self, images: IntArray) -> FloatArray:
        """Return, for the first s samples, the mean |d - D| to the others, near ones counting most: a length."""
        weight = np.exp(-np.square(self.between / NEAR))
        np.fill_diagonal(weight, 0.0)
        image = images[: len(weight)]
        off = np.abs(self.between - self.on_full[np.ix_(image, image)])
        return np.asarray((weight * off).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-300))

    def confidence(self, pair: Pair, vertices: IntArray, nearest: IntArray, *, width: float) -> FloatArray:
        """Return how well a map keeps distances, 0 to 1: 1/2 where they are off by `width` on average.

        The mean is over the first s samples, near ones counting most; images are rounded to the grid.

        Parameters
        ----------
        vertices, nearest
            (n,) vertices of the part, the first s samples among them, and a vertex of the full surface for each.
        """
        return np.asarray(np.exp(-np.log(2.0) * np.square(self._changes(pair, vertices, nearest) / width)))

    def _changes(self, pair: Pair, vertices: IntArray, nearest: IntArray) -> FloatArray:
        """Return the mean |d - D| of vertices to the first s samples, near ones counting most: a length."""
        rows = self.on_grid(pair, nearest)
        if np.array_equal(vertices, self.points):
            on_part, weight, total = self.on_part, *self._nearness
        else:
            on_part = pair.part.distances(self.points[: len(self.on_part)], self.geodesics)[:, vertices]
            weight, total = _nearness(on_part)
        off = self.on_full[rows[self._first(pair, vertices)]].take(rows, axis=1)
        off -= on_part
        return np.asarray(np.einsum("sv,sv->v", weight, np.abs(off, out=off)) / total)

    @cached_property
    def _nearness(self) -> tuple[FloatArray, FloatArray]:
        return _nearness(self.on_part)

    def _first(self, pair: Pair, vertices: IntArray) -> IntArray:
        """Return where the first s samples stand among vertices of the part."""
        place = np.empty(len(pair.part.mesh.vertices), dtype=np.int64)
        place[vertices] = np.arange(len(vertices))
        return place[self.points[: len(self.on_part)]]

    def leashed(
        self, pair: Pair, images: IntArray, length: float, *, share: float, reach: float, descriptor_weight: float
    ) -> IntArray:
        """Return images of the samples, those farther than `length` from where the surest ones place them put there.

        Parameters
        ----------
        images
            (p,) vertices of the full surface.
        length
            In space, in units of sqrt(full area).
        share, reach, descriptor_weight
            See `surest` and `placed`.

        Source: this package.
        """
        rows = self.on_grid(pair, images)
        sure = self.surest(rows, share)
        placed = self.grid[self.placed(sure, rows[sure], reach=reach, descriptor_weight=descriptor_weight)]
        where = pair.full.mesh.vertices
        return np.where(np.linalg.norm(where[images] - where[placed], axis=1) > length, placed, images)

    def strays(
        self,
        pair: Pair,
        vertices: IntArray,
        nearest: IntArray,
        length: float,
        *,
        share: float,
        reach: float,
        keeping: float,
    ) -> tuple[IntArray, IntArray]:
        """Return which images lie off where the surest samples place the vertices of the part, and that place.

        Looked at are those whose distances to the samples are off by more than `keeping` on average: others are near.

        Parameters
        ----------
        vertices, nearest
            (n,) vertices of the part, the first s samples among them, and a vertex of the full surface for each.
        length
            How far off is too far, in space, in units of sqrt(full area).
        share, reach
            See `surest` and `placed`.
        keeping
            In units of sqrt(full area).

        Returns
        -------
        (k,) rows of `vertices`, and (k,) vertices of the full surface.

        Source: this package.
        """
        unsure = np.flatnonzero(self._changes(pair, vertices, nearest) > keeping)
        rows = self.on_grid(pair, nearest[self._first(pair, vertices)])
        sure = self.surest(rows, share)
        on_part = pair.part.distances(self.points[: len(self.on_part)], self.geodesics)[sure]
        on_full = self.on_full[rows[sure]]
        around = np.empty(len(unsure), dtype=np.int64)
        for start in range(0, len(unsure), _BLOCK):
            block = slice(start, start + _BLOCK)
            near = on_part[:, vertices[unsure[block]]]
            around[block] = self.grid[placing_cost(near, on_full, reach=reach, dtype=np.float32).argmin(axis=1)]
        where = pair.full.mesh.vertices
        far = np.linalg.norm(where[nearest[unsure]] - where[around], axis=1) > length
        return unsure[far], around[far]

    def surest(self, images: IntArray, share: float) -> IntArray:
        """Return which of the first s samples agree best with their neighbours, a given share of them."""
        off = self.disagreement(images)
        return np.flatnonzero(off <= np.quantile(off, share))


def _nearness(distances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how much near ones of (s, v) distances count more than far ones, and the (v,) sums."""
    weight = np.exp(-np.square(distances / NEAR))
    return weight, np.maximum(weight.sum(axis=0), 1e-300)


def sampled_distances(
    pair: Pair,
    descriptors: TrustedDescriptors,
    *,
    part_samples: int,
    placed_samples: int,
    full_samples: int,
) -> SampledDistances:
    """Sample both surfaces and measure, on the part along it; a surface with too few vertices gives all of them.

    The distances of the full surface depend on nothing else and are kept in the cache; so are those from the first
    `part_samples` samples of the part.
    """
    part, full = pair.part, pair.full
    points = part.samples(min(max(part_samples, placed_samples), len(part.mesh.vertices)))
    grid = full.samples(min(full_samples, len(full.mesh.vertices)))
    return SampledDistances(
        points=points,
        grid=grid,
        on_part=part.distances(points[:part_samples])[:, points],
        on_full=full.distances_between(grid),
        geodesics="dijkstra",
        unlike=descriptors.differences(points, grid),
        looks=descriptors.all_trusted().differences(points[:part_samples], grid),
    )
