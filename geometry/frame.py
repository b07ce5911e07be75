"""A frame that a surface carries with it."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.mesh import Mesh


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
