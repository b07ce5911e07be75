"""How long a solve may take, how exact it should be, and whether the solver may speak."""

from __future__ import annotations

from dataclasses import dataclass

from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bound a solve.

    Parameters
    ----------
    evaluations
        Largest number of evaluations of objective and gradient; None for no bound. A column of a constant Hessian of n
        columns counts 1/n.
    seconds
        Wall-clock time of the solver, kept between evaluations: a long evaluation or a library's own inner work can
        exceed it. The package's own measurements are not counted. None for no bound.
    hard_seconds
        Wall-clock time after which the solve is killed: it then runs in a child process, and the best point that had
        been reported is kept. None (default) runs in this process.
    memory_gb
        Memory, in gigabytes of 10^9 bytes, that a solve may take beyond what its process holds when it begins: it then
        runs in a child process (Linux only). None (default) for no bound.
    tolerance
        Stationarity, relative to max(1, |objective|), at which a point counts as stationary; backends are asked to go
        a little beyond it.
    feasibility
        Largest violation at which a point counts as lying in its sets.
    verbose
        Whether the solver's library may print what it does; a benchmark keeps that in the run's log. NLopt, SciPy's
        L-BFGS-B and the native algorithms have nothing to say.

    Examples
    --------
    >>> Limits(seconds=5).tolerance
    1e-06
    """

    evaluations: int | None = None
    seconds: float | None = 60.0
    hard_seconds: float | None = None
    memory_gb: float | None = None
    tolerance: float = 1e-6
    feasibility: float = 1e-7
    verbose: bool = False

    def __post_init__(self) -> None:
        for name in ("evaluations", "seconds", "hard_seconds", "memory_gb"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"{name} is {value}", remedy="give a positive number, or None for no limit")
        for name in ("tolerance", "feasibility"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} is {getattr(self, name)}", remedy="give a small positive number")
