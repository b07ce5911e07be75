"""What became of a solve: one meaning for every backend."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """Say what is known of a solution, by the package's own measurement; a backend's own words decide nothing.

    Examples
    --------
    >>> Status("limit").advice
    'raise the limit, or choose a faster backend; the best point found is kept'
    """

    CERTIFIED = "certified"
    STATIONARY = "stationary"
    FEASIBLE = "feasible"
    LIMIT = "limit"
    INFEASIBLE = "infeasible"
    NUMERICAL_ERROR = "numerical_error"
    BACKEND_ERROR = "backend_error"
    REFUSED = "refused"

    @property
    def advice(self) -> str:
        """What the user can do next."""
        return _ADVICE[self]

    @property
    def usable(self) -> bool:
        """Whether the values lie in their sets and may be used as an answer."""
        return self in (Status.CERTIFIED, Status.STATIONARY, Status.FEASIBLE, Status.LIMIT)


_ADVICE = {
    Status.CERTIFIED: "a bound proves the objective optimal to the stated gap",
    Status.STATIONARY: "a local optimum to first order; ask for a bound, or for several starts, to learn more",
    Status.FEASIBLE: "the backend stopped before first-order optimality; tighten its tolerance or polish natively",
    Status.LIMIT: "raise the limit, or choose a faster backend; the best point found is kept",
    Status.INFEASIBLE: "no point in the sets was reached; check the constraints or try another start",
    Status.NUMERICAL_ERROR: "a value was not finite; check the problem's data with nonrigid.solvers.testing.check_term",
    Status.BACKEND_ERROR: "the backend failed; its words are in raw_status; give a chain of backends to fall back on",
    Status.REFUSED: "this backend cannot take this problem; `nonrigid solvers` lists those that can",
}
