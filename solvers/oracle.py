"""The one door through which a backend sees a problem: it counts, times, judges, traces and stops."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import NonrigidError
from nonrigid.solvers.judge import Values, restore, violation
from nonrigid.solvers.layout import FlatConstraint, Layout
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import TracePoint


class LimitReached(NonrigidError):  # noqa: N818 - a signal, not a fault
    """Stop a backend from inside its evaluation: a limit of `Limits` is spent."""


class NotFiniteError(NonrigidError, ArithmeticError):
    """Stop a backend from inside its evaluation: a value or gradient is not finite."""


class Oracle:
    """Serve a problem to a backend as functions of one flat vector, in the sense of minimization.

    Every evaluation is counted and timed; the evaluated point is restored onto the user's own problem and kept if it
    is the best so far; limits end the solve by raising `LimitReached`, which a backend need not catch. The time that
    the package spends on its own measurements is not charged to the solver.

    Parameters
    ----------
    problem
        The problem as the backend sees it, bridges applied.
    original
        The user's problem, on which points are judged; the same where there is no bridge.
    inverse
        Brings values of `problem` back to `original`.
    report
        Called with the flat restored point of the user's problem, its objective and the counts, whenever a better one
        is found.
    """

    def __init__(
        self,
        problem: Problem,
        limits: Limits,
        *,
        original: Problem | None = None,
        inverse: Callable[[Values], Values] | None = None,
        report: Callable[[FloatArray, TracePoint], None] | None = None,
    ) -> None:
        self.problem, self.limits = problem, limits
        self.original = problem if original is None else original
        self.layout = Layout(problem)
        self.size = self.layout.size
        self.lower, self.upper = self.layout.bounds()
        self.constraints: tuple[FlatConstraint, ...] = self.layout.constraints()
        self.evaluations = 0.0
        self.trace: list[TracePoint] = []
        self.best: Values | None = None
        self.best_objective = np.nan
        self.build_seconds = 0.0
        self.interrupted: LimitReached | NotFiniteError | None = None
        self.failure: Exception | None = None
        self._sign = 1.0 if problem.objective.sense is Sense.MINIMIZE else -1.0
        self._inverse = inverse
        self._report = report
        self._started = time.perf_counter()
        self._paused = 0.0
        self._next_trace = 0.0

    @property
    def seconds(self) -> float:
        """Wall-clock seconds since the problem was handed over, the package's own measurements excluded."""
        return time.perf_counter() - self._started - self._paused

    def begin(self) -> None:
        """Start the clock; `solve` calls it when it hands the problem to a backend."""
        self._started, self._paused = time.perf_counter(), 0.0

    def built(self) -> None:
        """Say that the library now holds the problem: the time until here was build time, from here it is solve time.

        A backend calls it once it has translated the problem; where it does not, all its time is solve time.
        """
        self.build_seconds += self.seconds
        self._started, self._paused = time.perf_counter(), 0.0

    def count_as_build(self, seconds: float) -> None:
        """Say that so much of the time since `built` was build time as well, in a backend that builds as it goes."""
        self.build_seconds += seconds
        self._paused += seconds

    def value_and_gradient(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return the function to be minimized and its gradient at a flat point.

        Raises `LimitReached` before work that a limit forbids and `NotFiniteError` where the answer is not finite.
        """
        self.charge(1.0)
        point = np.array(x, dtype=float)
        values = self.layout.split(point)
        try:
            value, gradient = self.problem.objective.value_and_gradient(values)
            flat = self.layout.join(gradient)
        except Exception as failure:
            # A term failed, not the library; it may swallow this, so it is kept where `solve` sees it.
            self.failure = failure
            raise
        if not (np.isfinite(value) and np.isfinite(flat).all()):
            self._interrupt(NotFiniteError(f"the objective is {value}, or its gradient not finite, at a point tried"))
        self.observe(point, objective=value)
        return self._sign * value, self._sign * flat

    def hessian_product(self, x: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the Hessian times a direction; counted as an evaluation. All terms must offer `hessian_product`."""
        self.charge(1.0)
        values, along = self.layout.split(np.array(x, float)), self.layout.split(np.array(direction, float))
        total = {name: np.zeros_like(value) for name, value in values.items()}
        for applied in self.problem.objective.terms:
            (variable,) = applied.variables
            term: Any = applied.term
            product = term.hessian_product(values[variable.name], along[variable.name])
            total[variable.name] += self._sign * applied.weight * product
        return self.layout.join(total)

    def hessian(self, x: FloatArray) -> FloatArray:
        """Return the dense Hessian; counted as an evaluation. All terms must offer `hessian`."""
        self.charge(1.0)
        values, places = self.layout.split(np.array(x, float)), self.layout.slices()
        total = np.zeros((self.size, self.size))
        for applied in self.problem.objective.terms:
            (variable,) = applied.variables
            term: Any = applied.term
            place = places[variable.name]
            total[place, place] += self._sign * applied.weight * term.hessian(values[variable.name])
        return total

    def charge(self, evaluations: float) -> None:
        """Count work and raise `LimitReached` if a limit is spent; column methods charge 1/n a column."""
        limits = self.limits
        if limits.evaluations is not None and self.evaluations + evaluations > limits.evaluations + 1e-9:
            self._interrupt(LimitReached(f"{limits.evaluations} evaluations are spent"))
        if limits.seconds is not None and self.seconds > limits.seconds:
            self._interrupt(LimitReached(f"{limits.seconds:g} s are spent"))
        self.evaluations += evaluations

    def observe(self, x: FloatArray, *, objective: float | None = None) -> None:
        """Judge an iterate and keep it if it is the best; backends that do not evaluate at their iterates call it.

        Raises `NotFiniteError` where the objective of the restored point is not finite.
        `objective` may be given, in the user's sense, where it is known at x; it is used only if x needs no restoring.
        """
        begun = time.perf_counter()
        seconds = self.seconds
        values: Values = self.layout.split(np.array(x, dtype=float))
        try:
            values, objective, off = self._restored(values, objective)
        except Exception as failure:
            self.failure = failure
            raise
        better = self.best is None or self._sign * objective < self._sign * self.best_objective
        kept = better and bool(np.isfinite(objective)) and off <= self.limits.feasibility
        if kept:
            self.best, self.best_objective = {name: value.copy() for name, value in values.items()}, objective
        if better or self.evaluations >= self._next_trace:
            point = TracePoint(seconds, self.evaluations, objective, off)
            self._add(point)
            if kept and self._report is not None:
                self._report(Layout(self.original).join(values), point)
        self._paused += time.perf_counter() - begun
        if not np.isfinite(objective):
            self._interrupt(NotFiniteError(f"the objective is {objective} at an iterate restored onto its sets"))

    def _restored(self, values: Values, objective: float | None) -> tuple[Values, float, float]:
        if self._inverse is not None:
            values = self._inverse(values)
        off = violation(self.original, values)
        if off > 1e-12 or objective is None or self._inverse is not None:
            values = restore(self.original, values)
            objective = self.original.objective.value(values)
            off = violation(self.original, values)
        return values, objective, off

    def _interrupt(self, signal: LimitReached | NotFiniteError) -> None:
        # Some libraries swallow exceptions of their callbacks, so the signal is also kept where `solve` sees it.
        self.interrupted = signal
        raise signal

    def _add(self, point: TracePoint) -> None:
        crowded = len(self.trace) > 500 and point.evaluations < 1.02 * self.trace[-2].evaluations
        if crowded:
            self.trace[-1] = point
        else:
            self.trace.append(point)
        self._next_trace = 1.02 * self.evaluations if len(self.trace) > 200 else self.evaluations
