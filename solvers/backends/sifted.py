"""Any backend on a game of thousands of strategies: it solves the few hundred that matter, the rest are priced."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from nonrigid.formulations.model import ElasticNet, Problem, QuadraticForm, Sense, Variable, maximize
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.solvers.acceptance import Acceptance, Native, Refused
from nonrigid.solvers.backend import Backend, Raw, backend_class, make_backend
from nonrigid.solvers.backends.native.payoff import Payoff
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.once import solve_once
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.solution import Solution, TracePoint
from nonrigid.solvers.structure import QuadraticGame, quadratic_game

_PLAYED = 1e-9  # shares below this one are an interior point's way of writing 0
_ENTRY = 1e-4  # share with which a strategy enters: inside the bounds, and little


@dataclass(frozen=True)
class Sifted:
    """Solve a quadratic game by another backend on a growing set of strategies.

    The optimum plays few of the strategies. A backend solves the game of those that are paid best; then one product
    tells what every strategy left out would earn against the answer. Those that would earn more than the players do
    replace the idle ones, until there are none: the answer is then stationary for the whole game.

    Parameters
    ----------
    algorithm
        The backend that solves the small games, and its algorithm.
    share, least
        Strategies of the first game: this share of all, and at least so many.

    Examples
    --------
    >>> from nonrigid.solvers.solve import solve
    >>> rng = np.random.default_rng(0)
    >>> A = 0.5 * rng.random((300, 300))
    >>> A[:20, :20] = 1.0
    >>> A = np.triu(A, 1) + np.triu(A, 1).T
    >>> u = Variable("u", 300)
    >>> answer = solve(Problem("game", maximize(QuadraticForm(A)(u)), u @ ElasticNet(mix=0.0)), "sifted:nlopt:LD_CCSAQ")
    >>> answer.status.value, round(answer.objective, 6)
    ('stationary', 0.95)

    Notes
    -----
    Source: the sifting of linear programming (Bixby, Gregory, Lustig, Marsten and Shanno, Very large-scale linear
    programming, Operations Research 1992), with the payoff as price.
    """

    algorithm: str = ""
    share: float = 0.1
    least: int = 100
    name: ClassVar[str] = "sifted"
    algorithms: ClassVar[tuple[str, ...]] = (
        "casadi:ipopt",
        "casadi:ipopt-hessian",
        "cvxpy:CLARABEL",
        "nlopt:LD_CCSAQ",
        "nlopt:LD_LBFGS",
        "nlopt:LD_SLSQP",
        "scipy:L-BFGS-B",
    )

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        """Return ipopt, the one that gains most."""
        return "casadi:ipopt"

    def accepts(self, problem: Problem) -> Acceptance:
        """Take quadratic games whose first small game the other backend takes."""
        game = quadratic_game(problem)
        if isinstance(game, str):
            return Refused(f"sifting needs {game}")
        few = np.arange(self._first_size(game.size))
        inner = make_backend(self.algorithm).accepts(_small_game(game, few))
        return inner if isinstance(inner, Refused) else Native()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        """Solve, price and let in, until no strategy left out would earn more."""
        game = quadratic_game(oracle.problem)
        assert not isinstance(game, str)
        payoff = Payoff(game.matrix)
        inner = make_backend(self.algorithm)
        oracle.built()
        members, shares = self._first(game, payoff, start, oracle)
        x, value = np.zeros(game.size), -np.inf
        while True:
            answer = _solved(game, members, shares, inner, oracle, _left(limits, oracle, game, members))
            if not answer.values:
                return Raw(x if x.any() else None, f"{answer.status.value}: {answer.message}")
            if answer.objective <= value:
                return Raw(x, f"no gain: {answer.raw_status}")
            x, value = np.zeros(game.size), answer.objective
            x[members] = np.where(answer["u"] > _PLAYED, answer["u"], 0.0)
            oracle.observe(x)
            oracle.charge(answer.evaluations * (len(members) / game.size) ** 2)
            g = _paid(payoff, x, oracle)
            entering = _entering(game.surface, x, g, members, limits.tolerance, self._first_size(game.size))
            if not len(entering):
                return Raw(x, f"no other strategy would earn more; {answer.raw_status}")
            played = np.flatnonzero(x)
            members = np.concatenate([played, entering])
            shares = np.concatenate([x[played], np.full(len(entering), _ENTRY)])

    def _first_size(self, size: int) -> int:
        return min(size, max(self.least, int(self.share * size)))

    def _first(
        self, game: QuadraticGame, payoff: Payoff, start: FloatArray, oracle: Oracle
    ) -> tuple[IntArray, FloatArray]:
        """Return the strategies that the start plays or that it pays best, and the shares to begin with.

        Where the start plays too many, the best paid of them stand for it.
        """
        count = self._first_size(game.size)
        x = game.surface.restore(start)
        oracle.observe(x)
        if np.count_nonzero(x) > count:
            best = _largest(_paid(payoff, x, oracle), 2 * count)
            x = np.zeros(game.size)
            x[best] = 1.0 / len(best)
            return _largest(_paid(payoff, x, oracle), count), np.full(count, 1.0 / count)
        members = _largest(np.where(x > 0.0, np.inf, _paid(payoff, x, oracle)), count)
        return members, np.maximum(x[members], _ENTRY)

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Return the versions of every library that may solve the small games."""
        names = sorted({word.partition(":")[0] for word in cls.algorithms})
        return {library: number for name in names for library, number in backend_class(name).versions().items()}


