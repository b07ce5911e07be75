"""The squared difference between a wanted area and the area of a soft region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, ModelError
from nonrigid.formulations.model.terms.membership import membership, membership_slope
from nonrigid.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class AreaGap(Applicable):
    """Evaluate f(v) = (a - sum of s_i eta(v_i))^2, in the squared unit of the areas.

    Parameters
    ----------
    mass
        s, (n,): areas of the vertices, finite.
    area
        a: the area wanted, in the same unit.

    Raises
    ------
    ModelError
        If the areas are not finite.

    Examples
    --------
    >>> AreaGap(np.array([0.5, 0.5]), 0.25).value_and_gradient(np.array([0.5, 0.5]))
    (0.0625, array([0.75, 0.75]))
    """

    mass: FloatArray
    area: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass).all() and np.isfinite(self.area)):
            raise ModelError("the areas are not finite")

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the squared gap and its gradient, (n,)."""
        gap = self.area - float(self.mass @ membership(x[0]))
        return gap * gap, -2.0 * gap * self.mass * membership_slope(x[0])

    def latex(self, names: Sequence[str]) -> str:
        """Return the squared gap as LaTeX."""
        return rf"\left(a - s^\top \eta({names[0]})\right)^2"

    @staticmethod
    def examples() -> list[tuple[Any, int]]:
        """Return instances for the conformance kit."""
        return [(AreaGap(np.array([0.2, 0.3, 0.1, 0.4]), 0.45), 4)]
