"""Match a pair of surfaces by a formulation, each of its problems solved by the backend of the user's choice."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from nonrigid.formulations.formulation import Correspondence, Formulation, Pair
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.backend import Backend
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.solution import Solution
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

Choice: TypeAlias = str | Backend | Sequence[str | Backend]
ORDER = (
    Status.CERTIFIED,
    Status.STATIONARY,
    Status.FEASIBLE,
    Status.LIMIT,
    Status.INFEASIBLE,
    Status.NUMERICAL_ERROR,
    Status.BACKEND_ERROR,
    Status.REFUSED,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Match:
    """Hold the outcome of a match: the correspondence, and every problem solved on the way.

    Parameters
    ----------
    correspondence
        None where a stage had no usable answer; `message` then says which and why.
    solutions
        One a problem, in the order they were solved.
    formulation_seconds
        Wall-clock time that the formulation itself took: descriptors, distances, read-out.
    """

    correspondence: Correspondence | None
    solutions: tuple[Solution, ...]
    formulation_seconds: float

    @property
    def status(self) -> Status:
        """The weakest status of all stages."""
        return max((solution.status for solution in self.solutions), key=ORDER.index, default=Status.FEASIBLE)

    @property
    def message(self) -> str:
        """What the weakest stage says."""
        weakest = [solution for solution in self.solutions if solution.status is self.status]
        return f"{weakest[0].problem}: {weakest[0].message}" if weakest else "the formulation stated no problem"

    @property
    def build_seconds(self) -> float:
        """Time to hand the problems to their backends."""
        return sum(solution.build_seconds for solution in self.solutions)

    @property
    def solve_seconds(self) -> float:
        """Time that the backends took."""
        return sum(solution.solve_seconds for solution in self.solutions)


def match(
    pair: Pair,
    formulation: Formulation,
    backend: Choice | Mapping[str, Choice] = "native",
    *,
    starts: int = 1,
    seed: int = 0,
    limits: Limits | None = None,
) -> Match:
    """Match a pair of surfaces.

    Parameters
    ----------
    pair
        The surfaces, in one unit.
    formulation
        The method: anything with `stages`.
    backend
        As in `solve`, for every stage; or a mapping from stage (the name of a problem) to backend, native for the
        others.
    starts, seed, limits
        As in `solve`, for every stage.

    Raises
    ------
    InputError
        If the mapping names a stage that the formulation never stated, the formulation has no `stages`, or these end
        without a `Correspondence`.
    UnknownNameError
        If a backend does not exist.
    """
    if not isinstance(formulation, Formulation):
        raise InputError(f"{formulation!r} has no method `stages`", remedy="give a formulation such as GameTheoretic()")
    choices: Mapping[str, Choice] = backend if isinstance(backend, Mapping) else {}
    solutions: list[Solution] = []
    begun = time.perf_counter()
    working = 0.0
    stages = formulation.stages(pair)
    correspondence: Correspondence | None = None
    try:
        problem = next(stages)
        while True:
            chosen = choices.get(problem.name, "native") if isinstance(backend, Mapping) else backend
            before = time.perf_counter()
            solution = solve(problem, chosen, starts=starts, seed=seed, limits=limits)
            working += time.perf_counter() - before
            solutions.append(solution)
            if not solution.usable:
                stages.close()
                break
            problem = stages.send(solution)
    except StopIteration as end:
        correspondence = end.value
        if not isinstance(correspondence, Correspondence):
            raise InputError(
                f"stages of {type(formulation).__name__} ended with {correspondence!r}",
                remedy="return a Correspondence from it",
            ) from None
    stated = {solution.problem for solution in solutions}
    if correspondence is not None and (unknown := sorted(set(choices) - stated)):
        raise InputError(f"no stage is called {unknown[0]!r}", remedy=f"the stages were {sorted(stated)}")
    return Match(
        correspondence=correspondence,
        solutions=tuple(solutions),
        formulation_seconds=time.perf_counter() - begun - working,
    )
