"""The heat kernel signature: how much heat stays at a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.spectrum import Spectrum


def heat_kernel_signature(spectrum: Spectrum, times: ArrayLike) -> FloatArray:
    r"""Return the heat that remains at each vertex after each time.

    .. math:: h_t(x) = \sum_k \exp(-\lambda_k t)\,\phi_k(x)^2

    Parameters
    ----------
    spectrum
        Eigenvalues (k,), in one over the squared unit of the vertices, and eigenfunctions (n, k).
    times
        (t,) positive times, in the squared unit of the vertices.

    Returns
    -------
    signature
        (n, t) values, in one over the squared unit of the vertices.

    Raises
    ------
    InputError
        If a time is not positive.

    Examples
    --------
    >>> flat = Spectrum(eigenvalues=np.array([0.0, 2.0]), eigenfunctions=np.array([[1.0, 1.0], [1.0, -1.0]]),
    ...                 mass=np.array([0.5, 0.5]))
    >>> heat_kernel_signature(flat, [0.5]).round(4)
    array([[1.3679],
           [1.3679]])

    Source: Sun, Ovsjanikov, Guibas, "A concise and provably informative multi-scale signature based on heat
    diffusion", SGP 2009, equation 4.
    """
    instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if not (np.isfinite(instants) & (instants > 0)).all():
        raise InputError(f"the smallest heat time is {instants.min()}", remedy="give positive, finite times")
    return np.asarray(spectrum.eigenfunctions**2 @ np.exp(-np.outer(spectrum.eigenvalues, instants)))


def heat_times(spectrum: Spectrum, count: int) -> FloatArray:
    r"""Return (count,) times from :math:`4\ln 10/\lambda_{max}` to :math:`4\ln 10/\lambda_1`, evenly in the logarithm.

    The unit is the squared unit of the vertices. Raises `InputError` if fewer than two eigenvalues are positive.

    Source: Sun, Ovsjanikov, Guibas (2009), section 5.
    """
    low, high = positive_range(spectrum)
    return np.geomspace(4.0 * np.log(10.0) / high, 4.0 * np.log(10.0) / low, count)


def positive_range(spectrum: Spectrum) -> tuple[float, float]:
    """Return the smallest and the largest eigenvalue that is not zero up to rounding, or raise `InputError`."""
    values = spectrum.eigenvalues
    positive = values[values > 1e-9 * values.max(initial=0.0)]
    if len(positive) < 2:
        raise InputError(
            f"{len(positive)} of {len(values)} eigenvalues are positive",
            remedy="compute a spectrum of more eigenvalues",
        )
    return float(positive.min()), float(positive.max())
