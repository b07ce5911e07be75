"""The matrix of problems and backends: who takes what, how, and why not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from nonrigid.formulations.model import Problem
from nonrigid.solvers.acceptance import Acceptance
from nonrigid.solvers.backend import backend_class, backend_names


@dataclass(frozen=True)
class Route:
    """Hold one cell of the matrix."""

    problem: str
    backend: str
    algorithm: str
    acceptance: Acceptance


def route(problem: Problem, backends: Iterable[str] | None = None) -> tuple[Route, ...]:
    """Return how each algorithm of each backend takes a problem: natively, via which bridges, or refused and why.

    Examples
    --------
    >>> import numpy as np
    >>> from nonrigid.formulations.model import QuadraticForm, Simplex, Variable, maximize
    >>> u = Variable("u", 3)
    >>> game = Problem("game", maximize(QuadraticForm(np.ones((3, 3)))(u)), u @ Simplex())
    >>> [str(row.acceptance) for row in route(game, ["native"]) if row.algorithm == "replicator"]
    ['native']
    """
    names = backend_names() if backends is None else tuple(backends)
    rows = []
    for name in names:
        kind = backend_class(name)
        for algorithm in kind.algorithms:
            backend = replace(kind(), algorithm=algorithm)
            rows.append(Route(problem.name, name, algorithm, backend.accepts(problem)))
    return tuple(rows)
