"""Unknowns of a problem, and their membership in a set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nonrigid.formulations.model.sets import Set


@dataclass(frozen=True)
class Variable:
    """Name an unknown array.

    Parameters
    ----------
    name
        Key under which a solution holds its value.
    shape
        Its shape; a number stands for a vector.

    Examples
    --------
    >>> from nonrigid.formulations.model import Simplex
    >>> u = Variable("u", 3)
    >>> print(u @ Simplex())
    u in Simplex()
    """

    name: str
    shape: tuple[int, ...]

    def __init__(self, name: str, shape: int | tuple[int, ...]) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "shape", (shape,) if isinstance(shape, int) else tuple(shape))

    @property
    def size(self) -> int:
        """Number of entries."""
        size = 1
        for length in self.shape:
            size *= length
        return size

    def __matmul__(self, set_: Set) -> Membership:
        return Membership(self, set_)


@dataclass(frozen=True)
class Membership:
    """State that a variable lies in a set; written `variable @ set`."""

    variable: Variable
    set: Set

    def __str__(self) -> str:
        return f"{self.variable.name} in {self.set}"
