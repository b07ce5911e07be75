"""From a rough map of some points to a fine one: functional maps of growing size, fitted and read off in turn."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lstsq
from scipy.spatial import cKDTree

from nonrigid.formulations.candidates import principal_axes
from nonrigid.formulations.formulation import Pair, Solved
from nonrigid.formulations.functional_maps import estimated_rank
from nonrigid.formulations.interpolation import closest_feature_points
from nonrigid.formulations.model import Problem, Variable, maximize
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.trusted_descriptors import TrustedDescriptors
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.maps import RowSearch, nearest_rows
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

Strays = Callable[[IntArray], tuple[IntArray, IntArray]]
"""Of (n,) nearest vertices, says which rows are not believed, and a vertex near which each of these should lie."""

RANK_AT = 100
"""Number of eigenvalues of the full surface by which the part's share of the spectrum is estimated."""


@dataclass(frozen=True, eq=False)
class Bases:
    """Hold the eigenfunctions of both surfaces and their descriptors.

    Parameters
    ----------
    part, full
        (n, .) eigenfunctions, in 1 / sqrt(full area).
    share
        Eigenfunctions of the part to one of the full surface.
    looks
        Descriptors of the part, as far as they are trusted, and of the full surface, (n, .) each, in principal
        components: those of the largest second moment first.
    components
        How many of them stand beside eigenfunctions while maps grow; all do when a map is read off.
    descriptor_weight
        Squared distance, in units of the full area, that a squared difference 1 of descriptors is worth.
    """

    part: FloatArray
    full: FloatArray
    share: float
    looks: tuple[FloatArray, FloatArray]
    components: int
    descriptor_weight: float

    def part_size(self, size: int) -> int:
        """Return how many eigenfunctions of the part go with `size` of the full surface."""
        return int(np.clip(round(self.share * size), 1, min(self.part.shape[1], size)))

    def sizes(self, first: int, steps: int) -> IntArray:
        """Return growing numbers of eigenfunctions of the full surface, up to all that have counterparts at hand.

        `first` is that of the part at the start, where its eigenfunctions can just tell its limbs apart.
        """
        last = int(min(self.full.shape[1], self.part.shape[1] / self.share))
        return np.linspace(min(first / self.share, last), last, steps).round().astype(np.int64)

    def queries(self, C: FloatArray, points: IntArray | slice, components: int) -> FloatArray:
        """Return rows for points of the part, near those of the full surface's `targets` where the two are the same.

        Near by, |phi(y) - phi(y')|^2 over k eigenfunctions is about pi k^2 |y - y'|^2 by Weyl's law (area 1): this is
        the scale at which descriptors stand beside them.
        """
        weight = np.pi * len(C) ** 2 * self.descriptor_weight
        return np.hstack([weight * self.looks[0][points, :components], self.part[points, : C.shape[1]] @ C.T])

    def targets(self, components: int) -> FloatArray:
        """Return (n_full, .) rows: components of the descriptors, then eigenfunctions, of which maps use the first."""
        return np.hstack([self.looks[1][:, :components], self.full])

    def images(self, C: FloatArray, points: IntArray, grid: IntArray | None = None) -> IntArray:
        """Return, for points of the part, the vertices of the full surface with the nearest features while maps grow.

        `grid` are the vertices among which they are looked for: all unless given.
        """
        queries = self.queries(C, points, self.components)
        columns = queries.shape[1]
        if grid is None:
            return self._anywhere.first(columns).nearest(queries)[0]
        return grid[nearest_rows(queries, self._growing[grid, :columns])[0]]

    @cached_property
    def _growing(self) -> FloatArray:
        return self.targets(self.components)

    @cached_property
    def _anywhere(self) -> RowSearch:
        return RowSearch(self._growing)

    def likeness(self, points: IntArray, vertices: IntArray) -> FloatArray:
        """Return the (n,) trusted cosines of the descriptors of points of the part and vertices of the full surface."""
        return np.asarray(np.einsum("nd,nd->n", self.looks[0][points], self.looks[1][vertices]))

    def read_off(
        self, C: FloatArray, full: Mesh, *, strays: Strays | None = None, length: float = np.inf
    ) -> tuple[SurfacePoints, IntArray]:
        """Return, for every vertex of the part, the point of the full surface with the nearest features.

        Parameters
        ----------
        strays, length
            Given the nearest vertices, says for which vertices of the part they are not believed, and around which
            vertex the nearest is to be looked for instead, at most so far from it in space.

        Returns
        -------
        The points, in the triangles around the (n,) vertices with the nearest features, and these.
        """
        components = self.looks[0].shape[1]
        queries = self.queries(C, slice(None), components)
        features = self.targets(components)[:, : queries.shape[1]]
        nearest = nearest_rows(queries, features)[0]
        if strays is not None:
            rows, around = strays(nearest)
            nearest[rows] = nearest_within(queries[rows], features, full.vertices, around, length)
        return closest_feature_points(queries, features, full, nearest), nearest


