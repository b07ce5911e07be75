"""CasADi's solvers over numpy callbacks: interior points, sequential quadratic programs, branch and bound, Uno."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from nonrigid.formulations.model import Problem
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.geometry.arrays import BoolArray, FloatArray
from nonrigid.solvers.acceptance import Acceptance, Bridge, Native, Refused, Via, via
from nonrigid.solvers.backend import Raw, library_version
from nonrigid.solvers.backends.casadi.functions import StopAsked
from nonrigid.solvers.backends.casadi.settings import QP_PLUGINS, solver_options
from nonrigid.solvers.backends.casadi.transcription import second_order_obstacle, transcribe
from nonrigid.solvers.bridges.hull import ToHull
from nonrigid.solvers.bridges.kkt_mixed_integer import KktMixedInteger
from nonrigid.solvers.bridges.pair_lift import PairLift
from nonrigid.solvers.bridges.polar import Polar
from nonrigid.solvers.capability import too_many_conditions
from nonrigid.solvers.layout import Layout
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.structure import quadratic_game

_SECOND_ORDER = ("ipopt-hessian", "bonmin", "uno")
_LARGEST = {"ipopt-hessian": 1000, "bonmin": 1000, "uno": 1000}
_LARGEST_SQP = 500


@dataclass(frozen=True)
class Casadi:
    """Solve problems by the solvers that come with CasADi.

    Parameters
    ----------
    algorithm
        "ipopt" (limited-memory Hessian), "ipopt-hessian" (dense Hessian), "sqpmethod" (with qrqp) or "sqpmethod-" and
        the name of a QP solver, "bonmin" (branch and bound; quadratic games as mixed-integer linear problems), "uno".
    memory
        Pairs of steps and gradients that the limited-memory Hessian keeps.
    bound_push
        Smallest distance from its bounds, absolute and relative, at which an interior-point method starts. Larger
        values move a start on the simplex far off it.

    Examples
    --------
    >>> Casadi("ipopt").name
    'casadi'
    """

    algorithm: str = ""
    memory: int = 6
    bound_push: float = 1e-8
    name: ClassVar[str] = "casadi"
    algorithms: ClassVar[tuple[str, ...]] = (
        "ipopt",
        "ipopt-hessian",
        "sqpmethod",
        *(f"sqpmethod-{plugin}" for plugin in QP_PLUGINS),
        "bonmin",
        "uno",
    )

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return ipopt, or bonmin where entries are integral."""
        return "bonmin" if _integral(problem).any() else "ipopt"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take smooth problems in sets of any kind; entries that are integral by bonmin alone."""
        if self.algorithm == "bonmin" and not isinstance(quadratic_game(problem), str):
            return via(problem, KktMixedInteger())
        if ToHull().obstacle(problem) is None:
            lifted = PairLift().obstacle(problem)
            if self.algorithm == "bonmin" and lifted is None:
                return self._through(problem, PairLift())
            if self.algorithm != "bonmin":
                return self._through(problem, ToHull())
        if self.algorithm == "ipopt" and Polar().obstacle(problem) is None:
            # As equations they are r (r + 1) / 2 dense rows, that are factorised in each step.
            return self._through(problem, Polar())
        return self._takes(problem)

    def _through(self, problem: Problem, bridge: Bridge) -> Acceptance:
        taken = self._takes(bridge.apply(problem).problem)
        return taken if isinstance(taken, Refused) else Via((bridge,))

    def _takes(self, problem: Problem) -> Native | Refused:
        integral = int(_integral(problem).sum())
        if integral and self.algorithm != "bonmin":
            return Refused(
                f"{self.algorithm}: it cannot branch, and {integral} entries are integral; use casadi:bonmin"
            )
        large = too_many_conditions(problem)
        if large is not None:
            return Refused(f"{self.algorithm}: {large}")
        if self.algorithm in _SECOND_ORDER:
            obstacle = second_order_obstacle(problem, _LARGEST[self.algorithm])
            return Native() if obstacle is None else Refused(f"{self.algorithm}: {obstacle}")
        size = Layout(problem).size
        if self.algorithm.startswith("sqpmethod") and size > _LARGEST_SQP:
            return Refused(
                f"{self.algorithm}: it solves a dense quadratic program of O(n^3) in each step: {size} unknowns, "
                f"at most {_LARGEST_SQP} work; use casadi:ipopt"
            )
        return Native()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the solver on callbacks; what they raised is raised again when the solver has stopped."""
        plugin = self.algorithm.partition("-")[0]
        second_order = self.algorithm in _SECOND_ORDER
        nlp = transcribe(oracle, second_order=second_order)
        options = solver_options(self.algorithm, limits, nlp, memory=self.memory, bound_push=self.bound_push)
        if plugin in ("ipopt", "sqpmethod"):
            options["iteration_callback"] = StopAsked(nlp.served, nlp.rows)
        if plugin == "bonmin":
            options["discrete"] = _integral(oracle.problem).tolist()
        solver = ca.nlpsol("solver", plugin, nlp.nlp, options)
        oracle.built()
        # Bonmin logs each node through Python's stdout whatever its options say.
        with contextlib.nullcontext() if limits.verbose else contextlib.redirect_stdout(io.StringIO()):
            found = solver(
                x0=np.clip(start, oracle.lower, oracle.upper),
                lbx=oracle.lower,
                ubx=oracle.upper,
                lbg=nlp.row_lower,
                ubg=nlp.row_upper,
            )
        nlp.served.raise_failure()
        words = str(solver.stats().get("return_status", "no status"))
        return Raw(None if nlp.served.stopped else found["x"].full().ravel(), words)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the version of CasADi, which carries its solvers."""
        return {"casadi": library_version("casadi")}


def _integral(problem: Problem) -> BoolArray:
    parts: list[Any] = [integral_entries(m.set, m.variable.shape).ravel() for m in problem.memberships]
    return np.concatenate(parts)


BACKEND = Casadi
