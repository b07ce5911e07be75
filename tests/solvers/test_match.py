"""Matching stage by stage: backends by stage, failures that stay visible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from nonrigid.formulations.formulation import Correspondence, Pair, Stages
from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.mesh import Mesh
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match
from nonrigid.solvers.status import Status

SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


@dataclass(frozen=True)
class TwoGames:
    """State two small games and match vertices to themselves."""

    size: int = 3

    def stages(self, pair: Pair) -> Stages:
        for name in ("first", "second"):
            u = Variable("u", self.size)
            solution = yield Problem(name, maximize(QuadraticForm(1.0 - np.eye(self.size))(u)), u @ Simplex())
            assert solution["u"].shape == (self.size,)
        return Correspondence.between_vertices(pair, np.arange(3), np.arange(3))


@pytest.fixture
def pair() -> Pair:
    return Pair.of(SQUARE, SQUARE, cache=None)


def test_every_stage_is_solved_recorded_and_timed(pair: Pair) -> None:
    found = match(pair, TwoGames())
    assert [solution.problem for solution in found.solutions] == ["first", "second"]
    assert found.correspondence is not None
    assert found.status is Status.STATIONARY
    assert found.solve_seconds > 0.0
    assert found.formulation_seconds >= 0.0
    assert found.message.startswith("first: ")


def test_a_stage_can_have_its_own_backend(pair: Pair) -> None:
    found = match(pair, TwoGames(), {"second": "native:replicator"})
    assert [solution.spec for solution in found.solutions][1] == "native:replicator"
    assert found.solutions[0].backend == "native"


def test_a_refused_stage_ends_the_match_and_says_why(pair: Pair) -> None:
    found = match(pair, TwoGames(), {"second": "native:generalised_power"})
    assert found.correspondence is None
    assert found.status is Status.REFUSED
    assert found.message.startswith("second: ")


def test_a_chain_falls_back_and_records_it(pair: Pair) -> None:
    found = match(pair, TwoGames(), ["native:generalised_power", "native:replicator"])
    assert found.correspondence is not None
    assert [attempt.status for attempt in found.solutions[0].attempts] == [Status.REFUSED, Status.STATIONARY]


def test_unknown_stages_and_formulations_are_named(pair: Pair) -> None:
    with pytest.raises(InputError, match="third"):
        match(pair, TwoGames(), {"third": "native"})
    with pytest.raises(InputError, match="stages"):
        match(pair, object())  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="choose one of"):
        match(pair, TwoGames(), "no-such-library")


def test_a_limit_before_the_first_point_ends_the_match(pair: Pair) -> None:
    found = match(pair, TwoGames(), limits=Limits(seconds=1e-9))
    assert found.correspondence is None
    assert found.status is Status.LIMIT
    assert found.message.startswith("first: 1e-09 s are spent before the first point; raise the limit")


@dataclass(frozen=True)
class Forgetful:
    """End without a correspondence."""

    answer: object = None

    def stages(self, pair: Pair) -> Stages:
        yield from TwoGames().stages(pair)
        return self.answer  # type: ignore[return-value]


@pytest.mark.parametrize("answer", [None, 3])
def test_stages_that_end_without_a_correspondence_are_refused(pair: Pair, answer: object) -> None:
    with pytest.raises(InputError, match=f"stages of Forgetful ended with {answer}; return a Correspondence"):
        match(pair, Forgetful(answer))


def test_a_negative_seed_is_refused(pair: Pair) -> None:
    with pytest.raises(InputError, match="seed is -1"):
        match(pair, TwoGames(), seed=-1)
