"""Tell, for every problem that a method states, which algorithm of which backend takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.held_out import trained_for
from nonrigid.benchmark.methods import make_method, methods
from nonrigid.formulations.formulation import Formulation, Pair
from nonrigid.formulations.model import Problem
from nonrigid.solvers.acceptance import Native, Via
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.solve import solve

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
                    "method": name,
                    "problem": stage,
                    "backend": row.backend,
                    "algorithm": row.algorithm,
                    "variables": _size(problem),
                    "answer": str(row.acceptance),
                    "accepted": isinstance(row.acceptance, Native | Via),
                    "small_variables": None if few is None else _size(few),
                    "small_answer": answers.get((row.backend, row.algorithm)),
                }
                for row in route(problem)
            ]
    return rows


def stated_problems(pair: Pair, formulation: Formulation) -> dict[str, Problem]:
    """Return the first problem of each name that a formulation states for a pair, each solved natively."""
    found: dict[str, Problem] = {}
    stages = formulation.stages(pair)
    try:
        problem = next(stages)
        while True:
            found.setdefault(problem.name, problem)
            solution = solve(problem, limits=Limits(seconds=5.0))
            if not solution.status.usable:
                break
            problem = stages.send(solution)
    except StopIteration:
        pass
    return found


def _fewer(formulation: Formulation) -> dict[str, object]:
    counts = {f.name: getattr(formulation, f.name) for f in fields(formulation)}  # type: ignore[arg-type]
    many = {name: n for name, n in counts.items() if isinstance(n, int) and not isinstance(n, bool) and n >= MANY}
    return {name: max(4, n // MANY) for name, n in many.items()}


def _size(problem: Problem) -> int:
    return sum(variable.size for variable in problem.variables)
