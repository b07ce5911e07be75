"""Partial ZoomOut: a few matches become a functional map, and ever larger maps better matches."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from nonrigid.formulations.elastic_net import ElasticNetMatching
from nonrigid.formulations.formulation import Correspondence, Pair, Solved, Stages
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.formulations.model import Problem
from nonrigid.formulations.ranges import COUNT, NOT_NEGATIVE, POSITIVE, check_ranges
from nonrigid.formulations.spectral_growth import Bases, bases, grown, map_fit
from nonrigid.formulations.trusted_descriptors import TrustedDescriptors, trusted_descriptors
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import UnknownNameError
from nonrigid.geometry.surface import Surface

From: TypeAlias = Literal["gt", "en", "descriptors"]
STARTS = ("gt", "en", "descriptors")

KEEPING = 0.03
"""Length, in units of sqrt(full area), between a point and its image's features at which confidence is 1/2."""


_RANGES = {
    **dict.fromkeys(("fitted_samples", "grid_samples", "steps", "components", "last_components"), COUNT),
    **dict.fromkeys(("part_size", "full_size"), COUNT),
    "first_size": (2, COUNT[1]),
    "radii": POSITIVE,
    **dict.fromkeys(("trust_power", "descriptor_weight"), NOT_NEGATIVE),
}


@dataclass(frozen=True, kw_only=True)
class GrowthSettings:
    """Hold the settings of maps that grow from matches, which methods share.

    Parameters
    ----------
    radii, trust_power
        SHOT descriptors; see `nonrigid.formulations.anchored.Anchored`.
    fitted_samples, grid_samples
        Samples of the part to which maps are fitted, and of the full surface among which coarse maps find images.
    first_size, steps
        Eigenfunctions of the part in the first map, and number of maps that follow.
    descriptor_weight
        Squared length, in units of the full area, that a squared difference 1 of unit descriptors is worth beside
        eigenfunctions; 0 as published.
    components, last_components
        Principal components of the descriptors that stand beside eigenfunctions while maps grow, and in the end.
    part_size, full_size
        Largest numbers of eigenfunctions.
    """

    radii: tuple[float, ...] = (0.04, 0.10)
    trust_power: float = 1.0
    fitted_samples: int = 1000
    grid_samples: int = 1500
    first_size: int = 20
    steps: int = 20
    descriptor_weight: float = 0.004
    components: int = 80
    last_components: int = 200
    part_size: int = 100
    full_size: int = 200

    def check(self) -> None:
        """Raise `InputError` for a setting that is out of range."""
        check_ranges(vars(self), _RANGES)


@dataclass(frozen=True, kw_only=True)
class PartialZoomOut(GrowthSettings):
    """Match every vertex of the part by functional maps of growing size, begun with the matches of another method.

    1. The start: the problems of game-theoretic or elastic-net matching, or none where each sample begins at the vertex
       with the nearest descriptor.
    2. "first map": the map C with orthonormal columns and the least sum of |C phi(x) - psi(y)|^2 over the matches.
    3. "map": C is fitted to the images of spread samples, images are read off C, and so on with more eigenfunctions, as
       many of the part to those of the full surface as their eigenvalues say.

    Parameters
    ----------
    start
        Whose matches are grown: "gt", "en" or "descriptors".
    part_samples, full_samples
        Samples of the start.
    radii, trust_power, fitted_samples, grid_samples, first_size, steps, descriptor_weight, components, last_components,
    part_size, full_size
        See `GrowthSettings`.

    Source: Melzi, Ren, Rodola, Sharma, Wonka and Ovsjanikov, ZoomOut (SIGGRAPH Asia 2019), whose section on partial
    matching grows both sizes at the rate of the part's share of the spectrum. Orthonormal columns, descriptors, the
    starts and the numbers are this package's choice.

    Examples
    --------
    >>> PartialZoomOut(start="en").start
    'en'
    """

    start: From = "gt"
    part_samples: int = 300
    full_samples: int = 1000
    first_size: int = 12

    method: ClassVar[str] = "zoomout"

    def stages(self, pair: Pair) -> Stages:
        """State the start's problems, then one map a step; return one point a vertex of the part."""
        if self.start not in STARTS:
            raise UnknownNameError("start", self.start, STARTS)
        self.check()
        descriptors = trusted_descriptors(pair, self.radii, power=self.trust_power)
        matches = yield from self._begun(pair, descriptors)
        return (yield from growth(self, pair, descriptors, *matches))

    def _begun(
        self, pair: Pair, descriptors: TrustedDescriptors
    ) -> Generator[Problem, Solved, tuple[IntArray, IntArray]]:
        if self.start == "descriptors":
            points = pair.part.samples(min(self.part_samples, len(pair.part.mesh.vertices)))
            grid = pair.full.samples(min(self.full_samples, len(pair.full.mesh.vertices)))
            return points, grid[descriptors.differences(points, grid).argmin(axis=1)]
        kind = GameTheoretic if self.start == "gt" else ElasticNetMatching
        method = kind(part_samples=self.part_samples, full_samples=self.full_samples, radii=self.radii)
        return (yield from method.stages(pair)).view_vertices(pair)


def growth(
    settings: GrowthSettings, pair: Pair, descriptors: TrustedDescriptors, part: IntArray, full: IntArray
) -> Generator[Problem, Solved, Correspondence]:
    """State a map fitted to matches, and larger ones; return one point a vertex of the part.

    Parameters
    ----------
    part, full
        (a,) matched vertices of the repaired views.
    """
    basis = bases(
        pair,
        descriptors,
        part_size=settings.part_size,
        full_size=settings.full_size,
        descriptor_weight=settings.descriptor_weight,
        components=settings.components,
        last_components=settings.last_components,
    )
    sizes = basis.sizes(settings.first_size, settings.steps)
    C = (yield first_map(basis, part, full, sample_areas(pair.part, part), int(sizes[0])))["C"]
    points = pair.part.samples(min(settings.fitted_samples, len(pair.part.mesh.vertices)))
    grid = pair.full.samples(min(settings.grid_samples, len(pair.full.mesh.vertices)))
    C, _ = yield from grown(basis, points, basis.images(C, points, grid), sizes, grid=grid)
    found, nearest = basis.read_off(C, pair.full.mesh)
    # Weyl's law: features of k eigenfunctions are about sqrt(pi) k times as far apart as the points (area 1).
    apart = np.linalg.norm(basis.part[:, : C.shape[1]] @ C.T - basis.full[nearest, : len(C)], axis=1)
    length = apart / (np.sqrt(np.pi) * len(C))
    return Correspondence.of_every_vertex(pair, found, np.exp(-np.log(2.0) * np.square(length / KEEPING)))


def first_map(basis: Bases, part: IntArray, full: IntArray, weight: FloatArray, size: int) -> Problem:
    """Return the problem of the map with orthonormal columns that best sends matched points to their images.

    Since |C phi| = |phi|, the least sum of w |C phi(x) - psi(y)|^2 is the largest of w <C phi(x), psi(y)>. With areas
    around the points as weights, |C phi - psi|^2 is integrated over the part, however unevenly the matches lie.
    """
    rows = weight[:, None] * basis.part[part, : basis.part_size(size)]
    return map_fit("first map", np.asarray(basis.full[full, :size].T @ rows))


def sample_areas(surface: Surface, samples: IntArray) -> FloatArray:
    """Return (s,) the area of the vertices to which each sample is the nearest, in units of the full area."""
    nearest = surface.distances(samples).argmin(axis=0)
    return np.asarray(np.bincount(nearest, weights=surface.laplacian().mass, minlength=len(samples)), dtype=float)
