"""Specialised dynamics as one backend: one module each."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import ClassVar

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Refused
from nonrigid.solvers.acceptance import Native as TakenAsIs
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.backends.native.generalised_power import generalised_power
from nonrigid.solvers.backends.native.infection_immunisation import infection_immunisation
from nonrigid.solvers.backends.native.pairwise_frank_wolfe import pairwise_frank_wolfe
from nonrigid.solvers.backends.native.projected_gradient import projected_gradient
from nonrigid.solvers.backends.native.replicator import replicator
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import quadratic_game

_DYNAMICS = {
    "replicator": replicator,
    "infection_immunisation": infection_immunisation,
    "pairwise_frank_wolfe": pairwise_frank_wolfe,
    "projected_gradient": projected_gradient,
    "generalised_power": generalised_power,
}
_SIMPLEX_ONLY = {"replicator", "infection_immunisation", "pairwise_frank_wolfe"}


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
    algorithms: ClassVar[tuple[str, ...]] = tuple(_DYNAMICS)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return the fastest dynamic known for the problem's shape."""
        game = quadratic_game(problem)
        curved = not isinstance(game, str) and game.surface.mix > 0.0
        return "generalised_power" if curved else "projected_gradient"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take quadratic games: each dynamic on the surfaces it knows."""
        game = quadratic_game(problem)
        if isinstance(game, str):
            return Refused(f"{self.algorithm} needs {game}")
        mix = game.surface.mix
        if self.algorithm in _SIMPLEX_ONLY and mix != 0.0:
            return Refused(
                f"{self.algorithm} moves shares that sum to 1, so it needs mix = 0, not {mix:g}; "
                "use generalised_power or projected_gradient"
            )
        if self.algorithm == "generalised_power" and mix == 0.0:
            return Refused(
                "generalised_power would jump between vertices of the simplex, so it needs mix > 0, not 0; "
                f"use {self.default_algorithm(problem)}"
            )
        return TakenAsIs()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the dynamic."""
        game = quadratic_game(oracle.problem)
        assert not isinstance(game, str)
        x, words = _DYNAMICS[self.algorithm](game, oracle, start, limits)
        return Raw(x, words)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of what the numbers depend on."""
        return {"nonrigid": version("nonrigid"), "numpy": version("numpy")}


BACKEND = Native
