"""A problem as CasADi's nlp: callbacks for what curves, constant matrices for what is linear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from nonrigid.formulations.model import Problem
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backends.casadi.functions import Served
from nonrigid.solvers.backends.casadi.ops import CasadiOps, as_dm, is_bound, shaped
from nonrigid.solvers.layout import Layout
from nonrigid.solvers.oracle import Oracle


@dataclass(frozen=True, eq=False)
class Transcription:
    """Hold the nlp, the bounds of its rows, and the callbacks that must stay alive while it is solved."""

    nlp: dict[str, Any]
    row_lower: FloatArray
    row_upper: FloatArray
    linear: bool
    served: Served
    hessian: Any = None

    @property
    def rows(self) -> int:
        """Number of rows beyond the bounds."""
        return len(self.row_lower)


def transcribe(oracle: Oracle, *, second_order: bool, triangle: bool = True) -> Transcription:
    """Return the oracle's problem as an nlp.

    With `second_order`, curved constraints are written symbolically from `lower`, and the Hessian of the Lagrangian is
    a function of CasADi's signature: its upper triangle, or all of it.
    """
    served = Served(oracle)
    x = ca.MX.sym("x", oracle.size)
    rows: list[Any] = []
    kinds: list[tuple[str, int]] = []
    curved = [item for item in oracle.constraints if not item.constraint.linear]
    for item in oracle.constraints:
        if item.constraint.linear:
            origin = np.zeros(oracle.size)
            offset, jacobian = item.value_and_jacobian(origin)
            rows.append(as_dm(jacobian) @ x + ca.DM(offset))
            kinds.append((item.constraint.kind, len(offset)))
    if second_order:
        for relation in lowered_sets(oracle.problem, x):
            rows.append(ca.vec(relation.expression))
            kinds.append((relation.kind, rows[-1].numel()))
    else:
        for index, item in enumerate(curved):
            rows.append(served.constraint(item, f"constraint_{index}")(x))
            kinds.append((item.constraint.kind, rows[-1].numel()))
    g = ca.vertcat(*rows) if rows else ca.MX(0, 1)
    nlp = {"x": x, "f": served.objective(second_order=second_order)(x), "g": g}
    lower = np.concatenate(
        [np.full(size, 0.0 if kind == "equal" else -np.inf) for kind, size in kinds] or [np.zeros(0)]
    )
    hessian = _lagrangian_hessian(nlp, served, triangle) if second_order else None
    return Transcription(nlp, lower, np.zeros(len(lower)), not curved, served, hessian)


def lowered_sets(problem: Problem, x: Any) -> list[Any]:
    """Return the curved conditions of the sets as CasADi relations."""
    places = Layout(problem).slices()
    found = []
    for member in problem.memberships:
        variable, set_ = member.variable, member.set
        if all(condition.linear for condition in set_.constraints(variable.shape)):
            continue
        place = places[variable.name]
        lower: Any = getattr(set_, "lower")  # noqa: B009 - `second_order_obstacle` has made sure of it
        relations = lower(shaped(x[place.start : place.stop], variable), CasadiOps())
        found += [relation for relation in relations if not is_bound(relation, x)]
    return found


def second_order_obstacle(problem: Problem, largest: int) -> str | None:
    """Return why no dense Hessian of the Lagrangian can be had; None if it can."""
    layout = Layout(problem)
    for applied in problem.objective.terms:
        if not hasattr(applied.term, "hessian") or len(applied.variables) > 1:
            return f"it needs the Hessian of every term, and {applied} offers none; use casadi:ipopt"
    for name, (_, condition) in problem.constraints.items():
        if not condition.linear:
            return f"it needs the Hessian of every constraint, and {name!r} offers none; use casadi:ipopt"
    for member in problem.memberships:
        curved = not all(condition.linear for condition in member.set.constraints(member.variable.shape))
        if curved and not hasattr(member.set, "lower"):
            return f"it needs the Hessian of every constraint, and {member.set} has no `lower`; use casadi:ipopt"
    if layout.size > largest:
        return (
            f"it factorises a dense Hessian, O(n^3) a step: {layout.size} unknowns, at most {largest} work; "
            "use casadi:ipopt"
        )
    return None


def _lagrangian_hessian(nlp: dict[str, Any], served: Served, triangle: bool) -> Any:
    x, g = nlp["x"], nlp["g"]
    weight, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    total = weight * served.hessian_function()(x)
    if g.numel():
        curved, _ = ca.hessian(ca.dot(multipliers, g), x)
        total = total + curved
    full = "triu_hess_gamma_x_x" if triangle else "hess_gamma_x_x"
    return ca.Function(
        "nlp_hess_l",
        [x, ca.MX.sym("p", 0, 1), weight, multipliers],
        [ca.triu(total) if triangle else total],
        ["x", "p", "lam_f", "lam_g"],
        [full],
    )
