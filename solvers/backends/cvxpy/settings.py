"""How each solver of CVXPY is set: silent unless asked, as exact as wanted, and within the time left."""

from __future__ import annotations

from typing import Any

from nonrigid.solvers.limits import Limits

CONIC = ("CLARABEL", "SCS")  # these also take curved convex constraints
QUADRATIC = ("OSQP", "PIQP", "HIGHS")
NONLINEAR = ("nlp-UNO", "nlp-IPOPT")

_ITERATIONS = 100_000


def convex_options(algorithm: str, limits: Limits, seconds_left: float | None) -> dict[str, Any]:
    """Return the options of one convex solve; PIQP knows no time limit."""
    tight = max(min(1e-3 * limits.tolerance, 1e-2 * limits.feasibility), 1e-10)
    # A gap e of a strongly convex model leaves an error of sqrt(e) in its minimizer.
    gap = max(tight**2, 1e-13)
    options: dict[str, dict[str, Any]] = {
        "CLARABEL": {"tol_gap_abs": gap, "tol_gap_rel": gap, "tol_feas": tight},
        "SCS": {"eps_abs": tight, "eps_rel": tight, "max_iters": _ITERATIONS},
        "OSQP": {"eps_abs": tight, "eps_rel": tight, "max_iter": _ITERATIONS, "polishing": False},
        "PIQP": {
            "eps_abs": tight,
            "eps_rel": tight,
            "check_duality_gap": True,
            "eps_duality_gap_abs": gap,
            "eps_duality_gap_rel": gap,
        },
        "HIGHS": {"primal_feasibility_tolerance": max(tight, 1e-10), "dual_feasibility_tolerance": max(tight, 1e-10)},
    }
    chosen = options[algorithm] | {"verbose": limits.verbose}
    switch = {"CLARABEL": "time_limit", "SCS": "time_limit_secs", "OSQP": "time_limit", "HIGHS": "time_limit"}
    if seconds_left is not None and algorithm in switch:
        chosen[switch[algorithm]] = max(float(seconds_left), 1e-3)
    return chosen


def nonlinear_options(algorithm: str, limits: Limits) -> dict[str, Any]:
    """Return the options of one nonlinear solve."""
    tight = 0.1 * limits.tolerance
    if algorithm == "nlp-IPOPT":
        options: dict[str, Any] = {"tol": tight, "sb": "yes", "bound_push": 1e-8, "bound_frac": 1e-8}
        options["print_level"] = 5 if limits.verbose else 0
        return options if limits.seconds is None else options | {"max_wall_time": float(limits.seconds)}
    options = {"preset": "filtersqp", "logger": "INFO" if limits.verbose else "SILENT"}
    options |= {"primal_tolerance": 0.1 * limits.feasibility, "dual_tolerance": tight}
    return options if limits.seconds is None else options | {"time_limit": float(limits.seconds)}
