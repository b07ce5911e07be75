"""Heat and wave kernel signatures: definitions, units, limits, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.geometry.descriptors.heat_kernel import heat_kernel_signature, heat_times
from nonrigid.geometry.descriptors.wave_kernel import wave_energies, wave_kernel_signature
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.spectrum import Spectrum


def random_spectrum(n: int = 40, k: int = 12, *, scale: float = 1.0) -> Spectrum:
    """Return an orthonormal spectrum of a made-up surface, scaled by `scale`."""
    rng = np.random.default_rng(3)
    mass = rng.uniform(0.5, 1.5, n)
    start = np.c_[np.ones(n), rng.normal(size=(n, k - 1))] * np.sqrt(mass)[:, None]
    functions = np.linalg.qr(start)[0] / np.sqrt(mass)[:, None]
    values = np.r_[0.0, np.sort(rng.uniform(1, 300, k - 1))]
    return Spectrum(values / scale**2, functions / scale, mass * scale**2)


def test_heat_kept_is_the_sum_over_eigenpairs_and_its_integral_is_the_trace() -> None:
    basis = random_spectrum()
    times = heat_times(basis, 5)
    assert times[0] == pytest.approx(4 * np.log(10) / basis.eigenvalues[-1])
    assert times[-1] == pytest.approx(4 * np.log(10) / basis.eigenvalues[1])
    found = heat_kernel_signature(basis, times)
    loop = [
        [sum(np.exp(-v * t) * f**2 for v, f in zip(basis.eigenvalues, row, strict=True)) for t in times]
        for row in basis.eigenfunctions
    ]
    np.testing.assert_allclose(found, loop, rtol=1e-12)
    np.testing.assert_allclose(basis.mass @ found, np.exp(-np.outer(times, basis.eigenvalues)).sum(axis=1))
    np.testing.assert_allclose(heat_kernel_signature(basis, [1e6]), 1 / basis.mass.sum())


def test_wave_densities_integrate_to_one_and_pick_an_eigenfunction_in_a_narrow_band() -> None:
    basis = random_spectrum()
    energies, width = wave_energies(basis, 50)
    assert width == pytest.approx(7 * (energies[1] - energies[0]))
    np.testing.assert_allclose(basis.mass @ wave_kernel_signature(basis, energies, width), 1.0)
    narrow = wave_kernel_signature(basis, np.log(basis.eigenvalues[4:5]), 1e-4)
    np.testing.assert_allclose(narrow[:, 0], basis.eigenfunctions[:, 4] ** 2)
    far_off = wave_kernel_signature(basis, [-1e3], 1e-3)
    np.testing.assert_allclose(far_off[:, 0], basis.eigenfunctions[:, 1] ** 2)


def test_signatures_scale_like_one_over_area() -> None:
    small, large = random_spectrum(), random_spectrum(scale=7.0)
    np.testing.assert_allclose(
        heat_kernel_signature(small, heat_times(small, 6)), 49 * heat_kernel_signature(large, heat_times(large, 6))
    )
    np.testing.assert_allclose(
        wave_kernel_signature(small, *wave_energies(small, 9)),
        49 * wave_kernel_signature(large, *wave_energies(large, 9)),
    )


def test_senseless_requests_are_refused() -> None:
    basis = random_spectrum()
    with pytest.raises(InputError, match="time is 0"):
        heat_kernel_signature(basis, [0.0, 1.0])
    with pytest.raises(InputError, match="1 of 2 eigenvalues are positive"):
        heat_times(basis.truncated(2), 4)
    with pytest.raises(InputError, match="1 energies"):
        wave_energies(basis, 1)
    with pytest.raises(InputError, match="width"):
        wave_kernel_signature(basis, [1.0], 0.0)
