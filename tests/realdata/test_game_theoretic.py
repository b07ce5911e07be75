"""Game-theoretic matching of real surfaces, randomly moved: a small set for continuous integration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.solvers.bounds.bound import bound
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

pytestmark = pytest.mark.realdata


@pytest.mark.parametrize("name", ["cuts_wolf_shape_7", "holes_wolf_shape_1"])
def test_matches_are_within_two_per_cent(data: Path, name: str) -> None:
    (spec,) = Shrec16(root=data, names=(name,)).pairs()
    pair = spec.load()
    part, _, _ = random_rigid_motion(pair.part, seed=0)
    found = match(Pair.of(part, pair.full), GameTheoretic())
    assert found.correspondence is not None
    scored = score(pair, found.correspondence.dense(len(part.vertices)))
    assert scored.mean_error < 0.02
    assert scored.match_count >= 40


def test_the_game_on_a_shortlist_is_solved_to_proved_optimality(data: Path) -> None:
    (spec,) = Shrec16(root=data, names=("cuts_wolf_shape_7",)).pairs()
    pair = spec.load()
    shortlist = GameTheoretic(part_samples=20, full_samples=300, per_sample=10)
    game = next(shortlist.stages(Pair.of(pair.part, pair.full)))
    assert game.variables[0].size == 200
    answer = solve(game, starts=20)
    proved = answer.with_bound(bound(game, "doubly_nonnegative", seconds=60.0))
    assert proved.status is Status.CERTIFIED
    assert proved.gap is not None
    assert abs(proved.gap) <= 1e-6
    assert np.isclose(answer["u"].sum(), 1.0)
