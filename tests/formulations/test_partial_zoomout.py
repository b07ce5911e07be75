"""Growing maps from few matches: the weighted first map, every start, and the numbers of repaired views."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.model.stiefel import Stiefel
from nonrigid.formulations.partial_zoomout import PartialZoomOut, first_map, sample_areas
from nonrigid.formulations.spectral_growth import bases
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve

SMALL = PartialZoomOut(
    radii=(0.08, 0.15), part_samples=120, full_samples=500, fitted_samples=400, steps=6, part_size=60, full_size=120
)


@pytest.fixture(scope="module")
def pair(creature: PairData) -> Pair:
    return Pair.of(random_rigid_motion(creature.part)[0], creature.full)


@pytest.mark.parametrize("start", ["gt", "en"])
def test_a_creature_is_matched_at_every_vertex(creature: PairData, pair: Pair, start: str) -> None:
    method = PartialZoomOut(**{**vars(SMALL), "start": start})
    outcome = match(pair, method)
    assert outcome.correspondence is not None
    assert [solution.problem for solution in outcome.solutions].count("map") == SMALL.steps
    result = score(creature, outcome.correspondence.dense(len(creature.part.vertices)))
    assert result.unmatched_count == 0
    assert result.mean_error < 0.08
    assert 0.0 <= outcome.correspondence.confidence.min() < outcome.correspondence.confidence.max() <= 1.0


def test_a_start_from_descriptors_states_no_problem_of_its_own(pair: Pair) -> None:
    method = PartialZoomOut(**{**vars(SMALL), "start": "descriptors", "steps": 2})
    assert [solution.problem for solution in match(pair, method).solutions] == ["first map", "map", "map"]


def test_the_first_map_is_the_best_orthonormal_one_in_the_mean_over_areas(pair: Pair) -> None:
    descriptors = trusted_descriptors(pair, (0.15,), power=1.0)
    basis = bases(
        pair, descriptors, part_size=30, full_size=60, descriptor_weight=0.0, components=10, last_components=10
    )
    rng = np.random.default_rng(0)
    part, full = rng.integers(0, len(basis.part), 40), rng.integers(0, len(basis.full), 40)
    weight = sample_areas(pair.part, np.unique(part))[np.searchsorted(np.unique(part), part)]
    C = solve(first_map(basis, part, full, weight, 20))["C"]

    def gap(C: np.ndarray) -> float:
        sent = basis.part[part, : C.shape[1]] @ C.T - basis.full[full, : len(C)]
        return float(weight @ np.sum(sent * sent, axis=1))

    assert all(gap(C) <= gap(Stiefel().sample(C.shape, rng)) for _ in range(50))


def test_the_areas_around_samples_are_the_surface(pair: Pair) -> None:
    areas = sample_areas(pair.part, pair.part.samples(50))
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(pair.part.area, rel=1e-6)


def test_matches_come_back_in_the_numbers_of_the_views(pair: Pair) -> None:
    part, full = pair.part.samples(20), pair.full.samples(20)
    again = Correspondence.between_vertices(pair, part, full).view_vertices(pair)
    order = np.argsort(part)
    np.testing.assert_array_equal(again[0], part[order])
    np.testing.assert_array_equal(again[1], full[order])


def test_settings_without_sense_are_refused(pair: Pair) -> None:
    with pytest.raises(UnknownNameError, match="start"):
        next(PartialZoomOut(start="truth").stages(pair))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="first_size"):
        next(PartialZoomOut(**{**vars(SMALL), "start": "descriptors", "first_size": 1}).stages(pair))
