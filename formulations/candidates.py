"""Candidate matches: for sampled points of the part, the points of the full surface that look alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.ranges import COUNT, check_ranges
from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.maps import nearest_rows
from nonrigid.geometry.surface import Surface

COSINE_BINS = 10
"""Values of the cosine in the SHOT descriptors compared here: 320 columns a radius."""

LARGEST_EMPTY = 0.5
"""Share of vertices without a descriptor above which a surface is refused: nearest descriptors would mean nothing."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Hold possible matches, one a row, in the vertex numbers of the repaired views.

    Parameters
    ----------
    part, full
        (n,) vertex of the part and vertex of the full surface of each candidate.
    cost
        (n,) how badly the two fit, each on its own: smaller is better.
    """

    part: IntArray
    full: IntArray
    cost: FloatArray

    def __len__(self) -> int:
        return len(self.part)

    def __getitem__(self, index: IntArray | BoolArray) -> Candidates:
        return Candidates(self.part[index], self.full[index], self.cost[index])

    def conflicts(self) -> BoolArray:
        """(n, n) whether two candidates share a vertex, and so cannot both be true; the diagonal included."""
        return np.asarray((self.part[:, None] == self.part) | (self.full[:, None] == self.full))

    def in_conflict_with(self, others: Candidates) -> BoolArray:
        """(n,) whether each candidate shares a vertex with any of `others`."""
        return np.asarray(np.isin(self.part, others.part) | np.isin(self.full, others.full))

    def greedy(self, weight: FloatArray, *, floor: float = 1e-3) -> IntArray:
        """Return a conflict-free choice: by falling weight, then rising cost, down to `floor` of the largest weight."""
        kept: list[int] = []
        used_part: set[int] = set()
        used_full: set[int] = set()
        for index in np.lexsort((self.cost, -weight)):
            if weight[index] <= floor * weight.max():
                break
            x, y = int(self.part[index]), int(self.full[index])
            if x not in used_part and y not in used_full:
                used_part.add(x)
                used_full.add(y)
                kept.append(int(index))
        return np.array(kept, dtype=np.int64)


def describe(surface: Surface, radii: tuple[float, ...]) -> FloatArray:
    """Return (n, d) unit rows: SHOT at each radius side by side, radii in units of sqrt(full area).

    A vertex with too few neighbours for any of them has a row of zeros; see `require_descriptors`.
    """
    rows = np.hstack([surface.shot(radius, cosine_bins=COSINE_BINS) for radius in radii])
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(np.divide(rows, length, out=np.zeros_like(rows), where=length > 0))


def require_descriptors(pair: Pair, radii: tuple[float, ...]) -> None:
    """Raise `InputError` if no radius is given, or most vertices of a surface have no descriptor at any of them.

    SHOT needs five neighbours within its radius. Where most have none, the nearest descriptors mean nothing.
    """
    if not radii:
        raise InputError("radii is empty", remedy="give at least one number")
    for surface in (pair.part, pair.full):
        known = np.any([surface.shot(radius, cosine_bins=COSINE_BINS).any(axis=1) for radius in radii], axis=0)
        if known.mean() < 1.0 - LARGEST_EMPTY:
            raise InputError(
                f"{1.0 - known.mean():.0%} of the vertices of {surface.raw.name} have too few neighbours within"
                f" {max(radii):g} sqrt(full area) for a descriptor",
                remedy="give larger radii, or a finer mesh",
            )


def principal_axes(rows: FloatArray, count: int) -> FloatArray:
    """Return the `count` orthonormal directions along which rows (n, d) have the largest second moment, (d, count).

    Examples
    --------
    >>> np.abs(principal_axes(np.array([[3.0, 0.0], [0.0, 1.0]]), 1))
    array([[1.],
           [0.]])
    """
    return np.asarray(np.linalg.eigh(rows.T @ rows)[1][:, ::-1][:, :count])


def candidate_matches(
    pair: Pair,
    *,
    part_samples: int = 300,
    full_samples: int = 1000,
    per_sample: int = 10,
    radii: tuple[float, ...] = (0.04, 0.10),
) -> Candidates:
    """Return, for farthest-point samples of the part, the samples of the full surface with the nearest descriptors.

    Parameters
    ----------
    part_samples, full_samples
        Numbers of samples; a surface with fewer vertices gives all of them.
    per_sample
        Candidates of each sample of the part.
    radii
        Radii of the SHOT descriptors, in units of sqrt(full area).

    Raises
    ------
    InputError
        If a number is below 1, or most vertices have no descriptor.

    Source: pre-selection by descriptor in Rodola, Bronstein, Albarelli, Bergamasco and Torsello (CVPR 2012), with
    SHOT in place of heat kernels, which parts disturb near their boundary.
    """
    counts = {"part_samples": part_samples, "full_samples": full_samples, "per_sample": per_sample}
    check_ranges(counts, dict.fromkeys(counts, COUNT))
    require_descriptors(pair, radii)
    some = pair.part.samples(min(part_samples, len(pair.part.mesh.vertices)))
    others = pair.full.samples(min(full_samples, len(pair.full.mesh.vertices)))
    alike, cost = nearest_rows(
        describe(pair.part, radii)[some], describe(pair.full, radii)[others], count=min(per_sample, len(others))
    )
    return Candidates(np.repeat(some, alike.size // len(some)), others[alike.ravel()], cost.ravel())
