"""Laplace-Beltrami operators of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import robust_laplacian
from scipy.sparse import coo_array, csc_array

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Laplacian:
    """Hold the two matrices of a discrete Laplacian, L phi = lambda M phi.

    Parameters
    ----------
    stiffness
        (n, n) symmetric positive semidefinite, without unit; constants lie in its kernel. Its boundary condition is the
        natural one, Neumann's.
    mass
        (n,) diagonal of the lumped mass matrix, in the squared unit of the vertices; sums to the area.
    """

    stiffness: csc_array
    mass: FloatArray


def laplacian(mesh: Mesh, kind: str = "robust") -> Laplacian:
    """Return the Laplacian of a surface.

    `"robust"` takes cotangent weights on an intrinsic Delaunay triangulation of the tufted cover: nonnegative weights
    on any input. `"cotangent"` takes them on the triangles as they are,

        L_ij = -(cot a_ij + cot b_ij) / 2,    M_ii = a third of the area around i,

    as the papers on functional maps do; thin triangles give negative weights (about 17 % of the edges of the SHREC'16
    surfaces) and shift the eigenvalues by 1-2 %.

    Raises
    ------
    UnknownNameError
        If `kind` is neither.
    InputError
        If `kind` is `"cotangent"` and a triangle has no area.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> laplacian(square, "cotangent").stiffness.toarray().round(12) + 0.0
    array([[ 1. , -0.5,  0. , -0.5],
           [-0.5,  1. , -0.5,  0. ],
           [ 0. , -0.5,  1. , -0.5],
           [-0.5,  0. , -0.5,  1. ]])

    Source: Sharp and Crane, "A Laplacian for nonmanifold triangle meshes", 2020 (robust); Pinkall and Polthier,
    "Computing discrete minimal surfaces and their conjugates", 1993 (cotangent).
    """
    if kind == "robust":
        stiffness, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
        return Laplacian(csc_array(stiffness), np.asarray(mass.diagonal(), dtype=np.float64))
    if kind == "cotangent":
        return _cotangent(mesh)
    raise UnknownNameError("Laplacian", kind, ("robust", "cotangent"))


def _cotangent(mesh: Mesh) -> Laplacian:
    flat = np.flatnonzero(mesh.face_areas <= 0.0)
    if len(flat):
        raise InputError(
            f"{len(flat)} triangles have no area, the first is face {flat[0]} (0-based): they have no cotangents",
            file=mesh.name,
            remedy='use kind="robust"',
        )
    rows, columns, weights = [], [], []
    for corner in range(3):
        apex, i, j = (mesh.faces[:, (corner + step) % 3] for step in range(3))
        to_i, to_j = mesh.vertices[i] - mesh.vertices[apex], mesh.vertices[j] - mesh.vertices[apex]
        half_cotangent = np.einsum("fx,fx->f", to_i, to_j) / (4.0 * mesh.face_areas)
        rows += [i, j, i, j]
        columns += [j, i, i, j]
        weights += [-half_cotangent, -half_cotangent, half_cotangent, half_cotangent]
    n = len(mesh.vertices)
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    return Laplacian(csc_array(coo_array(entries, shape=(n, n))), mesh.vertex_areas)
