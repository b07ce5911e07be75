"""A frame that a surface carries with it, and an order of its vertices that settles ties."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.mesh import Mesh

TIE = 1e-9  # distances closer than this, relatively, are equal: rounding may not choose the sample
FUNCTIONAL = np.array([1.0, 0.7548776662466927, 0.5698402909980532])  # irrational ratios: no mesh symmetry keeps it


def canonical_frame(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Return a frame that moves with the surface and depends on neither vertex order nor place.

    The origin is the area-weighted centroid. The axes are the area-weighted principal axes, longest first, each
    pointing the way its third moment is positive, except the one with the weakest skewness, which makes the frame
    right-handed.

    Returns
    -------
    (3,) centroid, in the unit of the mesh; (3, 3) unit axes in columns: `(vertices - centroid) @ axes` are coordinates.

    Examples
    --------
    >>> wedge = Mesh([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 2]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> turned = wedge.transformed(rotation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]], translation=[5, 6, 7])
    >>> (c, axes), (d, others) = canonical_frame(wedge), canonical_frame(turned)
    >>> bool(np.allclose((wedge.vertices - c) @ axes, (turned.vertices - d) @ others))
    True
    """
    scale, weights = np.sqrt(mesh.area) or 1.0, mesh.vertex_areas / (mesh.area or 1.0)
    centroid = weights @ mesh.vertices
    offsets = (mesh.vertices - centroid) / scale
    axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)[1][:, ::-1]
    coordinates = offsets @ axes
    moments = weights @ coordinates**3
    skewness = np.abs(moments) / np.maximum(weights @ coordinates**2, 1e-30) ** 1.5
    signs = np.where(moments < 0, -1.0, 1.0)
    weakest = int(np.argmin(skewness))
    signs[weakest] = 1.0
    signs[weakest] = np.sign(np.linalg.det(axes * signs))
    return centroid, axes * signs


def canonical_priority(mesh: Mesh) -> FloatArray:
    """Rank the vertices by a generic linear functional in a frame the shape carries with it.

    The frame is `canonical_frame`. Values are divided by sqrt(area): they are the same, up to
    rounding, after rigid motion, scaling and re-ordering.

    Returns
    -------
    priority
        (n,) dimensionless values.

    Examples
    --------
    >>> strip = Mesh([[0, 0, 0], [1, 0, 0], [4, 0, 0], [0, 1, 0]], [[0, 1, 3], [1, 2, 3]])
    >>> bool(np.allclose(canonical_priority(strip), canonical_priority(strip.transformed(scale=3.0))))
    True
    """
    centroid, axes = canonical_frame(mesh)
    return np.asarray((mesh.vertices - centroid) @ (axes @ FUNCTIONAL) / (np.sqrt(mesh.area) or 1.0))


def farthest(distances: FloatArray, priority: FloatArray) -> int:
    """Return the number of the largest distance; of those within `TIE` of it, relatively, that of largest priority.

    Parameters
    ----------
    distances, priority
        (n,) each, n at least 1: lengths in one unit, and what settles ties, such as `canonical_priority`.

    Examples
    --------
    >>> farthest(np.array([2.0, 1.0, 2.0 + 1e-12]), np.array([0.5, 0.9, 0.1]))
    0
    """
    tied = np.flatnonzero(distances >= (1.0 - TIE) * distances.max())
    return int(tied[np.argmax(priority[tied])])
