"""Find what leaks from one set of shapes into another: near-copies, and parts in the full shape's own pose."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial import cKDTree

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.mesh import Mesh

EDGE_TOLERANCE = 0.15
"""Mean |log ratio| of sorted edge lengths up to which shapes of one connectivity count as copies."""

OWN_POSE_DISTANCE = 0.005
"""Parts with 95 % of their vertices this near the full shape, over sqrt(its area), lie in its own pose and frame."""

_QUANTILES = np.linspace(0.0, 1.0, 66)[1:-1]


@dataclass(frozen=True, eq=False, kw_only=True)
class Signature:
    """Hold what a rigid motion, a renumbering and a jitter of the vertices leave of a mesh.

    Parameters
    ----------
    connectivity
        Numbers of vertices, faces and boundary edges, and how many vertices have 0, 1, 2, ... neighbours.
    edge_lengths
        (64,) quantiles of the edge lengths over sqrt(area).
    """

    name: str
    connectivity: tuple[int, ...]
    edge_lengths: FloatArray

    def is_copy_of(self, other: Signature) -> bool:
        """Tell whether both are one shape up to a rigid motion, a scale, a renumbering and a small jitter.

        Measured on the 131 real parts at hand: no two have the same connectivity. A jitter of 0.002 sqrt(area), four
        times that of the near-copies known from SHREC'16, changes the quantiles by at most 0.11 in the mean.
        """
        if self.connectivity != other.connectivity:
            return False
        change = np.abs(np.log(np.maximum(self.edge_lengths, 1e-12) / np.maximum(other.edge_lengths, 1e-12)))
        return bool(change.mean() < EDGE_TOLERANCE)


def signature(mesh: Mesh) -> Signature:
    """Return the signature of a mesh.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> moved = Mesh([[0, 0, 5], [0, 2, 5], [2, 2, 5], [2, 0, 5]], [[2, 1, 0], [0, 3, 2]])
    >>> signature(square).is_copy_of(signature(moved))
    True
    """
    i, j = mesh.edges.T
    length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1) / np.sqrt(mesh.area)
    degrees = np.bincount(np.bincount(mesh.edges.ravel(), minlength=len(mesh.vertices)))
    counts = (len(mesh.vertices), len(mesh.faces), len(mesh.boundary_edges))
    return Signature(
        name=mesh.name,
        connectivity=(*counts, *degrees.tolist()),
        edge_lengths=np.asarray(np.quantile(length, _QUANTILES)),
    )


def find_copies(
    signatures: Sequence[tuple[str, Signature]], others: Sequence[tuple[str, Signature]] | None = None
) -> list[tuple[str, str]]:
    """Return the labels of shapes that are copies of each other, or of one in `others` where that is given."""
    buckets = defaultdict(list)
    for label, mine in signatures if others is None else others:
        buckets[mine.connectivity].append((label, mine))
    found = []
    for place, (label, mine) in enumerate(signatures):
        rivals: Iterable[tuple[str, Signature]] = buckets[mine.connectivity]
        if others is None:
            earlier = {known for known, _ in signatures[:place]}
            rivals = [rival for rival in rivals if rival[0] in earlier]
        found += [(known, label) for known, rival in rivals if mine.is_copy_of(rival)]
    return found


def in_own_pose(part: Mesh, full: Mesh) -> bool:
    """Tell whether a part lies where the full shape has it: then the nearest point in space solves the pair.

    Measured on the 131 real parts at hand: the 95th percentile of the distance to the full shape's nearest vertex is at
    most 0.0005 sqrt(area) for the 29 parts in their template's own pose, at least 0.043 for the others.
    """
    bound = OWN_POSE_DISTANCE * np.sqrt(full.area)
    # A sample decides the many parts that are far away; the tree of triangles is built for those that may be near.
    corners = full.vertices[np.unique(full.faces)]
    sample = part.vertices[:: max(1, len(part.vertices) // 200)]
    longest = np.linalg.norm(full.vertices[full.edges[:, 0]] - full.vertices[full.edges[:, 1]], axis=1).max()
    if np.median(cKDTree(corners).query(sample)[0]) > bound + longest:
        return False
    squared = np.asarray(igl.point_mesh_squared_distance(part.vertices, full.vertices, full.faces)[0])
    return bool(np.percentile(np.sqrt(squared), 95) < bound)