def bases(
    pair: Pair,
    descriptors: TrustedDescriptors,
    *,
    part_size: int,
    full_size: int,
    descriptor_weight: float,
    components: int,
    last_components: int,
) -> Bases:
    """Return the bases of a pair; a surface with too few vertices gives as many eigenfunctions as it has.

    Of the descriptors the `last_components` with the largest second moment over the full surface are kept: 80 of 640
    hold more than nine tenths of it on the templates of SHREC'16.
    """
    part = pair.part.spectrum(min(part_size, len(pair.part.mesh.vertices) - 1))
    full = pair.full.spectrum(min(full_size, len(pair.full.mesh.vertices) - 1))
    reference = min(RANK_AT, len(full.eigenvalues))
    rank = estimated_rank(part.eigenvalues, full.eigenvalues[:reference])
    targets = descriptors.targets()
    axes = principal_axes(targets, max(components, last_components))
    return Bases(
        part=part.eigenfunctions,
        full=full.eigenfunctions,
        share=max(rank, 1) / reference,
        looks=(descriptors.queries(slice(None)) @ axes, targets @ axes),
        components=components,
        descriptor_weight=descriptor_weight,
    )


def map_fit(name: str, rough: FloatArray) -> Problem:
    """Return the problem of the functional map with orthonormal columns nearest to a rough one.

    Minimizing |C - D|^2 over C'C = I is maximizing <D, C>, since |C| is constant there.

    Examples
    --------
    >>> print(map_fit("map", np.eye(3, 2)))
    map: maximize Linear(C)
      subject to C in Stiefel()
      with C of shape (3, 2)
    """
    C = Variable("C", rough.shape)
    return Problem(name, maximize(Linear(rough)(C)), C @ Stiefel())


def nearest_within(
    queries: FloatArray, targets: FloatArray, places: FloatArray, around: IntArray, length: float
) -> IntArray:
    """Return, for each query, the nearest target among those whose places lie at most `length` from one's place.

    Parameters
    ----------
    queries, targets
        (q, d) and (t, d) rows.
    places
        (t, 3) where the targets lie.
    around
        (q,) target in whose neighbourhood each query looks; it is always among those looked at.
    length
        In the unit of `places`.

    Returns
    -------
    (q,) targets.

    Examples
    --------
    >>> line = np.arange(4.0)[:, None]
    >>> nearest_within(np.array([[3.1], [3.1]]), line, line * [1, 0, 0], np.array([1, 3]), 1.0)
    array([2, 3])
    """
    found = np.empty(len(queries), dtype=np.int64)
    tree = cKDTree(places)
    for centre in np.unique(around):
        rows = np.flatnonzero(around == centre)
        near = np.sort(np.array(tree.query_ball_point(places[centre], length), dtype=np.int64))
        found[rows] = near[nearest_rows(queries[rows], targets[near])[0]]
    return found


FINE = 5
"""Number of last maps that are read off at every vertex. Earlier ones are read off on a grid, which takes a fraction of
the time; with 3, one of six parts tried lost the end of a limb."""


AGAIN = 3
"""How often, at most, the last map is fitted again: with all its eigenfunctions, small patches turn round at last."""


def grown(
    basis: Bases,
    points: IntArray,
    images: IntArray,
    sizes: IntArray,
    *,
    grid: IntArray,
    corrected: Callable[[IntArray], IntArray] | None = None,
    unsettled: Callable[[IntArray], bool] | None = None,
) -> Generator[Problem, Solved, tuple[FloatArray, IntArray]]:
    """Fit a functional map to matches and read better matches off it, with ever more eigenfunctions.

    Parameters
    ----------
    points, images
        (p,) vertices of the part, spread evenly, and the vertices of the full surface that they start at.
    sizes
        Numbers of eigenfunctions of the full surface, rising.
    grid
        Vertices of the full surface, spread evenly, among which images are looked for at first.
    corrected
        Makes better images of those read off a map, before the next is fitted to them.
    unsettled
        While it says so of the images read off the last map, that is fitted again, at most `AGAIN` times.

    Returns
    -------
    The last map, (sizes[-1], .), and the (p,) images read off it.

    Source: Melzi, Ren, Rodola, Sharma, Wonka and Ovsjanikov, ZoomOut (SIGGRAPH Asia 2019), here from part to whole,
    with orthonormal maps and with descriptors beside the eigenfunctions.
    """
    for number, size in enumerate(np.append(sizes, np.full(AGAIN, sizes[-1])), start=1):
        if number > len(sizes) and (unsettled is None or not unsettled(images)):
            break
        if corrected is not None and number > 1:
            images = corrected(images)
        part = basis.part[points, : basis.part_size(int(size))]
        rough = np.asarray(lstsq(part, basis.full[images, :size], lapack_driver="gelsy")[0].T, dtype=np.float64)
        solution = yield map_fit("map", rough)
        C = solution["C"]
        images = basis.images(C, points, grid if number <= len(sizes) - FINE else None)
    return C, images
