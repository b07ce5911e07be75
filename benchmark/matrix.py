"""Tell, for every problem that a method states, which algorithm of which backend takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.held_out import trained_for
from nonrigid.benchmark.methods import make_method, methods
from nonrigid.formulations.formulation import Formulation, Pair
from nonrigid.formulations.model import Problem
from nonrigid.solvers.acceptance import Acceptance, Claim, Native, Refused, Via
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.solve import solve

REQUIRED = {
    "gt": ("gt", "game"),
    "en": ("en", "elastic-net"),
    "im-sparse": ("im", "sparse"),
    "im-extension": ("im", "extension"),
    "pfm-C": ("pfm", "C"),
    "pfm-v": ("pfm", "v"),
    "rf-lowpass": ("rf", "low-pass"),
}
"""Problems that every general backend must have a route for: a word, the method and its stage."""

GENERAL = ("nlopt", "casadi", "cvxpy")
"""Backends that must have a route for each of `REQUIRED`."""

MANY = 50
"""Whole-number settings from here on count samples, and are divided by this for the small instance."""


def solver_matrix(
    names: Sequence[str] | None = None, settings: Mapping[str, object] | None = None
) -> list[dict[str, object]]:
    """Return a row for each method, stage, backend and algorithm, on a small instance and on one of the usual size.

    Refusals can depend on the number of variables. The instances are those of a built-in creature; in the small one
    every setting that counts many samples is divided by `MANY`.

    Raises
    ------
    UnknownNameError
        If a name is no method.
    """
    specs = Creatures().pairs()
    chosen = next(spec for spec in specs if spec.split == "holes")
    data = chosen.load()
    pair = Pair.of(data.part, data.full)
    rows: list[dict[str, object]] = []
    for name in methods() if names is None else names:
        made = make_method(name, settings)
        usual = trained_for(made, chosen, specs)
        small = stated_problems(
            pair, trained_for(make_method(name, {**(settings or {}), **_fewer(made)}), chosen, specs)
        )
        for stage, problem in stated_problems(pair, usual).items():
            few = small.get(stage)
            answers = {} if few is None else {(r.backend, r.algorithm): str(r.acceptance) for r in route(few)}
            rows += [
                {
                    "cell": _cell(name, stage),
                    "method": name,
                    "problem": stage,
                    "backend": row.backend,
                    "algorithm": row.algorithm,
                    "variables": _size(problem),
                    "answer": str(row.acceptance),
                    "accepted": isinstance(row.acceptance, Native | Via),
                    "claim": _claim(row.acceptance),
                    "small_variables": None if few is None else _size(few),
                    "small_answer": answers.get((row.backend, row.algorithm)),
                }
                for row in route(problem)
            ]
    return rows


def empty_cells(rows: Sequence[Mapping[str, object]]) -> tuple[tuple[str, str], ...]:
    """Return the required (problem, backend) for which no algorithm takes the problem at its usual size.

    Examples
    --------
    >>> empty_cells([{"cell": "gt", "backend": "nlopt", "accepted": True}])[:2]
    (('gt', 'casadi'), ('gt', 'cvxpy'))
    """
    filled = {(row["cell"], row["backend"]) for row in rows if row["accepted"]}
    return tuple((cell, backend) for cell in REQUIRED for backend in GENERAL if (cell, backend) not in filled)


def stated_problems(pair: Pair, formulation: Formulation) -> dict[str, Problem]:
    """Return the first problem of each name that a formulation states for a pair, each solved natively."""
    found: dict[str, Problem] = {}
    stages = formulation.stages(pair)
    try:
        problem = next(stages)
        while True:
            found.setdefault(problem.name, problem)
            solution = solve(problem, limits=Limits(seconds=5.0))
            if not solution.usable:
                break
            problem = stages.send(solution)
    except StopIteration:
        pass
    return found


def _cell(method: str, stage: str) -> str:
    """Return the word of a required problem, of any other its method and stage."""
    return next((cell for cell, place in REQUIRED.items() if place == (method, stage)), f"{method}-{stage}")


def _claim(acceptance: Acceptance) -> str | None:
    """Return the weakest claim along a route, None for a refusal."""
    if isinstance(acceptance, Refused):
        return None
    bridges = acceptance.bridges if isinstance(acceptance, Via) else ()
    return next((b.claim.value for b in bridges if b.claim is not Claim.EXACT), Claim.EXACT.value)


def _fewer(formulation: Formulation) -> dict[str, object]:
    counts = {f.name: getattr(formulation, f.name) for f in fields(formulation)}  # type: ignore[arg-type]
    many = {name: n for name, n in counts.items() if isinstance(n, int) and not isinstance(n, bool) and n >= MANY}
    return {name: max(4, n // MANY) for name, n in many.items()}


def _size(problem: Problem) -> int:
    return sum(variable.size for variable in problem.variables)
