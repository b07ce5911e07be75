"""Descriptors of a part beside how far each can be trusted: near the cut they miss what was cut away."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from nonrigid.formulations.candidates import describe, require_descriptors
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.surface import Surface


@dataclass(frozen=True, eq=False)
class TrustedDescriptors:
    """Hold unit descriptors of both surfaces, a pair of arrays a radius, and the trust in each row of the part's.

    Parameters
    ----------
    part, full
        One (n, d) array of unit rows a radius.
    trust
        One (n_part,) array a radius, between 0 and 1.
    """

    part: tuple[FloatArray, ...]
    full: tuple[FloatArray, ...]
    trust: tuple[FloatArray, ...]

    def all_trusted(self) -> TrustedDescriptors:
        """Return the same descriptors with full trust in every row."""
        return replace(self, trust=tuple(np.ones_like(trust) for trust in self.trust))

    def queries(self, points: IntArray | slice) -> FloatArray:
        """Return (p, d') rows of the part, whose inner products with `targets` are trusted cosines, mean over radii."""
        share = 1.0 / len(self.part)
        return np.hstack(
            [share * t[points, None] * rows[points] for t, rows in zip(self.trust, self.part, strict=True)]
        )

    def targets(self) -> FloatArray:
        """Return (n_full, d') rows of the full surface, all of one length."""
        return np.hstack(self.full)

    def differences(self, points: IntArray, vertices: IntArray) -> FloatArray:
        """Return (p, v) squared differences |s - S|^2 times the trust in s, mean over the radii: 0 to 4."""
        trust = np.mean([t[points] for t in self.trust], axis=0)
        return np.asarray(2.0 * (trust[:, None] - self.queries(points) @ self.targets()[vertices].T))


def trusted_descriptors(pair: Pair, radii: tuple[float, ...], *, power: float) -> TrustedDescriptors:
    """Return the descriptors of a pair at the given radii, in units of sqrt(full area).

    The trust in a row is min(1, b / radius)^power with b the distance in space to the boundary of the part; at power 2
    it is the share of a disk that certainly lies on the part.

    Raises
    ------
    InputError
        If no radius is given, or most vertices have no descriptor.
    """
    require_descriptors(pair, radii)
    return TrustedDescriptors(
        part=tuple(describe(pair.part, (radius,)) for radius in radii),
        full=tuple(describe(pair.full, (radius,)) for radius in radii),
        trust=tuple(np.minimum(1.0, _to_boundary(pair.part) / radius) ** power for radius in radii),
    )


def _to_boundary(surface: Surface) -> FloatArray:
    boundary = surface.mesh.boundary_vertices
    if not len(boundary):
        return np.full(len(surface.mesh.vertices), np.inf)
    return np.asarray(cKDTree(surface.mesh.vertices[boundary]).query(surface.mesh.vertices)[0])
