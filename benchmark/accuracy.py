"""How exact a run should be: three presets, each of tolerances that are judged by the package's own residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from nonrigid.geometry.errors import UnknownNameError
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import Solution
from nonrigid.solvers.status import Status


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Hold the two tolerances of a preset, as in `nonrigid.solvers.limits.Limits`."""

    tolerance: float
    feasibility: float


PRESETS: Mapping[str, Accuracy] = {
    "low": Accuracy(tolerance=1e-3, feasibility=1e-5),
    "mid": Accuracy(tolerance=1e-6, feasibility=1e-7),
    "high": Accuracy(tolerance=1e-9, feasibility=1e-9),
}
"""Every backend sets its native tolerances from these; "mid" is what limits say where nothing is chosen."""


def with_accuracy(limits: Limits, word: str) -> Limits:
    """Return the limits with the tolerances of a preset; raise `UnknownNameError` naming those that exist.

    Examples
    --------
    >>> with_accuracy(Limits(), "high").tolerance
    1e-09
    """
    if word not in PRESETS:
        raise UnknownNameError("accuracy", word, PRESETS)
    return replace(limits, **vars(PRESETS[word]))


def accuracy_of(limits: Limits) -> str:
    """Return the word of the preset that limits hold; "own" for any other tolerances.

    Examples
    --------
    >>> accuracy_of(Limits()), accuracy_of(Limits(tolerance=1e-4))
    ('mid', 'own')
    """
    for word, preset in PRESETS.items():
        if (limits.tolerance, limits.feasibility) == (preset.tolerance, preset.feasibility):
            return word
    return "own"


def is_accepted(solution: Solution, limits: Limits) -> bool:
    """Tell whether a solution is as exact as asked, by our own measurement whatever its solver reports.

    Accepted is a violation of at most `feasibility` with a bound that certifies it, or, of a stationary point, with a
    stationarity of at most tolerance * max(1, |objective|). A rounded point of integers has no first-order test.
    """
    if not solution.violation <= limits.feasibility:
        return False
    if solution.status is not Status.STATIONARY:
        return solution.status is Status.CERTIFIED
    return solution.stationarity <= limits.tolerance * max(1.0, abs(solution.objective))
