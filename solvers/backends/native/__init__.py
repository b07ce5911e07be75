"""Specialised dynamics as one backend: one module each."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import ClassVar

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Refused
from nonrigid.solvers.acceptance import Native as TakenAsIs
from nonrigid.solvers.backend import Raw, library_version
from nonrigid.solvers.backends.native.conditional_gradient import (
    conditional_gradient,
    conditional_gradient_pot,
    network_obstacle,
    transport_problem,
)
from nonrigid.solvers.backends.native.generalised_power import generalised_power
from nonrigid.solvers.backends.native.infection_immunisation import infection_immunisation
from nonrigid.solvers.backends.native.injective_maps import branch_and_bound, exhaustive
from nonrigid.solvers.backends.native.least_squares import least_squares, regression
from nonrigid.solvers.backends.native.limited_memory import limited_memory
from nonrigid.solvers.backends.native.matching import matching
from nonrigid.solvers.backends.native.pairwise_frank_wolfe import pairwise_frank_wolfe
from nonrigid.solvers.backends.native.procrustes import procrustes, procrustes_gain
from nonrigid.solvers.backends.native.projected_gradient import projected_gradient
from nonrigid.solvers.backends.native.replicator import replicator
from nonrigid.solvers.backends.native.reweighted import reweighted, robust_regression
from nonrigid.solvers.capability import Capability
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import linear_assignment, quadratic_game, triple_assignment

_DYNAMICS = {
    "replicator": replicator,
    "infection_immunisation": infection_immunisation,
    "pairwise_frank_wolfe": pairwise_frank_wolfe,
    "projected_gradient": projected_gradient,
    "generalised_power": generalised_power,
}
_GENERAL = {
    "limited_memory": limited_memory,
    "reweighted": reweighted,
    "procrustes": procrustes,
    "least_squares": least_squares,
    "conditional_gradient": conditional_gradient,
    "conditional_gradient_pot": conditional_gradient_pot,
}
_PROVING = {"branch_and_bound": branch_and_bound, "exhaustive": exhaustive, "matching": matching}
_MOST_MAPS = 5_000_000
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
    algorithms: ClassVar[tuple[str, ...]] = (*_DYNAMICS, *_GENERAL, *_PROVING)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return the fastest algorithm known for the problem's shape, `limited_memory` for any other within bounds."""
        game = quadratic_game(problem)
        if not isinstance(game, str):
            return "generalised_power" if game.surface.mix > 0.0 else "projected_gradient"
        if not isinstance(robust_regression(problem), str):
            return "reweighted"
        if not isinstance(regression(problem), str):
            return "least_squares"
        if not isinstance(procrustes_gain(problem), str):
            return "procrustes"
        if not isinstance(triple_assignment(problem), str):
            return "branch_and_bound"
        if not isinstance(linear_assignment(problem), str):
            return "matching"
        if not isinstance(transport_problem(problem), str):
            return "conditional_gradient"
        return "limited_memory" if Capability().obstacle(problem) is None else "projected_gradient"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take quadratic games, robust regressions and smooth problems within bounds: each algorithm what it knows."""
        if self.algorithm in _GENERAL or self.algorithm in _PROVING:
            wanted = self._obstacle(problem)
            return TakenAsIs() if wanted is None else Refused(f"{self.algorithm}: {wanted}")
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

    def _obstacle(self, problem: Problem) -> str | None:
        if self.algorithm == "limited_memory":
            return Capability().obstacle(problem)
        if self.algorithm in _PROVING:
            return _search_obstacle(self.algorithm, problem)
        if self.algorithm == "procrustes":
            gain = procrustes_gain(problem)
            return f"it needs {gain}" if isinstance(gain, str) else None
        if self.algorithm == "conditional_gradient_pot":
            return network_obstacle(problem)
        if self.algorithm == "conditional_gradient":
            plans = transport_problem(problem)
            return f"it needs {plans}" if isinstance(plans, str) else None
        known = regression(problem) if self.algorithm == "least_squares" else robust_regression(problem)
        return f"it needs {known}" if isinstance(known, str) else None

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the algorithm."""
        if self.algorithm in _PROVING:
            return _PROVING[self.algorithm](oracle, start, limits)
        if self.algorithm in _GENERAL:
            return Raw(*_GENERAL[self.algorithm](oracle, start, limits))
        game = quadratic_game(oracle.problem)
        assert not isinstance(game, str)
        x, words = _DYNAMICS[self.algorithm](game, oracle, start, limits)
        return Raw(x, words)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of what the numbers depend on."""
        found = {name: library_version(name) for name in ("nonrigid", "numpy", "scipy")}
        return found if find_spec("ot") is None else {**found, "pot": library_version("pot")}


def _search_obstacle(algorithm: str, problem: Problem) -> str | None:
    if algorithm == "matching":
        linear = linear_assignment(problem)
        return f"it needs {linear}" if isinstance(linear, str) else None
    triple = triple_assignment(problem)
    if isinstance(triple, str):
        return f"it needs {triple}"
    if algorithm == "exhaustive" and triple.maps > _MOST_MAPS:
        return f"it evaluates every map: {triple.maps} of them, at most {_MOST_MAPS} work; use native:branch_and_bound"
    return None


BACKEND = Native
