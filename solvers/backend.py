"""What a backend must offer, and how one is named, found and made."""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points, version
from typing import Any, ClassVar, Protocol

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import UnknownNameError
from nonrigid.solvers import backends as builtin
from nonrigid.solvers.acceptance import Acceptance
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.solution import Bound

ENTRY_POINTS = "nonrigid.backends"


@dataclass(frozen=True, eq=False)
class Raw:
    """Hold what a backend hands back.

    Parameters
    ----------
    x
        Its last point, flat, or None.
    raw_status
        Its own words.
    bound
        A bound that its search proved on the problem it was handed, in the problem's own sense: only for a method that
        proves by construction, such as an exhaustive search. A library's report of optimality is no proof.
    """

    x: FloatArray | None
    raw_status: str
    bound: Bound | None = None


class Backend(Protocol):
    """Solve problems with one algorithm of one library; a frozen dataclass whose fields are its options.

    Third parties register a class under the entry-point group `nonrigid.backends`, or hand an instance to `solve`.
    """

    name: ClassVar[str]
    algorithms: ClassVar[tuple[str, ...]]
    algorithm: str

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return the algorithm used for this problem where the user names none."""

    def accepts(self, problem: Problem) -> Acceptance:
        """Say whether this algorithm takes the problem: natively, via which bridges, or refused and why."""

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Iterate from a flat start; exceptions may escape, the oracle keeps the best point."""

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of the library and of the native solvers it holds."""


@cache
def library_version(distribution: str) -> str:
    """Return the version of an installed distribution; every solution names some, and each is looked up once.

    Raises `importlib.metadata.PackageNotFoundError` where there is none.
    """
    return version(distribution)


def backend_names() -> tuple[str, ...]:
    """Return the names of all backends, built in and registered, without importing their libraries."""
    own = [found.name for found in pkgutil.iter_modules(builtin.__path__)]
    return tuple(sorted(own)) + tuple(sorted(found.name for found in entry_points(group=ENTRY_POINTS)))


@cache
def backend_class(name: str) -> Any:
    """Return the class of a backend.

    Raises `UnknownNameError` naming those that exist.
    """
    for found in entry_points(group=ENTRY_POINTS):
        if found.name == name:
            return found.load()
    if name not in backend_names():
        raise UnknownNameError("backend", name, backend_names())
    return importlib.import_module(f"{builtin.__name__}.{name}").BACKEND


def make_backend(spec: str | Backend) -> Backend:
    """Return the backend that a word such as "nlopt" or "nlopt:LD_CCSAQ" names.

    Raises `UnknownNameError` for a name or algorithm that does not exist.

    Examples
    --------
    >>> make_backend("native:replicator").algorithm
    'replicator'
    """
    if not isinstance(spec, str):
        return spec
    name, _, algorithm = spec.partition(":")
    kind = backend_class(name)
    if algorithm and algorithm not in kind.algorithms:
        raise UnknownNameError(f"algorithm of {name}", algorithm, kind.algorithms)
    backend: Backend = kind(algorithm=algorithm)
    return backend


def resolved(backend: Backend, problem: Problem) -> Backend:
    """Return the backend with its algorithm chosen for the problem, where none was named."""
    if backend.algorithm:
        return backend
    settled: Backend = replace(backend, algorithm=backend.default_algorithm(problem))  # type: ignore[type-var]
    return settled
