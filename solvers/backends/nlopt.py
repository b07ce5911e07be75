"""NLopt: fifteen years of local methods behind one interface, fed with numpy callbacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import nlopt
import numpy as np

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.acceptance import Acceptance, Bridge, Refused
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.bridges.body import ToBody
from nonrigid.solvers.bridges.hull import ToHull
from nonrigid.solvers.bridges.polar import Polar
from nonrigid.solvers.bridges.radial import Radial
from nonrigid.solvers.bridges.squares import Squares
from nonrigid.solvers.capability import Capability, accept
from nonrigid.solvers.layout import FlatConstraint
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import NotFiniteError, Oracle

_BOUNDS_ONLY = Capability()
_INEQUALITIES = Capability(at_most=True)
_CAPABILITIES = {
    "LD_CCSAQ": _INEQUALITIES,
    "LD_MMA": _INEQUALITIES,
    "LD_SLSQP": Capability(
        equal=True,
        at_most=True,
        largest=200,
        because="SLSQP solves a dense least-squares problem a step, seconds at n = 300",
    ),
    "LD_LBFGS": _BOUNDS_ONLY,
    "LD_TNEWTON_PRECOND_RESTART": _BOUNDS_ONLY,
    "LD_TNEWTON": _BOUNDS_ONLY,
    "LD_VAR1": _BOUNDS_ONLY,
    "LD_VAR2": _BOUNDS_ONLY,
    "LD_AUGLAG": Capability(equal=True, at_most=True),
    "LN_COBYLA": Capability(
        equal=True, at_most=True, largest=60, because="COBYLA keeps a simplex of n + 1 points and uses no gradient"
    ),
    "GN_ISRES": Capability(
        equal=True,
        at_most=True,
        finite_bounds=True,
        largest=60,
        because="ISRES evolves a population of 20 (n + 1) points and uses no gradient",
    ),
}
_BRIDGES: dict[str, tuple[tuple[Bridge, ...], ...]] = {
    "body": ((ToBody(),),),
    "radial": ((Radial(),),),
    "squares": ((Squares(),),),
}
_AUTO: tuple[tuple[Bridge, ...], ...] = ((), (Radial(),), (ToBody(),), (ToHull(),), (Polar(),))
# Methods that gather curvature lose it at every bound that becomes active, of which there are n at a sparse answer.
_AUTO_FREE: tuple[tuple[Bridge, ...], ...] = ((), (Squares(),), (ToHull(),), (Polar(),))
_FREE = ("LD_LBFGS", "LD_VAR1", "LD_VAR2", "LD_TNEWTON")
_MEMORY = 20  # pairs of a limited-memory method; NLopt's own choice, 1.3 million numbers, makes their use the main cost


@dataclass(frozen=True)
class Nlopt:
    """Solve problems by NLopt.

    Parameters
    ----------
    algorithm
        NLopt's own name, such as "LD_CCSAQ".
    bridge
        How a variable on a surface (simplex, elastic net, sphere) is handed over: "auto", as it stands where the
        algorithm takes equality constraints, else by squares for quasi-Newton methods and by rays for the others, else
        by its body; or "radial", "squares", "body".
    inner
        The method that solves the subproblems of LD_AUGLAG: "LD_LBFGS" or "LD_CCSAQ".
    seed
        Seed of GN_ISRES.

    Raises
    ------
    InputError
        If `bridge` or `inner` is none of the words above.

    Examples
    --------
    >>> Nlopt("LD_CCSAQ", bridge="body").name
    'nlopt'

    Source: S. G. Johnson, The NLopt nonlinear-optimization package.
    """

    algorithm: str = ""
    bridge: str = "auto"
    inner: str = "LD_LBFGS"
    seed: int = 0
    name: ClassVar[str] = "nlopt"
    algorithms: ClassVar[tuple[str, ...]] = tuple(_CAPABILITIES)

    def __post_init__(self) -> None:
        if self.bridge != "auto" and self.bridge not in _BRIDGES:
            raise InputError(f"bridge is {self.bridge!r}", remedy=f"choose one of auto, {', '.join(_BRIDGES)}")
        if self.inner not in ("LD_LBFGS", "LD_CCSAQ"):
            raise InputError(f"inner is {self.inner!r}", remedy="choose LD_LBFGS or LD_CCSAQ")

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return LD_CCSAQ, which scales best, or LD_AUGLAG where it cannot take the problem."""
        return "LD_AUGLAG" if isinstance(cls("LD_CCSAQ").accepts(problem), Refused) else "LD_CCSAQ"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take what the algorithm takes, surfaces through a bridge where it has no equality constraints."""
        auto = _AUTO_FREE if self.algorithm in _FREE else _AUTO
        return accept(problem, self.algorithm, _CAPABILITIES[self.algorithm], _BRIDGES.get(self.bridge, auto))

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Run the algorithm; what NLopt loses when it raises, the oracle has kept."""
        start = np.clip(start, oracle.lower, oracle.upper)
        optimizer = self._optimizer(oracle, start, limits)
        oracle.built()
        oracle.observe(start)  # random searches need not visit their start, which may be the only feasible point seen
        nlopt.srand(self.seed)  # the generator is global, so it is set before each run
        try:
            x = optimizer.optimize(start)
        except (nlopt.RoundoffLimited, nlopt.ForcedStop) as stop:
            return Raw(None, type(stop).__name__)
        except Exception as failure:
            if oracle.interrupted is not None:  # some methods replace the oracle's signal by one of their own
                raise oracle.interrupted from None
            if not str(failure):
                return Raw(None, "NLopt failed without a word, as its line searches do where no step helps")
            raise
        return Raw(np.asarray(x, float), _words(optimizer.last_optimize_result()))

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the version of NLopt."""
        return {"nlopt": str(nlopt.__version__)}

    def _optimizer(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Any:
        optimizer = _new(self.algorithm, oracle, limits)
        optimizer.set_min_objective(_objective(oracle))
        if self.algorithm == "LD_AUGLAG":
            optimizer.set_local_optimizer(_new(self.inner, oracle, limits))
        for item in oracle.constraints:
            size = len(item.value_and_jacobian(start)[0])
            add = (
                optimizer.add_equality_mconstraint
                if item.constraint.kind == "equal"
                else optimizer.add_inequality_mconstraint
            )
            add(_constraint(item, oracle), np.full(size, 0.1 * limits.feasibility))
        return optimizer


def _new(algorithm: str, oracle: Oracle, limits: Limits) -> Any:
    optimizer = nlopt.opt(getattr(nlopt, algorithm), oracle.size)
    optimizer.set_lower_bounds(oracle.lower)
    optimizer.set_upper_bounds(oracle.upper)
    # NLopt has no test of stationarity; the change of the objective near a stationary point is its square.
    optimizer.set_ftol_rel(max(1e-3 * limits.tolerance**2, 1e-15))
    optimizer.set_xtol_rel(1e-3 * limits.tolerance)
    if algorithm in ("LD_LBFGS", "LD_VAR1", "LD_VAR2"):
        optimizer.set_vector_storage(_MEMORY)
    # No set_maxtime: NLopt's clock would count the package's own measurements; the oracle's exception ends each method.
    return optimizer


def _objective(oracle: Oracle) -> Callable[[FloatArray, FloatArray], float]:
    def evaluate(x: FloatArray, gradient: FloatArray) -> float:
        value, slope = oracle.value_and_gradient(x)
        if gradient.size:
            gradient[:] = slope  # in place: NLopt reads its own array
        return float(value)

    return evaluate


def _constraint(item: FlatConstraint, oracle: Oracle) -> Callable[[FloatArray, FloatArray, FloatArray], None]:
    def evaluate(result: FloatArray, x: FloatArray, gradient: FloatArray) -> None:
        oracle.charge(0.0)
        value, jacobian = item.value_and_jacobian(np.array(x))
        if not (np.isfinite(value).all() and np.isfinite(jacobian).all()):
            oracle.interrupted = NotFiniteError(f"the constraint {item.name!r} is not finite at a point tried")
            raise oracle.interrupted
        result[:] = value
        if gradient.size:
            gradient[:] = jacobian

    return evaluate


def _words(code: int) -> str:
    names = ("SUCCESS", "STOPVAL_REACHED", "FTOL_REACHED", "XTOL_REACHED", "MAXEVAL_REACHED", "MAXTIME_REACHED")
    return names[code - 1] if 1 <= code <= len(names) else f"code {code}"


BACKEND = Nlopt
