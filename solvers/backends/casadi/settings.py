"""How each solver of CasADi is set: silent unless asked, as exact as wanted, and within the time given."""

from __future__ import annotations

from typing import Any

import casadi as ca

from nonrigid.solvers.backends.casadi.transcription import Transcription
from nonrigid.solvers.limits import Limits

# QP solvers of CasADi that load here. Left out on purpose: highs, whose library, once loaded, keeps highspy from
# loading in the same process; qpoases, which prints its licence at every solve; cbc, clp, hpipm, which take no such
# program.
QP_PLUGINS = tuple(name for name in ("qrqp", "osqp", "daqp", "piqp", "proxqp") if ca.has_conic(name))
_TALK = 5  # level at which IPOPT prints a line an iteration
_UNBOUNDED = 10**9  # the solvers' own limits on iterations are lifted: the oracle keeps the limits
_QUIET = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}


def solver_options(
    algorithm: str, limits: Limits, nlp: Transcription, *, memory: int, bound_push: float
) -> dict[str, Any]:
    """Return the options of `casadi.nlpsol`."""
    plugin, _, part = algorithm.partition("-")
    if plugin == "ipopt":
        options: dict[str, Any] = {**_QUIET, "ipopt": _ipopt(limits, nlp, bound_push, exact=part == "hessian")}
        if part == "hessian":
            options["hess_lag"] = nlp.hessian
        else:
            options["ipopt"]["limited_memory_max_history"] = memory
        return options
    if plugin == "sqpmethod":
        return {**_QUIET, **_sqp(part or "qrqp", limits, memory)}
    if plugin == "bonmin":
        return {**_QUIET, "hess_lag": nlp.hessian, "bonmin": _bonmin(limits)}
    # Uno has no option for the Hessian; left to itself CasADi takes a minute to derive one from callbacks at n = 500.
    return {**_QUIET, "cache": {"nlp_hess_l": nlp.hessian}, "uno": _uno(limits)}


def _ipopt(limits: Limits, nlp: Transcription, bound_push: float, *, exact: bool) -> dict[str, Any]:
    # The Frank-Wolfe gap sums the complementarity products that IPOPT bounds one by one, hence the factors.
    tight = 1e-3 * limits.tolerance
    options: dict[str, Any] = {
        "print_level": _TALK if limits.verbose else 0,
        "sb": "yes",
        "tol": tight,
        "compl_inf_tol": tight,
        "constr_viol_tol": min(limits.feasibility, 1e-8),
        "acceptable_tol": 10.0 * tight,
        "max_iter": _UNBOUNDED,
        "hessian_approximation": "exact" if exact else "limited-memory",
        "bound_relax_factor": 0.0,
        **dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), bound_push),
    }
    if limits.seconds is not None:
        # The oracle ends the solve at the limit, its own work not counted; IPOPT's clock counts it and is a backstop
        # only.
        options["max_wall_time"] = 3.0 * limits.seconds
    if nlp.linear:
        options |= {"jac_c_constant": "yes", "jac_d_constant": "yes"}
    return options


def _sqp(plugin: str, limits: Limits, memory: int) -> dict[str, Any]:
    inner: dict[str, Any] = {"error_on_fail": False, "print_time": False}
    quiet: dict[str, dict[str, Any]] = {
        "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
        "osqp": {"osqp": {"verbose": False, "eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 20000}},
        "proxqp": {"proxqp": {"eps_abs": 1e-10, "eps_rel": 0.0, "max_iter": 10000}},
    }
    return {
        "qpsol": plugin,
        "qpsol_options": inner | quiet.get(plugin, {}),
        "hessian_approximation": "limited-memory",
        "lbfgs_memory": memory,
        "max_iter": 10000,
        "tol_du": 0.1 * limits.tolerance,
        "tol_pr": 0.1 * limits.feasibility,
        "print_header": False,
        "print_iteration": limits.verbose,
        "print_status": limits.verbose,
    }


def _bonmin(limits: Limits) -> dict[str, Any]:
    options: dict[str, Any] = {
        "print_level": _TALK if limits.verbose else 0,
        "sb": "yes",
        # Branch and bound on interior points; the outer approximations call such problems infeasible (measured).
        "algorithm": "B-BB",
        "allowable_gap": 0.1 * limits.tolerance,
        "allowable_fraction_gap": 0.1 * limits.tolerance,
        "integer_tolerance": 1e-8,
    }
    if limits.seconds is not None:
        options["time_limit"] = float(limits.seconds)
    return options


def _uno(limits: Limits) -> dict[str, Any]:
    options: dict[str, Any] = {
        "logger": "INFO" if limits.verbose else "SILENT",
        "preset": "filtersqp",
        "primal_tolerance": 0.1 * limits.feasibility,
        "dual_tolerance": 0.1 * limits.tolerance,
    }
    if limits.seconds is not None:
        options["time_limit"] = float(limits.seconds)
    return options
