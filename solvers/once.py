"""One backend, one start: hand the problem over, survive what happens, measure what came back."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Bridge, Claim, Refused, Rewritten, Via
from nonrigid.solvers.backend import Backend, Raw
from nonrigid.solvers.judge import Judgement, Values, judge
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import LimitReached, NotFiniteError, Oracle
from nonrigid.solvers.solution import Solution, TracePoint
from nonrigid.solvers.status import Status

Report = Callable[[FloatArray, TracePoint], None]


def solve_once(
    problem: Problem, backend: Backend, start: Values, limits: Limits, report: Report | None = None
) -> Solution:
    """Solve from one start in this process; see `nonrigid.solvers.solve.solve`."""
    begun = time.perf_counter()
    accepted = backend.accepts(problem)
    head = _Head(problem, backend)
    if isinstance(accepted, Refused):
        return head.solution(Status.REFUSED, accepted.reason)
    bridges = accepted.bridges if isinstance(accepted, Via) else ()
    rewritten = _rewrite(problem, bridges)
    oracle = Oracle(
        rewritten.problem,
        limits,
        original=problem,
        inverse=rewritten.inverse if bridges else None,
        report=report,
    )
    flat = oracle.layout.join(rewritten.forward(start))
    before = time.perf_counter() - begun
    raw, failure = _run(backend, oracle, flat, limits)
    seconds, evaluations = oracle.seconds, oracle.evaluations
    judged, error = _measured(problem, rewritten, oracle, raw)
    # A failing term is the cause, what the library then says of it the consequence.
    status, message = _decide(problem, judged, limits, oracle, oracle.failure or failure or error, seconds)
    route, claim = route_and_claim(backend, bridges)
    solution = head.solution(
        status,
        message,
        values={} if judged is None else judged.values,
        objective=float("nan") if judged is None else judged.objective,
        violation=float("nan") if judged is None else judged.violation,
        stationarity=float("nan") if judged is None else judged.stationarity,
        build_seconds=before + oracle.build_seconds,
        solve_seconds=seconds,
        evaluations=evaluations,
        trace=tuple(oracle.trace),
        route=route,
        claim=claim.value,
        raw_status=raw.raw_status if failure is None else _words(failure),
        versions=backend.versions(),
    )
    survives = not any(bridge.claim in (Claim.LOCAL, Claim.RESTRICTION) for bridge in bridges)
    return solution.with_bound(raw.bound) if raw.bound is not None and survives else solution


def route_and_claim(backend: Backend, bridges: tuple[Bridge, ...]) -> tuple[tuple[str, ...], Claim]:
    """Return the names of the bridges and of the backend, and what the bridges leave of an answer's claim."""
    claims = [bridge.claim for bridge in bridges if bridge.claim is not Claim.EXACT]
    names = (*(bridge.name for bridge in bridges), f"{backend.name}:{backend.algorithm}")
    return names, claims[0] if claims else Claim.EXACT


class _Head:
    """Hold what every solution of one attempt has in common."""

    def __init__(self, problem: Problem, backend: Backend) -> None:
        self.problem, self.backend = problem, backend

    def solution(self, status: Status, message: str, **measured: object) -> Solution:
        return Solution(
            problem=self.problem.name,
            sense=self.problem.objective.sense,
            backend=self.backend.name,
            algorithm=self.backend.algorithm,
            status=status,
            message=message,
            **measured,  # type: ignore[arg-type]
        )


def _rewrite(problem: Problem, bridges: tuple[Bridge, ...]) -> Rewritten:
    steps = []
    current = problem
    for bridge in bridges:
        step = bridge.apply(current)
        steps.append(step)
        current = step.problem

    def forward(values: Values) -> Values:
        for step in steps:
            values = step.forward(values)
        return values

    def inverse(values: Values) -> Values:
        for step in reversed(steps):
            values = step.inverse(values)
        return values

    return Rewritten(current, forward, inverse)


