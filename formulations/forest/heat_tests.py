"""What a node of the forest asks: how much heat stays at a point, for a random time and fineness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.descriptors.heat_kernel import positive_range
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.spectrum import Spectrum

FEWEST = 5
"""Eigenfunctions in the coarsest test."""

Answers: TypeAlias = NDArray[np.float32]

_SLACK = 1e-6
"""An eigenvalue this much above the cutoff, relatively, is the same one after a motion."""

_FLOOR = 1e-6
"""Heat below this, in 1 / full area, is rounding."""


@dataclass(frozen=True, eq=False)
class HeatTests:
    r"""Hold the random parameters of tests log f(x), f(x) = sum of exp(-lambda_i t) phi_i(x)^2 over lambda_i <= c.

    The unit of area is the full surface's, for part and whole alike: tests do not change with the unit of length, and
    not with a motion. The published test ends its sum at a number k of eigenfunctions; ours at the eigenvalue c that
    the whole has there, since the k-th eigenfunction of half a surface is twice as fine as that of the whole.

    Parameters
    ----------
    cutoffs
        (m,) largest eigenvalues c, in 1 / full area.
    times
        (m,) times t, in units of the full area.

    Source: Rodola, Rota Bulo, Windheuser, Vestner and Cremers, dense non-rigid shape correspondence using random
    forests (CVPR 2014), there with wave kernels; the heat kernel as in SHREC'16.

    Examples
    --------
    >>> flat = Spectrum(np.array([0.0, 2.0]), np.array([[1.0, 1.0], [1.0, -1.0]]), np.array([0.5, 0.5]))
    >>> HeatTests(np.array([1.0, 2.0]), np.array([0.5, 0.5])).values(flat).round(2)
    array([[0.  , 0.31],
           [0.  , 0.31]], dtype=float32)
    """

    cutoffs: FloatArray
    times: FloatArray

    def __len__(self) -> int:
        return len(self.times)

    def values(self, spectrum: Spectrum) -> Answers:
        """Return the (n, m) answers at the n points of a surface whose lengths are in units of sqrt(full area)."""
        eigenvalues = np.maximum(spectrum.eigenvalues, 0.0)
        weights = np.exp(-np.outer(eigenvalues, self.times))
        weights[eigenvalues[:, None] > (1.0 + _SLACK) * self.cutoffs] = 0.0
        heat: FloatArray = np.square(spectrum.eigenfunctions) @ weights
        return np.log(np.maximum(heat, _FLOOR)).astype(np.float32)


def draw_tests(full: Spectrum, count: int, rng: np.random.Generator) -> HeatTests:
    """Return `count` random tests: the rank of c uniform from 5 on, log t uniform over what the spectrum can tell.

    Times run from 4 ln 10 / lambda_max to 4 ln 10 / lambda_1 of the full surface, as for `heat_times`.

    Raises
    ------
    InputError
        If the spectrum has fewer than `FEWEST` eigenfunctions.
    """
    largest = len(full.eigenvalues)
    if largest < FEWEST:
        raise InputError(f"{largest} eigenfunctions are too few for a forest", remedy=f"ask for at least {FEWEST}")
    low, high = positive_range(full)
    reach = 4.0 * np.log(10.0)
    times = np.exp(rng.uniform(np.log(reach / high), np.log(reach / low), count))
    return HeatTests(full.eigenvalues[rng.integers(FEWEST, largest + 1, count) - 1], times)
