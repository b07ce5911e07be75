"""SciPy's minimizers: the peers that a user would pick first; and HiGHS for linear problems."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.optimize
from scipy.sparse import csr_array

from nonrigid.formulations.model import Curvature, Problem
from nonrigid.formulations.model.binary_sets import integral_entries
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Bridge, Native, Refused, Via
from nonrigid.solvers.backend import Raw, library_version
from nonrigid.solvers.bridges.hull import ToHull
from nonrigid.solvers.bridges.pair_lift import PairLift
from nonrigid.solvers.bridges.polar import Polar
from nonrigid.solvers.bridges.radial import Radial
from nonrigid.solvers.capability import Capability, accept, too_many_conditions
from nonrigid.solvers.layout import FlatConstraint, Layout
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import NotFiniteError, Oracle

_CAPABILITIES = {
    "L-BFGS-B": Capability(),
    "SLSQP": Capability(
        equal=True,
        at_most=True,
        largest=500,
        because="SLSQP solves a dense least-squares problem a step, about 1 s at n = 500",
    ),
    "trust-constr": Capability(
        equal=True,
        at_most=True,
        largest=200,
        because="trust-constr factorises a dense system of all bounds a step, 0.1 s at n = 200",
    ),
}
_ROUTES: tuple[tuple[Bridge, ...], ...] = ((), (Radial(),), (ToHull(),), (Polar(),))
_UNBOUNDED = 10**9  # SciPy's own limits on iterations are lifted: the oracle keeps the limits


@dataclass(frozen=True)
class Scipy:
    """Solve problems by scipy.optimize.minimize.

    Parameters
    ----------
    algorithm
        "L-BFGS-B" (bounds only; surfaces by rays, matrices with orthonormal columns by polar factors), "SLSQP" or
        "trust-constr" (with products of the Hessian where every term offers them); "milp" (HiGHS, for linear objectives
        and constraints, integral entries or not).

    Examples
    --------
    >>> Scipy("SLSQP").name
    'scipy'
    """

    algorithm: str = ""
    name: ClassVar[str] = "scipy"
    algorithms: ClassVar[tuple[str, ...]] = (*_CAPABILITIES, "milp")

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return L-BFGS-B, which scales best, or SLSQP where constraints remain."""
        return "SLSQP" if isinstance(cls("L-BFGS-B").accepts(problem), Refused) else "L-BFGS-B"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take what the algorithm takes; surfaces by rays where it knows bounds only."""
        if self.algorithm == "milp":
            lifted = PairLift().obstacle(problem) is None
            obstacle = None if lifted else _nonlinear_obstacle(problem)
            if obstacle is not None:
                return Refused(f"milp: {obstacle}")
            return Via((PairLift(),)) if lifted else Native()
        return accept(problem, self.algorithm, _CAPABILITIES[self.algorithm], _ROUTES)

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the algorithm; a limit leaves it as an exception, and the oracle has kept the best point."""
        if self.algorithm == "milp":
            return _milp(oracle, start, limits)
        arguments: dict[str, Any] = {"options": _options(self.algorithm, limits)}
        if self.algorithm == "trust-constr":
            arguments["constraints"] = [_nonlinear(item, oracle) for item in oracle.constraints]
            if _second_order(oracle.problem):
                arguments["hessp"] = oracle.hessian_product
        elif self.algorithm == "SLSQP":
            arguments["constraints"] = [_signed(item, oracle) for item in oracle.constraints]
        oracle.built()
        minimize: Any = scipy.optimize.minimize
        with warnings.catch_warnings():
            # A step so small that the slope does not change is how trust-constr ends; it is no news to the user.
            warnings.filterwarnings("ignore", message="delta_grad == 0.0", category=UserWarning)
            found = minimize(
                oracle.value_and_gradient,
                np.clip(start, oracle.lower, oracle.upper),
                jac=True,
                method=self.algorithm,
                bounds=scipy.optimize.Bounds(oracle.lower, oracle.upper),
                **arguments,
            )
        return Raw(np.asarray(found.x, float), f"{found.status}: {found.message}")

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the version of SciPy."""
        return {"scipy": library_version("scipy")}


def _options(algorithm: str, limits: Limits) -> dict[str, Any]:
    tight = 0.1 * limits.tolerance
    if algorithm == "L-BFGS-B":
        # On rays gradients are smaller than on the surface, by the length of the point.
        return {"gtol": 0.1 * tight, "ftol": 0.0, "maxiter": _UNBOUNDED, "maxfun": _UNBOUNDED, "maxcor": 20}
    if algorithm == "SLSQP":
        return {"ftol": max(1e-3 * limits.tolerance**2, 1e-15), "maxiter": _UNBOUNDED, "disp": limits.verbose}
    # Its gradient test does not look at complementarity, so it stops far from the bounds: only the radius may stop it.
    words = {"verbose": 2 if limits.verbose else 0}
    return {"gtol": 0.0, "xtol": 1e-8, "barrier_tol": tight, "maxiter": _UNBOUNDED, **words}


def _nonlinear_obstacle(problem: Problem) -> str | None:
    if problem.curvature is not Curvature.AFFINE:
        return f"it takes linear objectives only, and {problem.name!r} declares none"
    large = too_many_conditions(problem)
    if large is not None:
        return large
    for item in Layout(problem).constraints():
        if not item.constraint.linear:
            return f"it takes linear constraints only, and {item.name!r} is none"
    return None


def _milp(oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
    oracle.observe(start)
    slope = oracle.value_and_gradient(start)[1]
    rows = []
    for item in oracle.constraints:
        offset, jacobian = item.value_and_jacobian(np.zeros(oracle.size))
        lowest = -offset if item.constraint.kind == "equal" else np.full(len(offset), -np.inf)
        rows.append(scipy.optimize.LinearConstraint(csr_array(jacobian), lowest, -offset))
    parts: list[Any] = [integral_entries(m.set, m.variable.shape).ravel() for m in oracle.problem.memberships]
    oracle.built()
    milp: Any = scipy.optimize.milp
    found = milp(
        slope,
        integrality=np.concatenate(parts).astype(int),
        bounds=scipy.optimize.Bounds(oracle.lower, oracle.upper),
        constraints=rows,
        options={"mip_rel_gap": 1e-9, "disp": limits.verbose}
        | ({} if limits.seconds is None else {"time_limit": float(limits.seconds)}),
    )
    if found.x is not None:
        oracle.observe(found.x)
    return Raw(None if found.x is None else np.asarray(found.x, float), f"{found.status}: {found.message}")


def _second_order(problem: Problem) -> bool:
    return all(
        hasattr(applied.term, "hessian_product") and len(applied.variables) == 1 for applied in problem.objective.terms
    )


def _checked(item: FlatConstraint, oracle: Oracle) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    def evaluate(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        oracle.charge(0.0)
        value, jacobian = item.value_and_jacobian(np.array(x))
        if not (np.isfinite(value).all() and np.isfinite(jacobian).all()):
            oracle.interrupted = NotFiniteError(f"the constraint {item.name!r} is not finite at a point tried")
            raise oracle.interrupted
        return value, jacobian

    return evaluate


def _signed(item: FlatConstraint, oracle: Oracle) -> dict[str, Any]:
    evaluate = _checked(item, oracle)
    kind, sign = ("eq", 1.0) if item.constraint.kind == "equal" else ("ineq", -1.0)  # SciPy's inequality is c(x) >= 0
    return {"type": kind, "fun": lambda x: sign * evaluate(x)[0], "jac": lambda x: sign * evaluate(x)[1]}


def _nonlinear(item: FlatConstraint, oracle: Oracle) -> Any:
    evaluate, flat = _checked(item, oracle), csr_array((oracle.size, oracle.size))
    constraint: Any = scipy.optimize.NonlinearConstraint
    return constraint(
        lambda x: evaluate(x)[0],
        0.0 if item.constraint.kind == "equal" else -np.inf,
        0.0,
        jac=lambda x: evaluate(x)[1],
        hess=(lambda x, multipliers: flat) if item.constraint.linear else scipy.optimize.BFGS(),
    )


BACKEND = Scipy
