"""The residual C A - B of an unknown matrix: what the terms that measure it have in common."""

from __future__ import annotations

from typing import Any

import numpy as np

from nonrigid.formulations.model.term import ModelError
from nonrigid.geometry.arrays import FloatArray


def check_residual(source: FloatArray, target: FloatArray) -> None:
    """Raise `ModelError` unless A, (r, q), and B, (k, q), are finite and have as many columns."""
    shapes = source.shape, target.shape
    if source.ndim != 2 or target.ndim != 2 or shapes[0][1] != shapes[1][1]:
        raise ModelError(f"A and B have shapes {shapes[0]} and {shapes[1]}; give (r, q) and (k, q)")
    if not (np.isfinite(source).all() and np.isfinite(target).all()):
        raise ModelError("A or B has entries that are not finite")


def lowered_residual(source: FloatArray, target: FloatArray, x: Any, ops: Any) -> Any:
    """Return C A - B, (k, q), in the operations of a symbolic backend."""
    return ops.matmul(source.T, x.T).T - target
