"""What maps of a pair grow on, and how good a map is: by the distances it keeps, and by looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.orientation import Orientation
from nonrigid.formulations.sampled_distances import SampledDistances
from nonrigid.formulations.spectral_growth import Bases
from nonrigid.geometry.arrays import FloatArray, IntArray

KEEPING = 0.03
"""Mean change of distances, in units of sqrt(full area), at which a match has confidence 1/2."""

_LIKENESS = 5.0
"""What the mean likeness of descriptors counts beside mean confidence when maps of a pair are compared: a map that
is slid along a limb may keep distances as well as the true one, but its descriptors agree less."""


_TOGETHER = 0.04
"""Distance in space, in units of sqrt(full area), up to which two maps put a sample in the same place."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Hold what maps of a pair are made of, and samples with distances on the part measured in two ways.

    Along the part, ways around what was cut out are too long; across it, some are too short. Maps grow from samples
    placed by the latter, which are nearer the truth on parts torn by many holes, and are judged by both: what is
    wrong in one way rarely looks right in the other.

    Parameters
    ----------
    pair, basis
        What is matched, and the eigenfunctions and descriptors of both surfaces.
    along, bridged
        The same samples, with distances on the part along it, and across what was cut out.
    orientation
        That of the samples.

    Source: this package.
    """

    pair: Pair
    basis: Bases
    along: SampledDistances
    bridged: SampledDistances
    orientation: Orientation

    def confidence(self, vertices: IntArray, nearest: IntArray) -> FloatArray:
        """Return (n,) how well a map keeps distances, 0 to 1, the mean of both ways.

        Parameters
        ----------
        vertices, nearest
            (n,) each; see `SampledDistances.confidence`.
        """
        along, bridged = (
            way.confidence(self.pair, vertices, nearest, width=KEEPING) for way in (self.along, self.bridged)
        )
        return np.asarray(0.5 * (along + bridged))

    def agreement(self, one: Grown, other: Grown) -> float:
        """Return the share of the samples that two maps put in the same place."""
        where = self.pair.full.mesh.vertices
        apart = np.linalg.norm(where[one.images] - where[other.images], axis=1)
        return float(np.mean(apart <= _TOGETHER))

    def judged(self, C: FloatArray, rows: IntArray, images: IntArray) -> Grown:
        """Return a map with how good it is; samples in patches that it turns over have no confidence.

        Parameters
        ----------
        C
            (full size, part size), the functional map.
        rows, images
            (p,) each, for the samples: rows of the grid that it grew from, and vertices that were read off it.
        """
        confidence = self.confidence(self.bridged.points, images)
        score = float(np.mean(confidence * ~self.orientation.turned_over(images)))
        likeness = float(self.basis.likeness(self.bridged.points, images).mean())
        return Grown(score, score + _LIKENESS * likeness, C, rows, images)


@dataclass(frozen=True, eq=False)
class Grown:
    """Hold a functional map, the images it grew from and those read off it, and how good these are.

    `score` is their mean confidence; `worth`, by which maps of a pair are compared, counts their looks as well.
    """

    score: float
    worth: float
    C: FloatArray
    rows: IntArray
    images: IntArray

    def __lt__(self, other: Grown) -> bool:
        return self.worth < other.worth