def _run(backend: Backend, oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[Raw, Exception | None]:
    oracle.begin()
    try:
        raw = backend.run(oracle, start, limits)
        if not isinstance(raw, Raw):
            raise TypeError(f"run of {backend.name} returned a {type(raw).__name__}, not a Raw")
        return raw, None
    except (LimitReached, NotFiniteError):
        return Raw(None, "stopped from inside an evaluation"), None
    except Exception as failure:  # any library may raise anything: the attempt fails, not the caller
        return Raw(None, ""), failure


def _measured(
    problem: Problem, rewritten: Rewritten, oracle: Oracle, raw: Raw
) -> tuple[Judgement | None, Exception | None]:
    """Judge the last point and the best one seen, and return the better, if any, and what failed on the way."""
    found: list[Judgement] = []
    failure: Exception | None = None
    for point in (oracle.best, raw.x):
        if point is None:
            continue
        try:  # a term may fail here that had not been evaluated before, by a solver that reads the matrix itself
            found.append(judge(problem, point if point is oracle.best else _returned(raw.x, oracle, rewritten)))
        except NotFiniteError as error:
            oracle.interrupted = oracle.interrupted or error
        except Exception as error:
            failure = error
    finite = [judged for judged in found if np.isfinite(judged.objective)]
    if not finite:
        if found:
            oracle.interrupted = oracle.interrupted or NotFiniteError(f"the objective is {found[-1].objective}")
        return None, failure
    sign = 1.0 if problem.objective.sense is Sense.MINIMIZE else -1.0
    # The last point is preferred to one seen on the way that is better by less than what was asked for: it is the more
    # stationary of the two.
    final, first, allowed = finite[-1], finite[0], oracle.limits.feasibility
    margin = oracle.limits.tolerance * max(1.0, abs(final.objective))
    if first.violation <= allowed:
        worse = final.violation > allowed or sign * first.objective < sign * final.objective - margin
        return (first if worse else final), failure
    return final, failure


def _returned(x: FloatArray | None, oracle: Oracle, rewritten: Rewritten) -> Values:
    last = np.asarray(x, dtype=float)
    if last.shape != (oracle.size,):
        raise ValueError(f"the backend returned a point of shape {last.shape}, not {(oracle.size,)}")
    if not np.isfinite(last).all():
        raise NotFiniteError("the point returned has entries that are not finite")
    return rewritten.inverse(oracle.layout.split(last))


def _decide(
    problem: Problem,
    judged: Judgement | None,
    limits: Limits,
    oracle: Oracle,
    failure: Exception | None,
    seconds: float,
) -> tuple[Status, str]:
    stop = oracle.interrupted
    if stop is None and limits.seconds is not None and seconds >= limits.seconds:
        stop = LimitReached(f"{limits.seconds:g} s are spent")  # by the library's own clock, which says so in its words
    if judged is None:
        if isinstance(stop, NotFiniteError):
            return Status.NUMERICAL_ERROR, f"{stop}; {Status.NUMERICAL_ERROR.advice}"
        if isinstance(stop, LimitReached):
            return Status.LIMIT, f"{stop} before the first point; raise the limit, or choose a faster backend"
        words = "no point was returned" if failure is None else _words(failure)
        return Status.BACKEND_ERROR, f"{words}; {Status.BACKEND_ERROR.advice}"
    if judged.violation > limits.feasibility:
        return Status.INFEASIBLE, f"violation {judged.violation:.2g}; {Status.INFEASIBLE.advice}"
    if not _has_integers(problem) and judged.stationarity <= limits.tolerance * max(1.0, abs(judged.objective)):
        return Status.STATIONARY, Status.STATIONARY.advice
    if isinstance(stop, NotFiniteError):
        return Status.NUMERICAL_ERROR, f"{stop}; {Status.NUMERICAL_ERROR.advice}"
    if isinstance(stop, LimitReached):
        return Status.LIMIT, f"{stop}; {Status.LIMIT.advice}"
    if _has_integers(problem):  # the rounded point is an answer even where the relaxation's own solve ended badly
        words = "" if failure is None else f"{_words(failure)}; "
        return Status.FEASIBLE, f"{words}integers have no first-order test: ask for a bound, or a backend that branches"
    if failure is not None:
        return Status.BACKEND_ERROR, f"{_words(failure)}; {Status.BACKEND_ERROR.advice}"
    return Status.FEASIBLE, f"stationarity {judged.stationarity:.2g}; {Status.FEASIBLE.advice}"


def _has_integers(problem: Problem) -> bool:
    return any(integral_entries(m.set, m.variable.shape).any() for m in problem.memberships)


def _words(failure: Exception) -> str:
    return f"{type(failure).__name__}: {failure}"
