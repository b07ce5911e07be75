"""What a solve returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from nonrigid.formulations.model import Sense
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.status import Status

ROUNDING = 1e-9
"""Part of max(1, |objective|) by which an objective may exceed a valid bound."""


@dataclass(frozen=True)
class TracePoint:
    """Hold what was known after some work: the objective of the restored point, in the user's own sense."""

    seconds: float
    evaluations: float
    objective: float
    violation: float


@dataclass(frozen=True)
class Bound:
    """Hold a proved bound on the optimum of a problem.

    `value` bounds the objective from above when it is maximized, from below when it is minimized.
    """

    value: float
    method: str
    seconds: float
    detail: str = ""


@dataclass(frozen=True)
class Attempt:
    """Hold one attempt of a fallback chain or multistart: which backend, what became of it, at what cost."""

    backend: str
    status: Status
    objective: float
    solve_seconds: float
    message: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Hold the answer of a backend as the package measured it.

    Every number is recomputed by the package on the point restored exactly onto its sets; `raw_status` holds the
    solver's own words, which decide nothing.

    Parameters
    ----------
    values
        Variable name -> array; empty where there is no point.
    objective
        In the user's own sense; NaN where there is no point.
    violation
        Largest violation of a set or constraint by the restored point.
    stationarity
        First-order residual: see `nonrigid.solvers.judge`. 0 at a stationary point.
    build_seconds, solve_seconds
        Wall-clock time to rewrite and hand over the problem, and to solve it; the package's own measurements excluded.
    evaluations
        Evaluations of objective and gradient, columns counted as fractions.
    """

    problem: str
    sense: Sense
    backend: str
    algorithm: str
    status: Status
    message: str
    values: Mapping[str, FloatArray] = field(default_factory=dict)
    objective: float = float("nan")
    violation: float = float("nan")
    stationarity: float = float("nan")
    bound: Bound | None = None
    build_seconds: float = 0.0
    solve_seconds: float = 0.0
    evaluations: float = 0.0
    trace: tuple[TracePoint, ...] = ()
    route: tuple[str, ...] = ()
    claim: str = "exact"
    raw_status: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    attempts: tuple[Attempt, ...] = ()

    def __getitem__(self, name: str) -> FloatArray:
        return self.values[name]

    @property
    def usable(self) -> bool:
        """Whether there is a point, and it lies in its sets: a solve may spend its limit before the first."""
        return self.status.usable and bool(self.values)

    @property
    def gap(self) -> float | None:
        """Distance between the objective and its bound, never negative beyond rounding; None without a bound."""
        if self.bound is None:
            return None
        sign = 1.0 if self.sense is Sense.MAXIMIZE else -1.0
        return sign * (self.bound.value - self.objective)

    @property
    def certificate(self) -> str | None:
        """Name of the method that proved the bound."""
        return None if self.bound is None else self.bound.method

    @property
    def spec(self) -> str:
        """Backend and algorithm as one word, such as nlopt:LD_CCSAQ."""
        return f"{self.backend}:{self.algorithm}"

    def with_bound(self, bound: Bound, tolerance: float = 1e-6) -> Solution:
        """Return the solution with a bound; certified if the gap is at most tolerance * max(1, |objective|).

        A bound that the solution itself exceeds by more than rounding is left out, and the message says so.
        """
        held = replace(self, bound=bound)
        gap, unit = held.gap, max(1.0, abs(self.objective))
        if not self.usable or gap is None:
            return held
        if gap < -ROUNDING * unit:
            refuted = f"the bound {bound.value:.9g} ({bound.method}) is refuted"
            return replace(self, message=f"{self.message}; {refuted}")
        if gap <= tolerance * unit:
            return replace(held, status=Status.CERTIFIED, message=f"{bound.method} proves a gap of {gap:.2g}")
        return held

    def __str__(self) -> str:
        gap = f", gap {self.gap:.2g} ({self.certificate})" if self.gap is not None else ""
        return (
            f"{self.problem} by {self.spec}: {self.status.value}, objective {self.objective:.9g}{gap}, stationarity "
            f"{self.stationarity:.1e}, {self.evaluations:.4g} evaluations, {self.solve_seconds:.3g} s: {self.message}"
        )
