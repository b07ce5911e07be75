"""Solve a problem with a backend, a chain of backends, or from several starts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.backend import Backend, make_backend, resolved
from nonrigid.solvers.isolation import run_isolated
from nonrigid.solvers.judge import Values
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.once import solve_once
from nonrigid.solvers.solution import Attempt, Solution
from nonrigid.solvers.status import Status


def solve(
    problem: Problem,
    backend: str | Backend | Sequence[str | Backend] = "native",
    *,
    start: Values | Solution | None = None,
    starts: int = 1,
    seed: int = 0,
    limits: Limits | None = None,
) -> Solution:
    """Solve a problem and measure the answer.

    Parameters
    ----------
    problem
        What to solve; see `nonrigid.formulations.model`.
    backend
        A word such as "nlopt" or "nlopt:LD_CCSAQ", a `Backend`, or a sequence of them: a chain, tried in order until
        one answers with a certified or stationary point. The best point of all attempts is returned, every attempt
        recorded.
    start
        Values, or a `Solution` to continue from; by default the problem's own start, and the point of each set that
        prefers no entry for the variables of which it says nothing.
    starts
        Number of starts: the one above, then random points of the sets. The best answer is returned.
    seed
        Seed of the random starts.
    limits
        Bounds on each attempt; where the problem asks for fewer evaluations, these are the bound.

    Raises
    ------
    UnknownNameError
        If a backend or algorithm does not exist. A backend that cannot take the problem gives a refused `Solution`.
    InputError
        If a start has the wrong names or shapes, or entries that are not finite; or `starts` or `seed` is too small.

    Examples
    --------
    >>> from nonrigid.formulations.model import QuadraticForm, Simplex, Variable, maximize
    >>> u = Variable("u", 3)
    >>> A = np.array([[0.0, 1.0, 0.1], [1.0, 0.0, 0.1], [0.1, 0.1, 0.0]])
    >>> answer = solve(Problem("game", maximize(QuadraticForm(A)(u)), u @ Simplex()))
    >>> answer.status.value, round(answer.objective, 4), answer["u"].round(3)
    ('stationary', 0.5, array([0.5, 0.5, 0. ]))
    """
    limits = _granted(problem, Limits() if limits is None else limits)
    chain = [backend] if isinstance(backend, str) or not isinstance(backend, Iterable) else list(backend)
    if not chain:
        raise InputError("the chain of backends is empty", remedy="name at least one, such as 'native'")
    if starts < 1:
        raise InputError(f"starts is {starts}", remedy="ask for at least one start")
    if seed < 0:
        raise InputError(f"seed is {seed}", remedy="give a number of at least 0")
    backends = [resolved(make_backend(spec), problem) for spec in chain]
    answers: list[Solution] = []
    for chosen in backends:
        found = [_attempt(problem, chosen, point, limits) for point in _starts(problem, start, starts, seed)]
        answers += found
        if any(answer.status in (Status.CERTIFIED, Status.STATIONARY) for answer in found):
            break
    best = max(answers, key=_merit)
    return best if len(answers) == 1 else replace(best, attempts=tuple(_as_attempt(answer) for answer in answers))


def _attempt(problem: Problem, backend: Backend, start: Values, limits: Limits) -> Solution:
    if limits.hard_seconds is None and limits.memory_gb is None:
        return solve_once(problem, backend, start, limits)
    return run_isolated(problem, backend, start, limits)


def _granted(problem: Problem, limits: Limits) -> Limits:
    asked = [count for count in (problem.evaluations, limits.evaluations) if count is not None]
    return replace(limits, evaluations=min(asked, default=None))


def _starts(problem: Problem, start: Values | Solution | None, count: int, seed: int) -> list[Values]:
    given = start.values if isinstance(start, Solution) else start
    shapes = {member.variable.name: member.variable.shape for member in problem.memberships}
    if given is None:
        centers = {m.variable.name: m.set.center(m.variable.shape) for m in problem.memberships}
        first: Values = {**centers, **problem.start}
    else:
        if {name: np.shape(value) for name, value in given.items()} != shapes:
            shown = {name: np.shape(value) for name, value in given.items()}
            raise InputError(f"the start has shapes {shown}", remedy=f"the problem's variables have {shapes}")
        for name, value in given.items():
            if wrong := int(np.sum(~np.isfinite(value))):
                raise InputError(f"the start has {wrong} entries of {name!r} that are not finite", remedy="repair them")
        first = given
    rng = np.random.default_rng(seed)
    others: list[Values] = [
        {m.variable.name: m.set.sample(m.variable.shape, rng) for m in problem.memberships} for _ in range(count - 1)
    ]
    return [first, *others]


def _merit(answer: Solution) -> tuple[bool, bool, float]:
    """Return what the better answer has more of: a proof comes before what lies within its tolerance."""
    sign = 1.0 if answer.sense is Sense.MAXIMIZE else -1.0
    worth = sign * answer.objective
    return answer.usable, answer.status is Status.CERTIFIED, worth if np.isfinite(worth) else -np.inf


def _as_attempt(answer: Solution) -> Attempt:
    return Attempt(answer.spec, answer.status, answer.objective, answer.solve_seconds, answer.message)
