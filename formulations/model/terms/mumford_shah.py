"""The length of the edge of a soft region on a surface, after Mumford and Shah."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nonrigid.formulations.model.term import Applicable, ModelError
from nonrigid.geometry.arrays import FloatArray, IntArray

CENTRE, WIDTH = 0.5, 0.2


@dataclass(frozen=True, eq=False)
class MumfordShah(Applicable):
    r"""Evaluate f(v), the integral of xi(v) |grad v|, for v linear on each triangle.

    xi(v) = exp(-(v - 1/2)^2 / (2 * 0.2^2)) lets only the transition between outside (0) and inside (1) count, so that f
    measures the length of the region's edge: 0.5 times it, in the unit of the vertices. On a triangle with corners p1,
    p2, p3 and values v1, v2, v3 there, the integral is the mean of xi at the corners times

        sqrt(a^2 G - 2 a b F + b^2 E) / 2,   a = v2 - v1,  b = v3 - v1,
        E = |p2 - p1|^2,  F = (p2 - p1).(p3 - p1),  G = |p3 - p1|^2,

    the area times |grad v|. Where v is constant on a triangle the subgradient 0 is returned for it.

    Parameters
    ----------
    vertices, faces
        (n, 3) corners, in the unit of length of the objective, and (m, 3) triangles.

    Raises
    ------
    ModelError
        If a face names no vertex, or a vertex is not finite.

    Source: Rodola, Cosmo, Bronstein, Torsello and Cremers, partial functional correspondence (CGF 2017).

    Examples
    --------
    >>> step = MumfordShah(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]]))
    >>> round(step.value_and_gradient(np.array([0.0, 1.0, 0.0]))[0], 6)  # area 2, |grad v| = 1/2, mean xi 0.043937
    0.043937
    """

    vertices: FloatArray
    faces: IntArray
    _form: tuple[FloatArray, FloatArray, FloatArray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.faces.ndim != 2 or self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ModelError(f"the faces name vertices outside 0 to {len(self.vertices) - 1}")
        if not np.isfinite(self.vertices).all():
            raise ModelError("the vertices are not finite")
        first, second, third = (self.vertices[self.faces[:, corner]] for corner in range(3))
        along, across = second - first, third - first
        form = tuple(np.einsum("fx,fx->f", p, q) for p, q in ((along, along), (along, across), (across, across)))
        object.__setattr__(self, "_form", form)

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the integral and its gradient, (n,)."""
        v = x[0]
        E, F, G = self._form
        bump = np.exp(-((v - CENTRE) ** 2) / (2.0 * WIDTH**2))
        corners = v[self.faces]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        to_second, to_third = a * G - b * F, b * E - a * F
        slope = np.sqrt(np.maximum(a * to_second + b * to_third, 0.0))
        weight = bump[self.faces].sum(axis=1)
        scale = np.divide(weight, slope, out=np.zeros_like(slope), where=slope > 1e-30)
        to_second, to_third = scale * to_second, scale * to_third
        shares = np.concatenate([-to_second - to_third, to_second, to_third])
        through_slope = np.bincount(self.faces.T.ravel(), shares, len(v))
        around = np.bincount(self.faces.ravel(), np.repeat(slope, 3), len(v))
        through_bump = around * bump * (CENTRE - v) / WIDTH**2
        return float(slope @ weight) / 6.0, (through_slope + through_bump) / 6.0

    def latex(self, names: Sequence[str]) -> str:
        """Return the integral as LaTeX."""
        return rf"\int \xi({names[0]})\, \|\nabla {names[0]}\|"

    @staticmethod
    def examples() -> list[tuple[Any, int]]:
        """Return instances for the conformance kit."""
        corners = np.array([[0.0, 0, 0], [1, 0, 0.2], [1, 1, 0], [0, 1, 0.3], [0.5, 0.4, 1]])
        return [(MumfordShah(corners, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])), 5)]
