"""Refuse hyper-parameters that are out of range, before any work is done."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from nonrigid.geometry.errors import InputError

Range = tuple[float, float]

POSITIVE: Range = (1e-6, inf)
"""Of lengths and widths: what is smaller is taken for 0."""

NOT_NEGATIVE: Range = (0.0, inf)
SHARE: Range = (0.0, 1.0)
BELOW_ONE: Range = (0.0, 0.999)
"""Of shares of a largest value down to which something is kept: at 1 nothing would be."""

ABOVE_NONE: Range = (1e-6, 1.0)
"""Of shares of which something has to be left."""

COUNT: Range = (1, inf)
COUNT_OR_NONE: Range = (0, inf)


def check_ranges(settings: Mapping[str, Any], ranges: Mapping[str, Range]) -> None:
    """Raise `InputError` for the first setting that is not in its range; of a tuple, every entry has to be.

    Parameters
    ----------
    settings
        Name -> number or tuple of numbers; others than those of `ranges` are not looked at.
    ranges
        Least and largest value of each setting, in its own unit.

    Examples
    --------
    >>> check_ranges({"rounds": 3, "radii": (0.04, 0.10)}, {"rounds": COUNT, "radii": POSITIVE})
    >>> check_ranges({"kept": 1.5}, {"kept": SHARE})
    Traceback (most recent call last):
    nonrigid.geometry.errors.InputError: kept is 1.5; give a number from 0 to 1
    """
    for name, (least, most) in ranges.items():
        given = settings[name]
        if given == ():
            raise InputError(f"{name} is empty", remedy="give at least one number")
        for value in given if isinstance(given, tuple) else (given,):
            if not least <= value <= most:
                number = "numbers" if isinstance(given, tuple) else "a number"
                span = f"of at least {least:g}" if most == inf else f"from {least:g} to {most:g}"
                raise InputError(f"{name} is {given}", remedy=f"give {number} {span}")
