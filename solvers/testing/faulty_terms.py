"""Terms that misbehave on purpose: what a solve must survive."""

from __future__ import annotations

import copy
import time
from typing import Any

from nonrigid.geometry.arrays import FloatArray


class _Around:
    """Misbehave at every evaluation of a term, which stays what it is in class and structure."""

    @classmethod
    def around(cls, term: Any) -> Any:
        """Return a copy of the term, of a subclass of its own class, whose evaluation misbehaves."""
        twin = copy.copy(term)
        kind = type(f"{cls.__name__}{type(term).__name__}", (cls, type(term)), {})
        object.__setattr__(twin, "__class__", kind)
        return twin


class Slow(_Around):
    """Take 5 ms an evaluation."""

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, Any]:
        """Sleep, then evaluate."""
        time.sleep(0.005)
        value, gradient = super().value_and_gradient(*x)  # type: ignore[misc]
        return value, gradient


class NotANumber(_Around):
    """Have the value NaN everywhere."""

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, Any]:
        """Return NaN and a true gradient."""
        return float("nan"), super().value_and_gradient(*x)[1]  # type: ignore[misc]


class Failing(_Around):
    """Raise at every evaluation."""

    words = "this term fails on purpose"

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, Any]:
        """Raise."""
        raise RuntimeError(self.words)
