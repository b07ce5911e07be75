"""A backend's answer to a problem: taken as it is, taken through bridges, or refused with a reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from nonrigid.formulations.model import Problem
from nonrigid.solvers.judge import Values


class Claim(Enum):
    """Say what a rewriting preserves."""

    EXACT = "exact"
    LOCAL = "local"
    RELAXATION = "relaxation"
    RESTRICTION = "restriction"


@dataclass(frozen=True, eq=False)
class Rewritten:
    """Hold a rewritten problem and the two ways between its values and those of the problem it came from."""

    problem: Problem
    forward: Callable[[Values], Values]
    inverse: Callable[[Values], Values]


class Bridge(Protocol):
    """Rewrite a problem into one that a backend can take.

    `name` stands in the route of every result; `claim` says what survives: "exact", the same optima; "local", the same
    stationary points; "relaxation", a bound on the right side; "restriction", feasible and not better.
    """

    @property
    def name(self) -> str:
        """Word under which the bridge stands in a route."""

    @property
    def claim(self) -> Claim:
        """What the rewriting preserves."""

    def obstacle(self, problem: Problem) -> str | None:
        """Return why the bridge cannot take this problem; None if it can."""

    def apply(self, problem: Problem) -> Rewritten:
        """Return the rewritten problem."""


@dataclass(frozen=True)
class Native:
    """Say that a backend takes the problem as it stands."""

    def __str__(self) -> str:
        return "native"


@dataclass(frozen=True)
class Via:
    """Say that a backend takes the problem after these bridges, applied left to right."""

    bridges: tuple[Bridge, ...]

    def __str__(self) -> str:
        return "via " + ", ".join(bridge.name for bridge in self.bridges)


@dataclass(frozen=True)
class Refused:
    """Say that a backend cannot take the problem, and why, with the number that decides it."""

    reason: str

    def __str__(self) -> str:
        return f"refused: {self.reason}"


Acceptance = Native | Via | Refused


def via(problem: Problem, *bridges: Bridge) -> Via | Refused:
    """Return the route through these bridges, or the first obstacle on it.

    Each bridge is asked about the problem that the ones before it made.
    """
    current = problem
    for bridge in bridges:
        obstacle = bridge.obstacle(current)
        if obstacle is not None:
            return Refused(f"the {bridge.name} bridge needs {obstacle}")
        current = bridge.apply(current).problem
    return Via(bridges)