def _small_game(game: QuadraticGame, members: IntArray) -> Problem:
    matrix: Any = game.matrix[np.ix_(members, members)]
    u = Variable("u", len(members))
    objective = maximize(game.weight * QuadraticForm(matrix)(u))
    return Problem(f"game of {len(members)} of {game.size} strategies", objective, u @ game.surface)


def _solved(
    game: QuadraticGame, members: IntArray, shares: FloatArray, inner: Backend, oracle: Oracle, limits: Limits
) -> Solution:
    """Solve a small game; show its better points to the oracle, and charge it the inner solver's own time alone."""
    objective = oracle.problem.objective
    sign = 1.0 if objective.sense is Sense.MAXIMIZE else -1.0
    begun, apart = time.perf_counter(), 0.0

    def settle(solving: float) -> None:
        nonlocal apart
        spent = time.perf_counter() - begun - solving
        oracle.count_as_build(spent - apart)
        apart = spent

    def show(point: FloatArray, trace: TracePoint) -> None:
        nonlocal apart
        settle(trace.seconds)
        before = time.perf_counter()
        x = np.zeros(game.size)
        x[members] = point
        oracle.observe(x, objective=objective.constant + sign * trace.objective)
        apart += time.perf_counter() - before  # the oracle leaves this out by itself

    answer = solve_once(_small_game(game, members), inner, {"u": shares}, limits, show)
    settle(answer.solve_seconds)
    return answer


def _largest(g: FloatArray, count: int) -> IntArray:
    return np.sort(np.argpartition(-g, min(count, len(g)) - 1)[:count])


def _entering(
    surface: ElasticNet, x: FloatArray, g: FloatArray, members: IntArray, tolerance: float, most: int
) -> IntArray:
    """Return the strategies left out that earn more than what they would cost, the best first.

    With (1 - mix) 1'x + mix x'x = 1 a strategy with share 0 would raise x'Ax as soon as (Ax)_i exceeds
    (1 - mix) x'Ax / (1 + mix x'x): x'Ax itself on the simplex.
    """
    mean = float(x @ g)
    excess = g - (1.0 - surface.mix) * mean / (1.0 + surface.mix * float(x @ x))
    excess[members] = -np.inf
    earning = np.flatnonzero(excess > 0.1 * tolerance * max(1.0, mean))
    return earning[np.argsort(-excess[earning], kind="stable")][:most]


def _left(limits: Limits, oracle: Oracle, game: QuadraticGame, members: IntArray) -> Limits:
    """Return what is left of the limits, in evaluations of the small game."""
    seconds = None if limits.seconds is None else max(limits.seconds - oracle.seconds, 1e-3)
    evaluations = None
    if limits.evaluations is not None:
        evaluations = max(1, int((limits.evaluations - oracle.evaluations) * (game.size / len(members)) ** 2))
    return replace(limits, seconds=seconds, evaluations=evaluations, hard_seconds=None)


def _paid(payoff: Payoff, x: FloatArray, oracle: Oracle) -> FloatArray:
    """Return what every strategy earns against x, charged."""
    g, columns = payoff.product(x)
    oracle.charge(columns / payoff.size)
    return g


BACKEND = Sifted
