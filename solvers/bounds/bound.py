"""Ask for a proved bound on the optimum of a problem."""

from __future__ import annotations

import importlib
import pkgutil
import time
from dataclasses import replace
from functools import cache
from typing import Protocol

from nonrigid.formulations.model import Problem, Sense
from nonrigid.geometry.errors import InputError, NonrigidError, UnknownNameError
from nonrigid.solvers import bounds as builtin
from nonrigid.solvers.solution import Bound


class BoundError(NonrigidError, ValueError):
    """Report that a method cannot bound a problem: why, and which can."""


class Certificate(Protocol):
    """Prove a bound; a module of `nonrigid.solvers.bounds` offers one under the name CERTIFICATE.

    The bound must hold whatever the solver inside it did: an interrupted or inexact run gives a looser bound, never a
    wrong one.
    """

    @property
    def reach(self) -> int:
        """Largest number of unknowns for which "auto" tries it; 0 for never."""

    def obstacle(self, problem: Problem) -> str | None:
        """Return what the method needs and the problem lacks; None where it applies."""

    def prove(self, problem: Problem, seconds: float) -> Bound:
        """Return a bound within about the given wall-clock time."""


def bound(problem: Problem, method: str = "auto", *, seconds: float = 60.0) -> Bound:
    """Prove a bound on the optimum: from above where the problem maximizes, from below where it minimizes.

    Parameters
    ----------
    problem
        What to bound.
    method
        A name of `bound_methods()`, or "auto": every method within its reach, cheapest first; the tightest is returned.
    seconds
        Wall-clock time for it; the best bound proved by then is returned.

    Raises
    ------
    BoundError
        If the method cannot take the problem; the reason names what can.
    UnknownNameError
        If there is no such method.

    Examples
    --------
    >>> import numpy as np
    >>> from nonrigid.formulations.model import QuadraticForm, Simplex, Variable, maximize
    >>> u = Variable("u", 3)
    >>> game = Problem("game", maximize(QuadraticForm(np.ones((3, 3)) - np.eye(3))(u)), u @ Simplex())
    >>> round(bound(game, "clique").value, 6)
    0.666667
    """
    if not seconds > 0:
        raise InputError(f"seconds is {seconds}", remedy="give a positive number")
    known = _certificates()
    if method != "auto" and method not in known:
        raise UnknownNameError("bound", method, (*known, "auto"))
    obstacles = {name: certificate.obstacle(problem) for name, certificate in known.items()}
    if method != "auto":
        if obstacles[method] is not None:
            raise BoundError(f"the bound {method} needs {obstacles[method]}; {_able(obstacles)}")
        return known[method].prove(problem, seconds)
    size = sum(variable.size for variable in problem.variables)
    chosen = [name for name in known if obstacles[name] is None and size <= known[name].reach]
    if not chosen:
        reasons = "; ".join(f"{name} needs {why}" for name, why in obstacles.items() if why is not None)
        raise BoundError(f"no bound is automatic for problem {problem.name!r} of {size} unknowns: {reasons}")
    return _tightest(problem, [known[name] for name in sorted(chosen, key=lambda name: -known[name].reach)], seconds)


def bound_methods() -> tuple[str, ...]:
    """Return the names of all bounds."""
    return tuple(_certificates())


@cache
def _certificates() -> dict[str, Certificate]:
    found = {}
    for entry in pkgutil.iter_modules(builtin.__path__):
        module = importlib.import_module(f"{builtin.__name__}.{entry.name}")
        if hasattr(module, "CERTIFICATE"):
            found[entry.name] = module.CERTIFICATE
    return found


def _tightest(problem: Problem, certificates: list[Certificate], seconds: float) -> Bound:
    begun = time.perf_counter()
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    best: Bound | None = None
    for certificate in certificates:
        left = seconds - (time.perf_counter() - begun)
        if best is not None and left <= 0:
            break
        found = certificate.prove(problem, left)
        if best is None or sign * found.value < sign * best.value:
            best = found
    assert best is not None
    return replace(best, seconds=time.perf_counter() - begun)


def _able(obstacles: dict[str, str | None]) -> str:
    able = [name for name, why in obstacles.items() if why is None]
    return f"use {' or '.join(able)}" if able else "no other bound takes this problem either"
