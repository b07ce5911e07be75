"""A repeatable frame at a point, from the points around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from nonrigid.geometry.arrays import FloatArray, IntArray

ZSign: TypeAlias = Literal["normal", "majority"]
NEGLIGIBLE = 1e-9  # an offset this small against the radius has no side: rounding may not cast its vote


@dataclass(frozen=True, kw_only=True, eq=False)
class Neighbours:
    """List the pairs (centre, neighbour) of a few centres, in no particular order.

    Parameters
    ----------
    centre
        (p,) number of the centre, 0 ... count - 1.
    vertex
        (p,) vertex number of the neighbour.
    offsets
        (3, p) neighbour less centre, in the unit of the vertices.
    distances
        (p,) lengths of the offsets, all positive.
    count
        Number of centres.
    """

    centre: IntArray
    vertex: IntArray
    offsets: FloatArray
    distances: FloatArray
    count: int

    def sums(self, values: FloatArray) -> FloatArray:
        """(count,) sums of (p,) values over the neighbours of each centre."""
        return np.bincount(self.centre, weights=values, minlength=self.count).astype(np.float64, copy=False)


def local_frames(neighbours: Neighbours, radius: float, normals: FloatArray, z_sign: ZSign) -> FloatArray:
    r"""Return the axes x, y, z of a frame at each centre: (count, 3, 3), one axis a row.

    The axes are the eigenvectors of
    :math:`\sum_q (r - d_q)(q - p)(q - p)^T / \sum_q (r - d_q)`, x to the largest eigenvalue and z to the smallest. The
    axis x points to the side of more neighbours; z does so too ("majority"), or to the side of the (count, 3) vertex
    `normals` ("normal"). Where as many neighbours lie on either side, the sign of :math:`\sum_q (r - d_q)(q - p)`
    decides; a normal at right angles to z leaves z to the majority. y = z x x, so the frame is right-handed and a
    mirrored surface gives different coordinates.

    Source: Tombari, Salti, Di Stefano, "Unique signatures of histograms for local surface description", ECCV 2010,
    equation 3.
    """
    weights = radius - neighbours.distances
    axes = np.linalg.eigh(_covariances(neighbours, weights))[1]
    x, z = axes[:, :, 2], axes[:, :, 0]
    x = x * _majority(neighbours, x, weights, radius)[:, None]
    sign = _majority(neighbours, z, weights, radius)
    if z_sign == "normal":
        facing = np.einsum("cx,cx->c", z, normals)
        sign = np.where(np.abs(facing) > NEGLIGIBLE, np.sign(facing), sign)
    z = z * sign[:, None]
    return np.stack([x, np.cross(z, x), z], axis=1)


def coordinates(neighbours: Neighbours, axis: FloatArray) -> FloatArray:
    """(p,) coordinates of the offsets along the (count, 3) axis of their centre."""
    centre, offsets = neighbours.centre, neighbours.offsets
    result = axis[:, 0].take(centre) * offsets[0]
    result += axis[:, 1].take(centre) * offsets[1]
    result += axis[:, 2].take(centre) * offsets[2]
    return np.asarray(result)


def _covariances(neighbours: Neighbours, weights: FloatArray) -> FloatArray:
    result = np.empty((neighbours.count, 3, 3))
    total = neighbours.sums(weights)
    total[total <= 0] = 1.0
    for i in range(3):
        weighted = weights * neighbours.offsets[i]
        for j in range(i, 3):
            result[:, i, j] = result[:, j, i] = neighbours.sums(weighted * neighbours.offsets[j]) / total
    return result


def _majority(neighbours: Neighbours, axis: FloatArray, weights: FloatArray, radius: float) -> FloatArray:
    """(count,) +1 or -1: the side of each axis on which more neighbours lie."""
    along = coordinates(neighbours, axis)
    far = NEGLIGIBLE * radius
    votes = neighbours.sums((along > far).astype(np.float64) - (along < -far))
    votes = np.where(votes == 0, neighbours.sums(weights * along), votes)
    return np.where(votes < 0, -1.0, 1.0)
