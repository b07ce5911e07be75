"""The failure of a conformance check, and the one way to state an expectation."""

from __future__ import annotations

import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import NonrigidError


class ConformanceError(NonrigidError, AssertionError):
    """Report that a term, set, bridge or backend breaks its contract: what was expected, what was found, where to look.

    Examples
    --------
    >>> print(ConformanceError("Box", expected="a point of the set", found="violation 0.1", look="restore"))
    Box: expected a point of the set, found violation 0.1; look at restore
    """

    def __init__(self, subject: object, *, expected: str, found: str, look: str) -> None:
        self.subject, self.expected, self.found, self.look = subject, expected, found, look
        super().__init__(f"{subject}: expected {expected}, found {found}; look at {look}")


def expect(condition: object, subject: object, *, expected: str, found: object, look: str) -> None:
    """Raise `ConformanceError` unless the condition holds."""
    if not condition:
        shown = f"{found:.6g}" if isinstance(found, float) else str(found)
        raise ConformanceError(subject, expected=expected, found=shown, look=look)


def largest(value: object) -> float:
    """Return the largest magnitude of an array, 0 for an empty one; infinite where it holds a NaN."""
    worst = float(np.max(np.abs(np.asarray(value, dtype=float)), initial=0.0))
    return worst if worst == worst else float("inf")


def distance(left: FloatArray, right: FloatArray) -> float:
    """Return the largest difference of entries; infinite where shapes differ or a NaN stands."""
    if np.shape(left) != np.shape(right):
        return float("inf")
    return largest(np.asarray(left, dtype=float) - np.asarray(right, dtype=float))
