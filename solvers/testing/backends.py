"""The contract of a backend, checked on small problems with proved optima, each solve in a child process."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applied, Objective, Problem, Sense
from nonrigid.solvers.acceptance import Claim, Native, Refused, Via
from nonrigid.solvers.backend import Backend, make_backend, resolved
from nonrigid.solvers.isolation import run_isolated
from nonrigid.solvers.judge import Values, violation
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import Solution
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing.bridges import check_bridge
from nonrigid.solvers.testing.errors import ConformanceError, distance, expect
from nonrigid.solvers.testing.faulty_terms import Failing, NotANumber, Slow
from nonrigid.solvers.testing.instances import Instance, instances

_BUDGET = Limits(evaluations=500, seconds=20.0, hard_seconds=40.0)


def check_backend(
    backend: str | Backend,
    *,
    problems: Iterable[Instance] | None = None,
    accuracy: float = 1e-3,
    limits: Limits | None = None,
    rng_seed: int = 0,
) -> tuple[str, ...]:
    """Check that a backend keeps its contract, on every small problem that it accepts.

    It is a frozen dataclass with names and versions; refusals give a reason; nothing that it accepts is left unsolved:
    where every stationary point is optimal the answer meets the proved optimum (or, at a limit, has come half of the
    way or to 5 %; it is given 20 times the evaluations for it), and nowhere beats it; statuses claim no more than is
    measured; the claim of its bridges holds; a start is never left for a worse point; the same start gives the same
    answer; limits of evaluations and seconds hold; a NaN of the problem ends as `numerical_error`; an exception of the
    problem ends as `backend_error` with its words. Solves run in child processes, so that a crash or a hang is a
    finding too.

    Parameters
    ----------
    backend
        A word such as "nlopt:LD_CCSAQ", or an instance.
    problems
        Instances to try; `nonrigid.solvers.testing.instances` by default.
    accuracy
        Largest distance to a proved optimum, relative to max(1, |optimum|).
    limits
        Bounds on each solve; `hard_seconds` must be given.
    rng_seed
        Seed of the random starts.

    Returns
    -------
    The names of the instances that the backend accepted.

    Raises
    ------
    ConformanceError
        At the first broken promise: what was expected, what was found, where to look.

    Examples
    --------
    >>> check_backend("native:replicator")
    ('planted game',)
    """
    made = make_backend(backend)
    budget = _BUDGET if limits is None else limits
    _check_description(made)
    rng, accepted, ways = np.random.default_rng(rng_seed), [], set()
    for instance in instances() if problems is None else problems:
        chosen = resolved(made, instance.problem)
        name = f"{chosen.name}:{chosen.algorithm} on {instance.problem.name!r}"
        way = _accepted(name, chosen, instance)
        if way is None:
            continue
        accepted.append(instance.problem.name)
        _check_answer(name, chosen, instance, budget, accuracy, rng)
        if way not in ways:  # once a route is enough: these do not depend on the problem
            ways.add(way)
            _check_repeatable(name, chosen, instance.problem, budget)
            _check_limits(name, chosen, instance.problem, budget)
            _check_faults(name, chosen, instance.problem, budget)
    return tuple(accepted)


def _check_description(backend: Any) -> None:
    name = type(backend).__name__
    frozen = is_dataclass(backend) and vars(type(backend))["__dataclass_params__"].frozen
    expect(frozen, name, expected="a frozen dataclass", found="another class", look="the class's decorator")
    for member in ("name", "algorithms", "algorithm", "default_algorithm", "accepts", "run", "versions"):
        expect(hasattr(backend, member), name, expected=f"a member {member!r}", found="none", look="solvers.backend")
    known = backend.algorithms
    expect(known, name, expected="at least one algorithm", found=known, look=f"{name}.algorithms")
    versions = backend.versions()
    expect(
        versions and all(isinstance(text, str) and text for item in versions.items() for text in item),
        name,
        expected="names and versions of its libraries",
        found=versions,
        look=f"{name}.versions",
    )


def _accepted(name: str, backend: Backend, instance: Instance) -> str | None:
    """Return the route as a word, None for a refusal."""
    problem, point = instance.problem, instance.values
    expect(
        backend.algorithm in backend.algorithms,
        name,
        expected=f"an algorithm of {backend.algorithms}",
        found=repr(backend.algorithm),
        look="default_algorithm",
    )
    try:
        answer = backend.accepts(problem)
    except Exception as failure:
        words = f"{type(failure).__name__}: {failure}"
        raise ConformanceError(name, expected="an answer to every problem", found=words, look="accepts") from failure
    expect(
        isinstance(answer, Native | Via | Refused),
        name,
        expected="Native, Via or Refused",
        found=repr(answer),
        look="accepts",
    )
    if isinstance(answer, Refused):
        expect(len(answer.reason.split()) >= 3, name, expected="a reason", found=repr(answer.reason), look="accepts")
        return None
    current = problem
    for bridge in answer.bridges if isinstance(answer, Via) else ():
        check_bridge(bridge, current, optimum=point)
        rewritten = bridge.apply(current)
        current, point = rewritten.problem, rewritten.forward(point)
    return str(answer)


def _check_answer(
    name: str, backend: Backend, instance: Instance, limits: Limits, accuracy: float, rng: np.random.Generator
) -> None:
    problem, look = instance.problem, f"{type(backend).__name__}.run"
    answer = _solved(problem, backend, _center(problem), limits)
    if answer.status is Status.LIMIT and limits.evaluations is not None and instance.unimodal:
        answer = _solved(problem, backend, _center(problem), replace(limits, evaluations=20 * limits.evaluations))
    _check_honest(name, backend, problem, answer, limits)
    expect(answer.status.usable and answer.values, name, expected="an answer, as it accepts", found=answer, look=look)
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    short = sign * (instance.optimum - answer.objective) / max(1.0, abs(instance.optimum))
    expect(
        short >= -1e-6,
        name,
        expected=f"no better than the proved optimum {instance.optimum:.9g} ({instance.certificate})",
        found=f"{answer.objective:.9g}",
        look="the problem's sets, or the certificate of the instance",
    )
    begun = sign * (instance.optimum - problem.objective.value(_center(problem))) / max(1.0, abs(instance.optimum))
    spent = answer.status is Status.LIMIT and short <= max(0.5 * begun, 0.05)  # slow is no fault, astray is
    expect(
        short <= accuracy or spent or not instance.unimodal,
        name,
        expected=f"the optimum {instance.optimum:.9g} ({instance.certificate}), or a refusal",
        found=f"{answer.objective:.9g}, status {answer.status.value}, raw status {answer.raw_status!r}",
        look=look,
    )
    for given in (_random(problem, rng), dict(instance.values)):
        continued = _solved(problem, backend, given, limits)
        _check_honest(name, backend, problem, continued, limits)
        if violation(problem, given) > limits.feasibility:  # a start outside the named constraints promises nothing
            continue
        lost = sign * (problem.objective.value(given) - continued.objective)
        expect(
            lost <= accuracy * max(1.0, abs(instance.optimum)),
            name,
            expected=f"no worse than its start, {problem.objective.value(given):.9g}",
            found=f"{continued.objective:.9g}, status {continued.status.value}, raw status {continued.raw_status!r}",
            look=f"{look}: the start",
        )


def _check_repeatable(name: str, backend: Backend, problem: Problem, limits: Limits) -> None:
    one, two = (_solved(problem, backend, _center(problem), limits) for _ in range(2))
    apart = max((distance(one[key], two.values.get(key, np.empty(0))) for key in one.values), default=0.0)
    look = f"{type(backend).__name__}.run: its seed"
    expect(apart == 0.0, name, expected="the same answer from the same start", found=f"{apart:.3g} apart", look=look)


def _check_honest(name: str, backend: Backend, problem: Problem, answer: Solution, limits: Limits) -> None:
    expect(
        answer.status is not Status.BACKEND_ERROR and answer.status is not Status.NUMERICAL_ERROR,
        name,
        expected="a solve without error",
        found=f"{answer.status.value}: {answer.message}",
        look="run",
    )
    expect(
        "killed" not in answer.raw_status,
        name,
        expected=f"an end within {limits.seconds} s",
        found=answer.raw_status,
        look="run: check the clock between evaluations, or give the library the time left",
    )
    if not answer.values:
        return
    off, value = violation(problem, answer.values), problem.objective.value(answer.values)
    expect(
        abs(value - answer.objective) <= 1e-9 * max(1.0, abs(value)),
        name,
        expected=f"the objective {value:.12g} of its point",
        found=answer.objective,
        look="solvers.once",
    )
    claims = answer.status.usable
    expect(
        not claims or off <= limits.feasibility,
        name,
        expected=f"a feasible point with status {answer.status.value}",
        found=f"violation {off:.3g}",
        look="solvers.once",
    )
    accepted = backend.accepts(problem)
    bridges = accepted.bridges if isinstance(accepted, Via) else ()
    weaker = [bridge.claim.value for bridge in bridges if bridge.claim is not Claim.EXACT] or [Claim.EXACT.value]
    expect(answer.claim in weaker, name, expected=f"a claim of {weaker}", found=repr(answer.claim), look="bridges")
    taken = tuple(bridge.name for bridge in bridges)
    expect(answer.route[:-1] == taken, name, expected=f"the route {taken}", found=answer.route, look="accepts")


def _check_limits(name: str, backend: Backend, problem: Problem, limits: Limits) -> None:
    few = _solved(problem, backend, _center(problem), replace(limits, evaluations=3))
    _check_spent(name, few, "evaluations", few.evaluations, 3.0)
    begun = time.perf_counter()
    slow = _wrapped(problem, Slow)
    short = _solved(slow, backend, _center(problem), replace(limits, seconds=0.1, tolerance=1e-14))
    _check_spent(name, short, "seconds", time.perf_counter() - begun, 10.0)


def _check_spent(name: str, answer: Solution, limit: str, spent: float, allowed: float) -> None:
    expect(
        spent <= allowed + 1e-6 and answer.status is not Status.BACKEND_ERROR and "killed" not in answer.raw_status,
        name,
        expected=f"the limit of {limit} kept ({allowed:g})",
        found=f"{spent:.4g}, status {answer.status.value}: {answer.message}",
        look="run: let LimitReached end the solve",
    )


def _check_faults(name: str, backend: Backend, problem: Problem, limits: Limits) -> None:
    for fault, expected in ((NotANumber, Status.NUMERICAL_ERROR), (Failing, Status.BACKEND_ERROR)):
        broken = _wrapped(problem, fault)
        if isinstance(backend.accepts(broken), Refused):
            continue
        answer = _solved(broken, backend, _center(problem), limits)
        expect(
            answer.status is expected and (fault is NotANumber or Failing.words in answer.message),
            name,
            expected=f"status {expected.value} of a problem that is {fault.__name__}, with its words",
            found=f"{answer.status.value}: {answer.message}",
            look="run: let exceptions of evaluations end the solve",
        )


def _wrapped(problem: Problem, kind: Any) -> Problem:
    terms = tuple(Applied(kind.around(item.term), item.variables, item.weight) for item in problem.objective.terms)
    objective = Objective(problem.objective.sense, terms, problem.objective.constant)
    return Problem(problem.name, objective, *problem.memberships, constraints=problem.constraints)


def _solved(problem: Problem, backend: Backend, start: Values, limits: Limits) -> Solution:
    try:
        return run_isolated(problem, backend, start, limits)
    except Exception as failure:
        raise ConformanceError(
            f"{backend.name}:{backend.algorithm} on {problem.name!r}",
            expected="a Solution, whatever happens",
            found=f"{type(failure).__name__}: {failure}",
            look="accepts and versions",
        ) from failure


def _center(problem: Problem) -> dict[str, Any]:
    return {m.variable.name: m.set.center(m.variable.shape) for m in problem.memberships}


def _random(problem: Problem, rng: np.random.Generator) -> dict[str, Any]:
    for _ in range(200):
        values = {m.variable.name: m.set.sample(m.variable.shape, rng) for m in problem.memberships}
        if violation(problem, values) <= 1e-7:
            break
    return values
