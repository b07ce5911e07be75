"""Conditional gradient: quadratic problems over transport plans, by one linear problem a step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from nonrigid.formulations.model import Problem, Sense, Set
from nonrigid.formulations.model.assignment_sets import Assignment
from nonrigid.formulations.model.terms.gromov_wasserstein import GromovWasserstein
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.transport_plans import cheapest_transport
from nonrigid.formulations.model.transport_sets import PartialTransport
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle

_REFRESH = 30
"""Steps after which the gradient is evaluated anew, since updates add up rounding errors."""

_PIVOTS = 10**7
"""Bound on the network simplex's pivots, far above what it needs: where it stops early its plan is wrong."""

LinearStep = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class TransportProblem:
    """Hold the set of a quadratic problem over transport plans."""

    set: Set
    shape: tuple[int, ...]


def transport_problem(problem: Problem) -> TransportProblem | str:
    """Return the problem as a quadratic one over transport plans, or say in words what keeps it from being one."""
    if problem.constraints:
        return f"no named constraints, and {sorted(problem.constraints)} stand in the problem"
    if len(problem.memberships) != 1 or not isinstance(problem.memberships[0].set, Assignment | PartialTransport):
        return f"one transport plan or relaxed assignment, not {', '.join(map(str, problem.memberships))}"
    for applied in problem.objective.terms:
        if not isinstance(applied.term, Linear | GromovWasserstein):
            return f"linear and Gromov-Wasserstein terms, not {applied}"
    return TransportProblem(problem.memberships[0].set, problem.variables[0].shape)


def network_obstacle(problem: Problem) -> str | None:
    """Return why the steps cannot be made by POT's network simplex; None if they can."""
    found = transport_problem(problem)
    if isinstance(found, str):
        return f"it needs {found}"
    if not isinstance(found.set, PartialTransport):
        return f"it needs a transport plan, not a point of {found.set}"
    if find_spec("ot") is None:
        return "it needs POT; install nonrigid[peers], or use native:conditional_gradient"
    return None


def conditional_gradient(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Move from T towards the plan S that the gradient G likes best, by exact line search.

    Along D = S - T the objective is the parabola <G, D> t + <D, H D> t^2 / 2, so the best t in [0, 1] has a closed form
    and the objective never rises. <G, T - S> >= 0 is the stationarity; it ends the solve. S is a vertex, with k + n
    cells that are not 0 at most; where the objective bends down, so is T from the first full step on.

    Source: Frank and Wolfe (Naval Research Logistics 1956); for Gromov-Wasserstein plans with room to spare, Chapel,
    Alaya and Gasso (NeurIPS 2020).
    """
    problem = transport_problem(oracle.problem)
    assert isinstance(problem, TransportProblem)
    return _descend(problem, oracle, start, limits, _priced_steps(problem))


def conditional_gradient_pot(oracle: Oracle, start: FloatArray, limits: Limits) -> tuple[FloatArray, str]:
    """Do the same with linear problems solved by the network simplex of POT.

    Source: Bonneel, van de Panne, Paris and Heidrich, displacement interpolation (SIGGRAPH Asia 2011).
    """
    problem = transport_problem(oracle.problem)
    assert isinstance(problem, TransportProblem)
    assert isinstance(problem.set, PartialTransport)
    return _descend(problem, oracle, start, limits, _network_steps(problem.set))


def _descend(
    problem: TransportProblem, oracle: Oracle, start: FloatArray, limits: Limits, linear_step: LinearStep
) -> tuple[FloatArray, str]:
    objective = oracle.problem.objective
    sign = 1.0 if objective.sense is Sense.MINIMIZE else -1.0
    x = problem.set.restore(start.reshape(problem.shape))
    value, slope = _evaluated(oracle, x)
    steps = 0
    while True:
        direction = linear_step(slope) - x
        gap = -float(np.vdot(slope, direction))
        if gap <= 0.1 * limits.tolerance * max(1.0, abs(value)):
            return x.ravel(), "gap below tolerance"
        change = oracle.hessian_product(x.ravel(), direction.ravel()).reshape(problem.shape)
        bend = float(np.vdot(direction, change))
        step = min(1.0, gap / bend) if bend > 0.0 else 1.0
        fall = step * gap - 0.5 * step * step * bend
        if fall <= 1e-15 * abs(value):
            return x.ravel(), "no descent beyond rounding"
        x, slope, value = x + step * direction, slope + step * change, value - fall
        steps += 1
        oracle.observe(x.ravel(), objective=sign * value)
        if steps % _REFRESH == 0:
            value, slope = _evaluated(oracle, x)


def _evaluated(oracle: Oracle, x: FloatArray) -> tuple[float, FloatArray]:
    value, slope = oracle.value_and_gradient(x.ravel())
    return value, slope.reshape(x.shape)


def _priced_steps(problem: TransportProblem) -> LinearStep:
    """Return the linear step by columns and prices; those of one step are the guess of the next."""
    plans = problem.set
    if isinstance(plans, Assignment):
        return lambda slope: plans.linear_max(-slope)
    assert isinstance(plans, PartialTransport)
    prices: list[FloatArray] = []

    def step(slope: FloatArray) -> FloatArray:
        plan = cheapest_transport(slope, plans.mass, plans.capacity, guess=prices[-1] if prices else None)
        prices.append(plan.column_prices)
        return plans.restore(plan.moved)

    return step


def _network_steps(plans: PartialTransport) -> LinearStep:
    """Return the linear step by POT: a row beyond the last one takes, at a constant cost, the capacity not needed."""
    import ot

    unused = max(float(plans.capacity.sum() - plans.mass.sum()), 0.0)

    def step(slope: FloatArray) -> FloatArray:
        cost = np.vstack([slope - slope.min(), np.zeros(slope.shape[1])])
        moved = ot.emd(np.append(plans.mass, unused), plans.capacity, cost, numItermax=_PIVOTS)
        return plans.restore(np.asarray(moved[:-1]))

    return step
