"""Functional maps between a part and a whole: their shape, and the points they stand for."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.maps import RowSearch, nearest_rows
from nonrigid.geometry.spectrum import Spectrum

SPREAD = 0.03
"""Length, in units of sqrt(full area), over which matches are spread to find the region they lie in."""

ENOUGH = 5e-6
"""Fall of the mean feature distance below which the closest-point iteration ends."""


def estimated_rank(part_eigenvalues: FloatArray, full_eigenvalues: FloatArray) -> int:
    """Return how many eigenfunctions of the part have a counterpart on the whole: those below its largest eigenvalue.

    By Weyl's law it is about the number of eigenvalues times the share of the area that the part keeps.

    Examples
    --------
    >>> estimated_rank(np.array([0.0, 4.0, 9.0]), np.array([0.0, 2.0, 5.0]))
    2
    """
    return int(np.sum(part_eigenvalues < full_eigenvalues.max()))


def slanted_mask(size: int, rank: int) -> FloatArray:
    """Return weights, (size, size), that are 0 on the line from the corner with slope rank / size and grow off it.

    W_ij = exp(-0.03 sqrt(i^2 + j^2)) |(j - 1) - s (i - 1)| / sqrt(1 + s^2), s = rank / size; rows i = 1, 2 ...
    belong to the whole, columns j to the part.

    Source: Rodola, Cosmo, Bronstein, Torsello and Cremers, partial functional correspondence (CGF 2017).

    Examples
    --------
    >>> slanted_mask(2, 2).round(3)
    array([[0.   , 0.661],
           [0.661, 0.   ]])
    """
    slope = rank / size
    i, j = np.arange(1, size + 1)[:, None], np.arange(1, size + 1)[None, :]
    distance = np.abs((j - 1) - slope * (i - 1)) / np.sqrt(1.0 + slope**2)
    return np.asarray(np.exp(-0.03 * np.sqrt(i**2 + j**2)) * distance)


def diagonal_start(mask: FloatArray, rank: int) -> FloatArray:
    """Return the map that is large where a mask is small, scaled to be as near to an isometry as its ray comes.

    C = t (1 - W / max W) with the t that minimizes ||C'C - diag(d)||_F for d = (1, ..., 1, 0, ..., 0), `rank` ones. At
    t = 1, the published start, the penalty is 10^6 times larger: some line searches then fail at their first step.

    Examples
    --------
    >>> diagonal_start(slanted_mask(2, 2), 2).round(3)
    array([[1., 0.],
           [0., 1.]])
    """
    largest = float(mask.max())
    C = 1.0 - mask / largest if largest > 0.0 else np.ones_like(mask)
    gram = C.T @ C
    return np.asarray(C * np.sqrt(gram.diagonal()[:rank].sum() / np.sum(gram * gram)))


def orthonormal_map(part: FloatArray, full: FloatArray, *, passes: int = 8) -> FloatArray:
    """Return the map D with D'D = I, (k, r), that takes most rows x_p of `part` near the rows y_p matched with them.

    Minimizes sum_p w_p |D x_p - y_p|^2, `passes` times with w_p = 1 / max(d_p, 0.3 median d)^2 from the last distances
    d_p, so that wrong matches, which lie far off, count little. Rows: (p, r) and (p, k), r <= k.

    Examples
    --------
    >>> turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    >>> points = np.array([[1.0, 0.0], [0.0, 2.0], [-3.0, 1.0], [2.0, 2.0], [1.0, -1.0]])
    >>> matched = points @ turn.T
    >>> matched[0] = [9.0, 9.0]  # wrong
    >>> orthonormal_map(points, matched).round(2) + 0.0
    array([[ 0.6, -0.8],
           [ 0.8,  0.6]])
    """
    weights = np.ones(len(part))
    for _ in range(passes + 1):
        left, _, right = np.linalg.svd((full * weights[:, None]).T @ part, full_matrices=False)
        D = left @ right
        apart = np.linalg.norm(part @ D.T - full, axis=1)
        weights = 1.0 / np.maximum(apart, max(0.3 * float(np.median(apart)), 1e-12)) ** 2
    return np.asarray(D)


def region_of_matches(matches: IntArray, weights: FloatArray, full: Spectrum, area: float) -> FloatArray:
    """Return 1 on the region of the whole, of a given area, where most matches lie once they are spread out; 0 off it.

    The matched vertices, with their weights, (p,), are spread by the heat kernel at time 0.03^2, areas and lengths in
    units of the full area and its root; the region is where the heat is largest.

    Examples
    --------
    >>> whole = Spectrum(np.array([0.0]), np.ones((2, 1)), np.array([0.5, 0.5]))
    >>> region_of_matches(np.array([1]), np.ones(1), whole, 1.0)
    array([1., 1.])
    """
    E = full.eigenfunctions
    heat = E @ (np.exp(-(SPREAD**2) * full.eigenvalues) * (np.bincount(matches, weights, len(E)) @ E))
    order = np.argsort(-heat, kind="stable")
    inside = np.searchsorted(np.cumsum(full.mass[order]), area)
    region = np.zeros(len(E))
    region[order[: inside + 1]] = 1.0
    return region


def spectral_closest_points(
    C: FloatArray, part: FloatArray, full: FloatArray, *, iterations: int
) -> tuple[FloatArray, float]:
    """Return the orthonormal map nearest to a rough one by alternating closest points and rotations.

    Each row p of `part` is sent to its nearest row m(p) of `full`, argmin_q |D x_p - y_q|; then D = U V' from the
    singular vectors of sum_p y_m(p) x_p' = U S V' is the best map with D'D = I. It stops, one step back, where the mean
    distance rises, and where it falls by less than 5e-6.

    Parameters
    ----------
    C
        (k, r) start, r <= k.
    part, full
        (p, r) and (n, k) rows: eigenfunctions at points of the part, and at all points of the whole.
    iterations
        Largest number of steps.

    Returns
    -------
    D, mean distance
        (k, r), and the mean of |D x_p - y_m(p)| over the rows.

    Source: the spectral form of the iterative closest point method in Ovsjanikov, Ben-Chen, Solomon, Butscher and
    Guibas, functional maps (SIGGRAPH 2012).

    Examples
    --------
    >>> turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    >>> points = np.array([[1.0, 0.0], [0.0, 2.0], [-3.0, 1.0]])
    >>> found, distance = spectral_closest_points(0.9 * turn, points, points @ turn.T, iterations=5)
    >>> bool(np.allclose(found, turn)), round(distance, 12)
    (True, 0.0)
    """
    D, search = C, RowSearch(full)
    best: tuple[FloatArray, float] = D, np.inf
    for _ in range(iterations + 1):
        nearest, squared = search.nearest(part @ D.T)
        distance = float(np.sqrt(squared).mean())
        # The start need not be orthonormal: its distance is not one to compare with.
        if D is not C and distance >= best[1]:
            return best
        settled = best[1] - distance < ENOUGH
        best = best if D is C else (D, distance)
        if settled:
            return best
        left, _, right = np.linalg.svd(full[nearest].T @ part, full_matrices=False)
        D = left @ right
    return best if np.isfinite(best[1]) else (D, distance)


def matched_rows(D: FloatArray, part: FloatArray, full: FloatArray) -> IntArray:
    """Return, for each row x of `part`, (p, r), the number of the row of `full`, (n, k), nearest to D x.

    Examples
    --------
    >>> matched_rows(np.eye(2), np.array([[0.9, 0.1]]), np.array([[0.0, 1.0], [1.0, 0.0]]))
    array([1])
    """
    return nearest_rows(part @ D.T, full)[0]
