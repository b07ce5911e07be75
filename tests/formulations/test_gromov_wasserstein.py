"""Partial Gromov-Wasserstein matching: a planted plan, the winner of the starts, and a creature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.gromov_wasserstein import PartialGromovWasserstein
from nonrigid.formulations.model.transport_sets import PartialTransport
from nonrigid.geometry.errors import InputError
from nonrigid.solvers.match import Match, match

SMALL = PartialGromovWasserstein(
    radii=(0.08, 0.15), part_samples=80, full_samples=160, fitted_samples=400, steps=6, part_size=60, full_size=120
)


@pytest.fixture(scope="module")
def matched(creature: PairData) -> Match:
    return match(Pair.of(random_rigid_motion(creature.part)[0], creature.full), SMALL)


def test_a_creature_is_matched_at_every_vertex(creature: PairData, matched: Match) -> None:
    assert matched.correspondence is not None
    result = score(creature, matched.correspondence.dense(len(creature.part.vertices)))
    assert result.unmatched_count == 0
    assert result.mean_error < 0.08


def test_plans_are_stated_by_falling_weight_of_looks_and_then_from_an_even_one(matched: Match) -> None:
    plans = [solution for solution in matched.solutions if solution.problem == "transport"]
    assert len(plans) == len(SMALL.look_weights) + 2
    assert all(plan.status.value == "stationary" for plan in plans)
    assert all(plan.violation <= 1e-12 for plan in plans)


def test_all_of_the_part_finds_a_place_and_none_is_filled_twice(creature: PairData) -> None:
    pair = Pair.of(creature.part, creature.full)
    first = next(PartialGromovWasserstein(**{**vars(SMALL), "room": 1.3}).stages(pair))
    plans = first.memberships[0].set
    assert isinstance(plans, PartialTransport)
    assert plans.mass.sum() == pytest.approx(1.0)
    assert plans.capacity.sum() == pytest.approx(1.3 / pair.kept_area, rel=1e-6)


def test_a_surface_fits_into_itself(creature: PairData) -> None:
    pair = Pair.of(creature.full, creature.full)
    even = PartialGromovWasserstein(**{**vars(SMALL), "full_samples": 80, "look_weights": (0.1,), "even_start": False})
    outcome = match(pair, even)
    # Distances and looks of the identity are those of the surface itself: nothing remains to be paid.
    last = [solution for solution in outcome.solutions if solution.problem == "transport"][-1]
    assert last.objective == pytest.approx(0.0, abs=1e-6 + 4.0 * even.look_weight * 0.2)
    np.testing.assert_array_equal(last["T"].argmax(axis=1), np.arange(80))


@pytest.mark.parametrize(
    ("name", "value"), [("room", 0.5), ("look_weight", -1.0), ("look_weights", (0.1, float("nan")))]
)
def test_settings_without_sense_are_refused(creature: PairData, name: str, value: object) -> None:
    with pytest.raises(InputError):
        next(PartialGromovWasserstein(**{name: value}).stages(Pair.of(creature.part, creature.full)))


@pytest.mark.realdata
def test_a_real_holed_shape_is_matched(data: Path) -> None:
    real = Shrec16(root=data, names=("holes_david_shape_10",)).pairs()[0].load()
    few = PartialGromovWasserstein(
        radii=(0.1,), part_samples=150, full_samples=250, fitted_samples=500, steps=8, part_size=60, full_size=100
    )
    found = match(Pair.of(random_rigid_motion(real.part)[0], real.full), few).correspondence
    assert found is not None
    assert score(real, found.dense(len(real.part.vertices))).mean_error < 0.06
