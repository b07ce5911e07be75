"""Points on a surface between its vertices: a face and barycentric weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray, frozen
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Name points of a surface by face and barycentric weights.

    Parameters
    ----------
    faces
        (p,) face numbers, 0-based; -1 says that a point is unmatched.
    barycentric
        (p, 3) weights of the face's corners, in the order the face lists them; each row sums to one (zero where
        unmatched).

    Raises
    ------
    InputError
        If shapes disagree, or the weights of a matched point do not sum to one within 1e-4, or one is below -1e-4.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> SurfacePoints([1], [[0.5, 0.0, 0.5]]).positions(square)
    array([[0. , 0.5, 0. ]])
    """

    faces: IntArray
    barycentric: FloatArray

    def __init__(self, faces: ArrayLike, barycentric: ArrayLike) -> None:
        numbers = np.array(faces, dtype=np.int64).reshape(-1)
        weights = np.array(barycentric, dtype=np.float64).reshape(-1, 3)
        if len(numbers) != len(weights):
            raise InputError(f"{len(numbers)} faces but {len(weights)} rows of weights", remedy="give one row a point")
        matched = numbers >= 0
        weights[~matched] = 0.0
        wrong = np.flatnonzero(matched & ~(np.abs(weights.sum(axis=1) - 1.0) < 1e-4))
        if len(wrong):
            raise InputError(
                f"barycentric weights sum to {weights[wrong[0]].sum():.6g}, not 1",
                row=int(wrong[0]) + 1,
                remedy="write the three weights of the triangle's corners",
            )
        outside = np.flatnonzero(weights.min(axis=1, initial=0.0) < -1e-4)
        if len(outside):
            raise InputError(
                f"a barycentric weight is {weights[outside[0]].min():.6g}",
                row=int(outside[0]) + 1,
                remedy="give points inside their triangles",
            )
        weights = np.clip(weights, 0.0, None)
        # What sums to 1 up to rounding stays, so that points read again are the same to the last bit.
        total = weights.sum(axis=1, keepdims=True)
        uneven = matched & (np.abs(total[:, 0] - 1.0) > 4.0 * np.finfo(float).eps)
        weights[uneven] /= total[uneven]
        object.__setattr__(self, "faces", frozen(numbers))
        object.__setattr__(self, "barycentric", frozen(weights))

    def __len__(self) -> int:
        return len(self.faces)

    def __getitem__(self, index: IntArray | BoolArray | slice) -> SurfacePoints:
        return SurfacePoints(self.faces[index], self.barycentric[index])

    @property
    def matched(self) -> BoolArray:
        """(p,) whether each point names a face."""
        return np.asarray(self.faces >= 0)

    @classmethod
    def at_vertices(cls, mesh: Mesh, vertices: ArrayLike) -> SurfacePoints:
        """Return the points at the given vertex numbers (-1 for unmatched), each in its lowest-numbered face.

        Raises `InputError` if a vertex lies in no face, or a number is not that of a vertex.
        """
        wanted = np.asarray(vertices, dtype=np.int64).reshape(-1)
        if len(strange := wanted[wanted >= len(mesh.vertices)]):
            raise InputError(
                f"vertex {strange[0]} is not one of the {len(mesh.vertices)} of {mesh.name}",
                remedy=f"vertex numbers run from 0 to {len(mesh.vertices) - 1}",
            )
        corner = np.full(len(mesh.vertices), -1, dtype=np.int64)
        flat = mesh.faces.ravel()
        corner[flat[::-1]] = np.arange(flat.size)[::-1]
        place = np.where(wanted >= 0, corner[wanted], -3)
        if (place == -1).any():
            raise InputError(f"vertex {wanted[place == -1][0]} lies in no face", remedy="drop unreferenced vertices")
        weights = np.zeros((len(wanted), 3))
        weights[np.arange(len(wanted)), place % 3] = 1.0
        return cls(np.where(wanted >= 0, place // 3, -1), weights)

    def check(self, mesh: Mesh) -> SurfacePoints:
        """Return self, or raise `InputError` if a face number is not one of `mesh`."""
        bad = np.flatnonzero(self.faces >= len(mesh.faces))
        if len(bad):
            raise InputError(
                f"point names face {self.faces[bad[0]]} (0-based), but {mesh.name} has {len(mesh.faces)} faces",
                row=int(bad[0]) + 1,
                remedy="use the surface that the points were made for, with its faces in file order",
            )
        return self

    def positions(self, mesh: Mesh) -> FloatArray:
        """(p, 3) coordinates on `mesh`; NaN where unmatched."""
        corners = mesh.vertices[mesh.faces[self.faces]]
        place = np.einsum("pc,pcx->px", self.barycentric, corners)
        place[~self.matched] = np.nan
        return np.asarray(place)

    def nearest_corner(self, mesh: Mesh) -> IntArray:
        """(p,) the vertex with the largest weight; -1 where unmatched."""
        corner = mesh.faces[self.faces, self.barycentric.argmax(axis=1)]
        return np.where(self.matched, corner, -1)
