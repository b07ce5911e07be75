"""The wave kernel signature: where a quantum particle of given energy is likely to be."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.descriptors.heat_kernel import positive_range
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.spectrum import Spectrum

SPACINGS = 7.0  # width of a band, in spacings of the energies


def wave_kernel_signature(spectrum: Spectrum, energies: ArrayLike, width: float) -> FloatArray:
    r"""Return the probability density of each vertex in a band around each energy.

    .. math:: w_e(x) = \sum_{k:\lambda_k>0} g_k(e)\,\phi_k(x)^2 \Big/ \sum_{k:\lambda_k>0} g_k(e), \qquad
              g_k(e) = \exp\bigl(-(e - \ln\lambda_k)^2 / 2\sigma^2\bigr)

    Parameters
    ----------
    spectrum
        Eigenvalues (k,), in one over the squared unit of the vertices, and eigenfunctions (n, k).
    energies
        (e,) centres of the bands, as logarithms of eigenvalues.
    width
        The standard deviation of a band, in natural logarithms.

    Returns
    -------
    signature
        (n, e) values, in one over the squared unit of the vertices.

    Raises
    ------
    InputError
        If `width` is not positive.

    Examples
    --------
    >>> flat = Spectrum(eigenvalues=np.array([0.0, 1.0, 2.0]), eigenfunctions=np.array([[1.0, 1.0, 3.0]]),
    ...                 mass=np.array([1.0]))
    >>> wave_kernel_signature(flat, np.log([1.0, 2.0]), width=0.1).round(4)
    array([[1., 9.]])

    Source: Aubry, Schlickewei, Cremers, "The wave kernel signature: a quantum mechanical approach to shape analysis",
    ICCV workshops 2011, equation 4.
    """
    bands = np.atleast_1d(np.asarray(energies, dtype=np.float64))
    if not width > 0:
        raise InputError(f"the width of the bands is {width}", remedy="give a positive width")
    low, _ = positive_range(spectrum)
    positive = spectrum.eigenvalues >= low
    exponents = -((bands - np.log(spectrum.eigenvalues[positive])[:, None]) ** 2) / (2.0 * width**2)
    # Shifted before exp, so that a band far from every eigenvalue still divides by one, not by zero.
    filters = np.exp(exponents - exponents.max(axis=0))
    return np.asarray(spectrum.eigenfunctions[:, positive] ** 2 @ (filters / filters.sum(axis=0)))


def wave_energies(spectrum: Spectrum, count: int) -> tuple[FloatArray, float]:
    """Return (count,) evenly spaced energies inside the range of the spectrum, and the width of their bands.

    Energies are natural logarithms of eigenvalues; scaling the surface shifts them all alike. The width is seven
    spacings, and the energies stay two widths away from either end of the spectrum.

    Raises
    ------
    InputError
        If fewer than two eigenvalues are positive, or `count` is below 2.

    Examples
    --------
    >>> flat = Spectrum(eigenvalues=np.exp([0.0, 1.0, 14.5]), eigenfunctions=np.ones((1, 3)), mass=np.ones(1))
    >>> energies, width = wave_energies(flat, 2)
    >>> energies.round(6), round(width, 6)
    (array([7. , 7.5]), 3.5)

    Source: Aubry, Schlickewei, Cremers (2011), section 4.
    """
    if count < 2:
        raise InputError(f"{count} energies have no spacing", remedy="ask for at least 2")
    low, high = np.log(positive_range(spectrum))
    width = float(SPACINGS * (high - low) / (count - 1 + 4.0 * SPACINGS))
    return np.linspace(low + 2.0 * width, high - 2.0 * width, count), width
