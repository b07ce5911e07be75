"""Eigenfunctions of the Laplacian: the Fourier basis of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, eye_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh, splu

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.operators import Laplacian


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Hold the smallest eigenpairs of a Laplacian, L phi_i = lambda_i M phi_i.

    Parameters
    ----------
    eigenvalues
        (k,) ascending, in 1 / squared unit of the vertices; the first is 0 up to rounding.
    eigenfunctions
        (n, k) columns phi_i with phi_i' M phi_j = delta_ij, in 1 / unit of the vertices.
    mass
        (n,) diagonal of M, in the squared unit of the vertices.
    """

    eigenvalues: FloatArray
    eigenfunctions: FloatArray
    mass: FloatArray

    def project(self, functions: FloatArray) -> FloatArray:
        """Return the coefficients Phi' M f of functions (n, ...) in the basis: (k, ...)."""
        return np.asarray((self.eigenfunctions * self.mass[:, None]).T @ functions)

    def truncated(self, k: int) -> Spectrum:
        """Return the first `k` eigenpairs."""
        if not 1 <= k <= len(self.eigenvalues):
            raise InputError(f"{k} eigenpairs of {len(self.eigenvalues)}", remedy="ask for at most as many as computed")
        return Spectrum(self.eigenvalues[:k], self.eigenfunctions[:, :k], self.mass)


def spectrum(laplacian: Laplacian, k: int, *, reference: FloatArray | None = None) -> Spectrum:
    """Return the `k` smallest eigenpairs of a Laplacian.

    Works on the standard form M^-1/2 L M^-1/2 by shift and invert at -0.01 / area, just below the spectrum, where a
    sparse symmetric factorisation exists. The start vector is fixed: the same input gives the same output.

    Signs: each eigenfunction takes the sign that makes its third moment, the sum of m_i phi_i^3, positive, which
    depends neither on the order of the vertices nor on the frame. Where the third moment vanishes up to rounding (an
    eigenfunction that is odd under a symmetry of the surface: no intrinsic rule can choose) the sum of m_i phi_i r_i is
    made positive for the (n,) function r = `reference`, if one is given; else the solver's sign stays. Eigenfunctions
    of a repeated eigenvalue are defined up to a rotation among themselves.

    Raises
    ------
    InputError
        If `k` is not between 1 and n - 1, or a vertex has no mass.

    Examples
    --------
    >>> from nonrigid.geometry.mesh import Mesh
    >>> from nonrigid.geometry.operators import laplacian
    >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> tetrahedron = Mesh(corners, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    >>> spectrum(laplacian(tetrahedron), 2).eigenvalues.round(6) + 0.0
    array([0.      , 0.666667])
    """
    n = len(laplacian.mass)
    if not 1 <= k < n:
        raise InputError(f"{k} eigenpairs of a surface with {n} vertices", remedy=f"ask for 1 to {n - 1}")
    massless = np.flatnonzero(~(laplacian.mass > 0.0))
    if len(massless):
        raise InputError(
            f"{len(massless)} vertices have no mass, the first is vertex {massless[0]} (0-based)",
            remedy="drop triangles without area, or use the robust Laplacian",
        )
    scale = 1.0 / np.sqrt(laplacian.mass)
    standard = diags_array(scale) @ laplacian.stiffness @ diags_array(scale)
    sigma = -0.01 / laplacian.mass.sum()
    values, vectors = _smallest(csc_array(standard), k, float(sigma))
    eigenfunctions = vectors * scale[:, None]
    signs = _canonical_signs(eigenfunctions, laplacian.mass, reference)
    return Spectrum(values, eigenfunctions * signs, laplacian.mass)


def _smallest(matrix: csc_array, k: int, sigma: float) -> tuple[FloatArray, FloatArray]:
    n = matrix.shape[0]
    if n <= max(k + 2, 64):  # ARPACK needs room for its subspace, and a dense solve costs nothing here
        values, vectors = np.linalg.eigh(matrix.toarray())
        return values[:k], vectors[:, :k]
    # Both tricks keep the factor fast: the ordering without the symmetric options takes 25 times as long, and on some
    # vertex orders (subdivided spheres) ten times as long unless a bandwidth-reducing permutation goes before it.
    order = reverse_cuthill_mckee(csr_array(matrix), symmetric_mode=True)
    matrix = csc_array(matrix[order][:, order])
    factor = splu(
        csc_array(matrix - sigma * eye_array(n)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    inverse = LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(n)
    try:
        values, vectors = eigsh(
            matrix, k, sigma=sigma, OPinv=inverse, v0=start, ncv=min(n, int(1.3 * k) + 20), maxiter=50 * n
        )
    except ArpackNoConvergence as error:
        raise InputError(
            f"only {len(error.eigenvalues)} of {k} eigenpairs converged", remedy="use the robust Laplacian"
        ) from error
    ascending = np.argsort(values)
    unpermuted = np.empty_like(vectors)
    unpermuted[order] = vectors[:, ascending]
    return values[ascending], unpermuted


def _canonical_signs(functions: FloatArray, mass: FloatArray, reference: FloatArray | None) -> FloatArray:
    third = mass @ functions**3
    odd = np.abs(third) <= 1e-8 * (mass @ np.abs(functions) ** 3)
    undecided = np.ones_like(third) if reference is None else (mass * reference) @ functions
    return np.where(np.where(odd, undecided, third) < 0.0, -1.0, 1.0)
