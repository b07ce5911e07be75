"""Specialised dynamics as one backend: one module each."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import ClassVar

from nonrigid.formulations.model import Problem, Simplex
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Refused
from nonrigid.solvers.acceptance import Native as TakenAsIs
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.backends.native.replicator import replicator
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import quadratic_game

_GAMES = {"replicator": replicator}


@dataclass(frozen=True)
class Native:
    """Solve problems of known shape by the package's own dynamics, in numpy.

    Examples
    --------
    >>> Native("replicator").name
    'native'
    """

    algorithm: str = ""
    name: ClassVar[str] = "native"
    algorithms: ClassVar[tuple[str, ...]] = tuple(_GAMES)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return the fastest dynamic known for the problem's shape."""
        return "replicator"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take quadratic games: the simplex by every dynamic, other elastic nets by those that say so."""
        game = quadratic_game(problem)
        if isinstance(game, str):
            return Refused(f"{self.algorithm} needs {game}")
        if not isinstance(game.surface, Simplex):
            return Refused(f"{self.algorithm} needs a simplex, not {game.surface}")
        return TakenAsIs()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the dynamic."""
        game = quadratic_game(oracle.problem)
        assert not isinstance(game, str)
        x, words = _GAMES[self.algorithm](game, oracle, start, limits)
        return Raw(x, words)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of what the numbers depend on."""
        return {"nonrigid": version("nonrigid"), "numpy": version("numpy")}


BACKEND = Native
