"""CVXPY's solvers: convex problems in one solve, others by successive convexification or as nonlinear programs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar

import cvxpy

from nonrigid.formulations.model import Curvature, Problem
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Native, Refused, Via, via
from nonrigid.solvers.backend import Raw, library_version
from nonrigid.solvers.backends.cvxpy.lowering import Lowered, is_convex, set_obstacle, size_of, solve_quietly
from nonrigid.solvers.backends.cvxpy.settings import CONIC, NONLINEAR, QUADRATIC, convex_options, nonlinear_options
from nonrigid.solvers.backends.cvxpy.successive import successive
from nonrigid.solvers.bridges.body import ToBody
from nonrigid.solvers.bridges.cells import RegionCells
from nonrigid.solvers.bridges.hull import ToHull
from nonrigid.solvers.bridges.pair_lift import PairLift
from nonrigid.solvers.bridges.spectral_ball import ToSpectralBall
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle

cp: Any = cvxpy  # its types are incomplete

_LARGEST_NONLINEAR = 1000
# Order of a cone of matrices: one solve of CLARABEL takes 7 s at 90 and 26 s at 120, one of SCS 5 to 10 s at 300.
_LARGEST_CONE = {"CLARABEL": 90, "SCS": 400}
_PACKAGES = {"CLARABEL": "clarabel", "SCS": "scs", "OSQP": "osqp", "PIQP": "piqp", "HIGHS": "highspy"}


@dataclass(frozen=True)
class Cvxpy:
    """Solve problems by the solvers that CVXPY drives.

    A problem that declares itself convex, and that CVXPY verifies to be so from the formulas of its terms, is solved
    once; any other by a sequence of convex models (`nonrigid.solvers.backends.cvxpy.successive`). The region of a
    partial functional map, one unknown a vertex, is held constant on cells (`nonrigid.solvers.bridges.cells`); matrices
    with orthonormal columns range over their convex hull (`nonrigid.solvers.bridges.spectral_ball`). The algorithms
    nlp-UNO and nlp-IPOPT hand the formulas to CVXPY's nonlinear mode.

    Parameters
    ----------
    algorithm
        "CLARABEL", "SCS", "OSQP", "PIQP", "HIGHS", "nlp-UNO" or "nlp-IPOPT".

    Examples
    --------
    >>> Cvxpy("CLARABEL").name
    'cvxpy'
    """

    algorithm: str = ""
    name: ClassVar[str] = "cvxpy"
    algorithms: ClassVar[tuple[str, ...]] = CONIC + QUADRATIC + NONLINEAR

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return CLARABEL, which takes every convex model."""
        return "CLARABEL"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take sets whose formulas are known; curved surfaces through their convex bodies."""
        if self.algorithm in NONLINEAR:
            return self._accepts_nonlinear(problem)
        if self.algorithm not in _installed():
            return Refused(f"{self.algorithm}: CVXPY does not find it; install {_PACKAGES[self.algorithm]}")
        branches = self.algorithm == "HIGHS"
        if ToHull().obstacle(problem) is None:
            if branches and PairLift().obstacle(problem) is None:
                return Via((PairLift(),))
            if not branches or problem.curvature is not Curvature.AFFINE:
                return Via((ToHull(),))
        if RegionCells().obstacle(problem) is None:
            return Via((RegionCells(),))
        if ToSpectralBall().obstacle(problem) is None:
            obstacle = self._too_large_a_cone(problem)
            return Via((ToSpectralBall(),)) if obstacle is None else Refused(f"{self.algorithm}: {obstacle}")
        obstacle = set_obstacle(problem, quadratic=self.algorithm in CONIC, integral=branches)
        if obstacle is not None:
            return Refused(f"{self.algorithm}: {obstacle}")
        if branches and any(integral_entries(m.set, m.variable.shape).any() for m in problem.memberships):
            return Native()
        if all(member.set.convex for member in problem.memberships):
            return Native()
        taken: Via | Refused = via(problem, ToBody())
        return taken

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Solve once where the problem is convex, else step by step."""
        lowered = Lowered(oracle)
        if self.algorithm in NONLINEAR:
            return self._nonlinear(lowered, oracle, start, limits)
        if is_convex(oracle.problem):
            program = cp.Problem(cp.Minimize(lowered.objective()), lowered.constraints)
            if program.is_dcp() and (self.algorithm in CONIC or program.is_qp()):
                return self._once(program, lowered, oracle, limits)
        x, words = successive(lowered, oracle, start, self.algorithm, limits)
        return Raw(x, words)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of CVXPY and of the solvers it drives."""
        return {name: library_version(name) for name in ("cvxpy", *_PACKAGES.values(), "unopy")}

    def _once(self, program: Any, lowered: Lowered, oracle: Oracle, limits: Limits) -> Raw:
        program.get_problem_data(self.algorithm)
        oracle.built()
        options = convex_options(self.algorithm, limits, limits.seconds)
        words = solve_quietly(program, solver=self.algorithm, **options)
        if lowered.point() is None and words.startswith("solver error"):
            # Asked for more digits than it has, an interior-point solver may end with none: ask for fewer.
            oracle.charge(0.0)
            left = None if limits.seconds is None else limits.seconds - oracle.seconds
            options = convex_options(self.algorithm, replace(limits, tolerance=1e-2, feasibility=1e-3), left)
            words = solve_quietly(program, solver=self.algorithm, **options)
        return _answer(words, lowered, oracle)

    def _nonlinear(self, lowered: Lowered, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        program = cp.Problem(cp.Minimize(lowered.objective()), lowered.constraints)
        lowered.set(start)
        solver = self.algorithm.removeprefix("nlp-")
        options = nonlinear_options(self.algorithm, limits)
        return _answer(solve_quietly(program, nlp=True, solver=solver, **options), lowered, oracle)

    def _too_large_a_cone(self, problem: Problem) -> str | None:
        """Return why a solver cannot take matrices without a singular value above 1, a cone of their rows + columns."""
        if self.algorithm not in _LARGEST_CONE:
            return "it takes no cone of matrices, the hull of C'C = I; use SCS or CLARABEL"
        order = max(sum(m.variable.shape) for m in problem.memberships if isinstance(m.set, Stiefel))
        if order <= _LARGEST_CONE[self.algorithm]:
            return None
        return f"it needs a cone of matrices of order {order}, at most {_LARGEST_CONE[self.algorithm]} work" + (
            "; use SCS" if self.algorithm == "CLARABEL" else "; ask for fewer eigenfunctions"
        )

    def _accepts_nonlinear(self, problem: Problem) -> Acceptance:
        solver = self.algorithm.removeprefix("nlp-")
        if solver not in _installed():
            why = "it needs cyipopt, and casadi:ipopt is the same solver" if solver == "IPOPT" else "install unopy"
            return Refused(f"{self.algorithm}: CVXPY does not find it: {why}")
        for applied in problem.objective.terms:
            if not hasattr(applied.term, "lower"):
                return Refused(f"{self.algorithm}: it needs the formula of every term, and {applied} has no `lower`")
            if isinstance(applied.term, GroupNorm21):
                return Refused(f"{self.algorithm}: CVXPY's nonlinear mode knows no norms of columns; use casadi:ipopt")
        obstacle = set_obstacle(problem, quadratic=True)
        if obstacle is None and size_of(problem) > _LARGEST_NONLINEAR:
            obstacle = (
                f"it factorises a dense Hessian, O(n^3) a step: {size_of(problem)} unknowns, at most "
                f"{_LARGEST_NONLINEAR} work; use casadi:ipopt"
            )
        return Native() if obstacle is None else Refused(f"{self.algorithm}: {obstacle}")


@cache
def _installed() -> tuple[str, ...]:
    return tuple(cp.installed_solvers())


def _answer(words: str, lowered: Lowered, oracle: Oracle) -> Raw:
    found = lowered.point()
    if found is not None:
        oracle.observe(found)
    return Raw(found, words)


BACKEND = Cvxpy
