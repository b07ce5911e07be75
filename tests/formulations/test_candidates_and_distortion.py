"""Candidates by descriptor, and how pairs of them agree."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.formulations.candidates import Candidates, candidate_matches
from nonrigid.formulations.distortion import consistency, distortion
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.localisation import local_matches, multilateration_cost
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.points import SurfacePoints

RADII = (0.10,)


@pytest.fixture(scope="module")
def pair() -> Pair:
    """Return a built-in pair."""
    data = Creatures(vertices=1000).pairs()[0].load()
    return Pair.of(data.part, data.full, cache=None)


@pytest.fixture(scope="module")
def itself() -> Pair:
    """Return a surface matched to itself."""
    full = Creatures(vertices=1000).pairs()[0].load().full
    return Pair.of(full, full, cache=None)


def test_a_surface_is_among_its_own_candidates_at_cost_zero(itself: Pair) -> None:
    matches = candidate_matches(itself, part_samples=50, full_samples=200, per_sample=3, radii=RADII)
    assert len(matches) == 150
    same = matches.part == matches.full
    assert same.sum() == 50
    assert matches.cost[same].max() < 1e-12


def test_small_surfaces_give_all_their_vertices(pair: Pair) -> None:
    matches = candidate_matches(pair, part_samples=10**6, full_samples=10**6, per_sample=1, radii=RADII)
    assert len(matches) == len(pair.part.mesh.vertices)


@pytest.mark.parametrize("name", ["part_samples", "full_samples", "per_sample"])
def test_numbers_below_one_are_refused(pair: Pair, name: str) -> None:
    with pytest.raises(InputError, match=name):
        candidate_matches(pair, **{name: 0})


def test_greedy_choices_share_no_vertex_and_keep_the_heaviest() -> None:
    matches = Candidates(np.array([0, 0, 1, 2]), np.array([5, 6, 5, 7]), np.zeros(4))
    weight = np.array([0.4, 0.3, 0.2, 1e-9])
    assert matches.greedy(weight).tolist() == [0]
    assert sorted(matches.greedy(np.array([0.1, 0.3, 0.2, 0.1])).tolist()) == [1, 2, 3]


def test_true_matches_of_a_surface_to_itself_have_no_distortion(itself: Pair) -> None:
    vertices = itself.part.samples(20)
    matches = Candidates(vertices, vertices, np.zeros(20))
    assert distortion(itself, matches).max() < 1e-12
    payoff = consistency(itself, matches)
    assert np.array_equal(payoff, payoff.T)
    assert np.allclose(payoff + np.eye(20), 1.0)


def test_payoff_is_half_at_the_kernel_width_and_zero_in_conflict(pair: Pair) -> None:
    matches = candidate_matches(pair, part_samples=20, full_samples=60, per_sample=3, radii=RADII)
    far = distortion(pair, matches)
    payoff = consistency(pair, matches, kernel_width=0.05)
    free = ~matches.conflicts()
    assert np.allclose(payoff[free], 0.5 ** ((0.5 * (far + far.T)[free] / 0.05) ** 2), atol=1e-9)
    assert payoff[~free].max() == 0.0


def test_one_sided_distortion_forgives_longer_ways_on_the_part_only(pair: Pair) -> None:
    matches = candidate_matches(pair, part_samples=20, full_samples=60, per_sample=3, radii=RADII)
    both = distortion(pair, matches)
    one = distortion(pair, matches, sides="one-sided", excess_weight=0.3)
    certified = distortion(pair, matches, sides="certified", excess_weight=0.3)
    on_part = pair.part.distances_between(matches.part)
    longer = on_part > pair.full.distances_between(matches.full)
    assert np.allclose(one[~longer], both[~longer])
    assert np.allclose(one[longer], 0.3 * both[longer])
    assert (certified >= one - 1e-12).all()
    assert (certified <= both + 1e-12).all()


def test_wrong_options_of_the_distortion_are_refused(pair: Pair) -> None:
    matches = candidate_matches(pair, part_samples=5, full_samples=20, per_sample=1, radii=RADII)
    with pytest.raises(UnknownNameError, match="two-sided"):
        distortion(pair, matches, sides="both")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="kernel_width"):
        consistency(pair, matches, kernel_width=0.0)
    with pytest.raises(InputError, match="excess_weight"):
        distortion(pair, matches, sides="one-sided", excess_weight=2.0)
    with pytest.raises(InputError, match='geodesics="dijkstra"'):
        distortion(pair, matches, sides="certified", geodesics="bridged")


def test_multilateration_is_least_at_the_true_point(itself: Pair) -> None:
    anchors = Candidates(itself.part.samples(30), itself.full.samples(30), np.zeros(30))
    points = np.arange(0, 1000, 37)
    cost = multilateration_cost(itself, points, anchors, reach=0.25, descriptor_weight=0.02, radii=RADII)
    assert np.abs(cost.min(axis=1)).max() < 1e-9
    assert np.array_equal(cost.argmin(axis=1), points)
    local = local_matches(itself, points, anchors, count=4, farthest=0.3, radii=RADII)
    assert np.isin(points, local.full[local.part == local.full]).all()


def test_a_part_larger_than_the_whole_is_refused(pair: Pair) -> None:
    with pytest.raises(InputError, match="times the area"):
        Pair.of(pair.full.raw.transformed(scale=2.0), pair.full.raw, cache=None)


def test_a_correspondence_matches_a_vertex_once() -> None:
    points = SurfacePoints([0, 0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    with pytest.raises(InputError, match="twice"):
        Correspondence(np.array([3, 3]), points, np.ones(2))
    with pytest.raises(InputError, match="lengths"):
        Correspondence(np.array([3]), points, np.ones(2))
