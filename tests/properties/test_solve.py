"""Properties of `solve` and `route`: starts, chains, attempts, bounds, names, refusals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Smooth, Sphere, Variable, maximize, minimize
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.solvers import backend as registry
from nonrigid.solvers.acceptance import Acceptance, Claim, Native, Refused, Via, via
from nonrigid.solvers.backend import Raw, backend_class, backend_names, make_backend, resolved
from nonrigid.solvers.bridges.body import ToBody
from nonrigid.solvers.bridges.radial import Radial
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.route import route
from nonrigid.solvers.solution import Bound, Solution
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing.instances import ball, convex_quadratic, planted_game, planted_payoff, two_variables

GAME = planted_game()


@dataclass(frozen=True)
class Stay:
    """Evaluate the start and return it."""

    algorithm: str = ""
    bridges: tuple[Any, ...] = ()
    name: ClassVar[str] = "stay"
    algorithms: ClassVar[tuple[str, ...]] = ("put",)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        return "put"

    def accepts(self, problem: Problem) -> Acceptance:
        return via(problem, *self.bridges) if self.bridges else Native()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        oracle.value_and_gradient(start)
        return Raw(start, "stayed")

    @classmethod
    def versions(cls) -> dict[str, str]:
        return {"stay": "1"}


def test_the_default_start_is_the_center_and_a_given_one_is_used() -> None:
    assert solve(GAME.problem, Stay())["u"] == pytest.approx(np.full(10, 0.1))
    answer = solve(GAME.problem, Stay(), start=GAME.values)
    assert answer.status is Status.STATIONARY
    assert answer.objective == pytest.approx(GAME.optimum)
    assert solve(GAME.problem, Stay(), start=answer).objective == answer.objective
    assert (answer.raw_status, answer.route, answer.claim, answer.spec) == (
        "stayed",
        ("stay:put",),
        "exact",
        "stay:put",
    )
    assert answer.attempts == ()
    assert "planted game by stay:put: stationary" in str(answer)


def test_many_starts_are_seeded_recorded_and_the_best_is_returned() -> None:
    answer = solve(GAME.problem, Stay(), starts=6, seed=3)
    assert len(answer.attempts) == 6
    assert answer.objective == max(attempt.objective for attempt in answer.attempts)
    again, other = (solve(GAME.problem, Stay(), starts=6, seed=seed) for seed in (3, 4))
    assert [a.objective for a in again.attempts] == [a.objective for a in answer.attempts]
    assert [a.objective for a in other.attempts] != [a.objective for a in answer.attempts]
    assert other.attempts[0].objective == answer.attempts[0].objective
    lowest = solve(convex_quadratic().problem, Stay(), starts=6)
    assert lowest.objective == min(attempt.objective for attempt in lowest.attempts)


def test_several_starts_of_the_replicator_reach_the_proved_optimum_in_a_small_game() -> None:
    answer = solve(GAME.problem, "native:replicator", starts=20)
    assert answer.objective == pytest.approx(GAME.optimum, abs=1e-5)
    certified = answer.with_bound(Bound(GAME.optimum, GAME.certificate, 0.0), tolerance=1e-4)
    assert certified.status is Status.CERTIFIED
    assert certified.certificate == "all 1023 supports"
    assert "gap" in str(certified)
    loose = answer.with_bound(Bound(GAME.optimum + 1.0, "loose", 0.0))
    assert loose.status is answer.status
    assert loose.gap == pytest.approx(1.0, abs=1e-4)
    assert (answer.gap, answer.certificate) == (None, None)
    below = solve(convex_quadratic().problem, Stay()).with_bound(Bound(0.0, "zero", 0.0))
    assert below.gap is not None
    assert below.gap > 0.0


def test_a_chain_stops_at_the_first_stationary_answer() -> None:
    answer = solve(GAME.problem, [Stay(), "native:replicator", Stay()])
    assert [attempt.backend for attempt in answer.attempts] == ["stay:put", "native:replicator"]
    assert answer.backend == "native"
    both = solve(GAME.problem, ["native:replicator", "native:replicator"], limits=Limits(evaluations=2))
    assert [attempt.status for attempt in both.attempts] == [Status.LIMIT, Status.LIMIT]
    assert "2 evaluations are spent" in both.message
    assert both.evaluations == 2


def test_a_refusal_is_an_answer_and_a_point_is_preferred_to_it() -> None:
    refused = solve(two_variables().problem, "native:replicator")
    assert refused.status is Status.REFUSED
    assert not refused.values
    assert not refused.status.usable
    answer = solve(two_variables().problem, ["native:replicator", Stay()])
    assert answer.backend == "stay"
    assert [attempt.status for attempt in answer.attempts] == [Status.REFUSED, Status.FEASIBLE]


def test_a_point_is_preferred_to_a_limit_without_one() -> None:
    @dataclass(frozen=True)
    class Late(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            oracle.charge(100.0)
            return Raw(start, "not reached")

    @dataclass(frozen=True)
    class Lost(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            oracle.value_and_gradient(start)
            raise RuntimeError

    answer = solve(GAME.problem, [Late(), Lost()], limits=Limits(evaluations=5))
    assert [attempt.status for attempt in answer.attempts] == [Status.LIMIT, Status.BACKEND_ERROR]
    assert answer.values
    assert "before the first point" in answer.attempts[0].message


def test_the_better_of_last_and_best_is_kept_even_if_violations_differ_by_rounding() -> None:
    @dataclass(frozen=True)
    class Wander(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            oracle.value_and_gradient(GAME.values["u"])
            oracle.value_and_gradient(start)
            return Raw(start, "wandered off")

    @dataclass(frozen=True)
    class Unseen(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            oracle.value_and_gradient(start)
            return Raw(GAME.values["u"] * 1.7, "never evaluated")

    for backend in (Wander(), Unseen()):
        assert solve(GAME.problem, backend).objective == pytest.approx(GAME.optimum, abs=1e-12)


def test_a_backend_that_never_returns_a_point_is_a_backend_error() -> None:
    @dataclass(frozen=True)
    class Silent(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            return Raw(None, "optimal")

    answer = solve(GAME.problem, Silent())
    assert answer.status is Status.BACKEND_ERROR
    assert "no point was returned" in answer.message


def test_a_term_that_fails_inside_a_library_that_swallows_it_is_named() -> None:
    @dataclass(frozen=True)
    class Swallows(Stay):
        def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
            try:
                oracle.value_and_gradient(start)
            except RuntimeError:
                return Raw(start, "optimal")
            raise AssertionError

    def fail(x: FloatArray) -> Any:
        raise RuntimeError("the term's own words")

    u = Variable("u", 2)
    answer = solve(Problem("p", minimize(Smooth(fail, fail)(u)), u @ Simplex()), Swallows())
    assert answer.status is Status.BACKEND_ERROR
    assert "the term's own words" in answer.message


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"backend": []}, "the chain of backends is empty"),
        ({"starts": 0}, "starts is 0"),
        ({"start": {"u": np.ones(3)}}, r"the start has shapes \{'u': \(3,\)\}"),
        ({"start": {"w": np.ones(10)}}, "the problem's variables have"),
        ({"start": {"u": np.full(10, np.nan)}}, "10 entries of 'u' that are not finite"),
    ],
)
def test_wrong_arguments_are_refused_in_words(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve(GAME.problem, **arguments)


def test_unknown_names_list_those_that_exist() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown backend 'gurobi'; choose one of: .*native"):
        solve(GAME.problem, "gurobi")
    with pytest.raises(UnknownNameError, match=r"unknown algorithm of native 'nope'; choose one of: .*replicator"):
        make_backend("native:nope")
    assert "native" in backend_names()


def test_a_registered_backend_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    class Entry:
        name = "stay"

        def load(self) -> type[Stay]:
            return Stay

    monkeypatch.setattr(registry, "entry_points", lambda group: [Entry()] if group == "nonrigid.backends" else [])
    assert backend_names()[-1] == "stay"
    assert backend_class("stay") is Stay
    assert resolved(make_backend("stay"), GAME.problem).algorithm == "put"
    backend_class.cache_clear()


def test_routes_name_every_algorithm_and_refusals_say_why() -> None:
    rows = route(ball().problem, ["native"])
    assert [row.algorithm for row in rows] == list(backend_class("native").algorithms)
    assert all(isinstance(row.acceptance, Refused) and "in the ball" in str(row.acceptance) for row in rows)


def test_bridges_make_a_route_and_an_exact_answer() -> None:
    u = Variable("u", 10)
    spectral = Problem("spectral", maximize(QuadraticForm(planted_payoff(10))(u)), u @ Sphere())
    for bridge in (Radial(), ToBody()):
        answer = solve(spectral, Stay(bridges=(bridge,)))
        assert answer.route == (bridge.name, "stay:put")
        assert answer.claim == "exact"
        assert answer.violation <= 1e-12
    assert str(via(spectral, ToBody())) == "via surface to body"
    assert isinstance(via(spectral, Radial()), Via)
    twice = via(spectral, Radial(), Radial())
    assert str(twice) == "refused: the radial bridge needs a variable on a simplex, elastic net or sphere"
    assert solve(spectral, Stay(bridges=(Radial(), Radial()))).status is Status.REFUSED


@pytest.mark.parametrize(
    ("bridge", "problem", "words"),
    [
        (Radial(), ball().problem, "no named constraints"),
        (Radial(), two_variables().problem, "terms of one variable, and SquaredGap"),
        (ToBody(), ball().problem, "a variable on a simplex"),
        (ToBody(), convex_quadratic().problem, "a problem that maximizes"),
        (ToBody(), Problem("p", maximize(-1.0 * GAME.problem.objective.terms[0]), *GAME.problem.memberships), "fall"),
    ],
)
def test_bridges_say_what_they_need(bridge: Any, problem: Problem, words: str) -> None:
    assert words in bridge.obstacle(problem)


def test_a_weaker_claim_of_a_bridge_stands_in_the_solution() -> None:
    answer = solve(GAME.problem, Stay(bridges=(Radial(claim=Claim.LOCAL),)))
    assert answer.claim == "local"


def test_isolated_solves_agree_with_those_in_process() -> None:
    limits = Limits(hard_seconds=30.0)
    apart, here = (solve(GAME.problem, "native:replicator", limits=given) for given in (limits, Limits()))
    np.testing.assert_array_equal(apart["u"], here["u"])
    assert isinstance(apart, Solution)
    assert apart.status is here.status
