"""What every way of measuring along a surface provides."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError


@runtime_checkable
class Geodesics(Protocol):
    """Measure distances along one surface, from vertices to all vertices.

    Attributes
    ----------
    name
        The method, printed beside every result that rests on it.
    """

    @property
    def name(self) -> str:
        """The method, printed beside every result that rests on it."""
        ...

    def distances(self, sources: ArrayLike) -> FloatArray:
        """Return the (s, n) distances from `sources`, in the unit of the vertices; inf where there is no way."""
        ...


def checked_vertices(vertices: ArrayLike, count: int, what: str = "source") -> IntArray:
    """Return the vertex numbers as a flat array, or raise `InputError` naming the first that is not in 0 ... count - 1.

    Examples
    --------
    >>> checked_vertices([2, 0], 3)
    array([2, 0])
    """
    array = np.atleast_1d(np.asarray(vertices))
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InputError(
            f"{what} vertices have shape {array.shape} and type {array.dtype}", remedy="give a flat list of integers"
        )
    bad = np.flatnonzero((array < 0) | (array >= count))
    if len(bad):
        raise InputError(
            f"{what} vertex {array[bad[0]]} is not one of the {count} vertices",
            remedy=f"vertex numbers run from 0 to {count - 1}",
        )
    return array.astype(np.int64)
