"""Candidates by descriptor, and how pairs of them agree."""

from __future__ import annotations

import numpy as np
import pytest

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.methods import make_method
from nonrigid.formulations.candidates import Candidates, candidate_matches
from nonrigid.formulations.distortion import consistency, distortion
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.formulations.localisation import local_matches, multilateration_cost
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.solvers.match import match

RADII = (0.10,)
SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


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


def test_vertices_with_hardly_a_neighbour_are_no_ground_for_candidates() -> None:
    creature = next(spec for spec in Creatures(vertices=600).pairs() if spec.split == "cuts").load()
    pair = Pair.of(creature.part, creature.full, cache=None)
    with pytest.raises(InputError, match=r"\d+% of the vertices of .* within 0.02 sqrt.*larger radii, or a finer mesh"):
        candidate_matches(pair, radii=(0.02,))
    with pytest.raises(InputError, match="radii is empty"):
        candidate_matches(pair, radii=())
    with pytest.raises(InputError, match=r"within 0\.02 sqrt"):
        trusted_descriptors(pair, (0.02,), power=1.0)


def test_a_part_in_another_unit_of_length_is_refused() -> None:
    with pytest.raises(InputError, match=r"1e-06 times the area .* the same unit of length"):
        Pair.of(SQUARE.transformed(scale=1e-3), SQUARE, cache=None)


@pytest.mark.parametrize(
    ("part", "full", "words"),
    [
        ([-1], [0], "part vertex -1 is not one"),
        ([0], [99], "full vertex 99 is not one"),
        ([0, 1], [0], "2 vertices of the part, 1 of the full surface, 2 confidences"),
        ([0.5], [0], "give a flat list of integers"),
    ],
)
def test_matches_of_what_is_no_vertex_are_refused(part: list[int], full: list[int], words: str) -> None:
    pair = Pair.of(SQUARE, SQUARE, cache=None)
    with pytest.raises(InputError, match=words):
        Correspondence.between_vertices(pair, part, full)
    found = Correspondence.between_vertices(pair, [3], [0])
    with pytest.raises(InputError, match="part vertex 3 is not one of the 2"):
        found.dense(2)


@pytest.mark.parametrize(
    ("method", "setting"),
    [
        ("gt", {"groups": 0}), ("gt", {"local_candidates": -1}), ("gt", {"local_reach": -1.0}),
        ("gt", {"radii": (-1.0,)}),
        ("gt", {"kernel_width": 0.0}), ("gt", {"excess_weight": 2.0}),
        ("en", {"floor": 1.0}), ("en", {"mix": 1.5}), ("en", {"part_samples": 0}),
        ("anchored", {"floor": 1.0}), ("anchored", {"kept": 1.5}), ("anchored", {"per_sample": 0}),
        ("anchored", {"part_samples": 0}), ("anchored", {"reach": 0.0}), ("anchored", {"local_reach": float("nan")}),
        ("anchored", {"growing_weight": -1.0}),
        ("pfm", {"closest_point_iterations": -1}), ("pfm", {"rounds": 0}), ("pfm", {"area_weight": -1.0}),
        ("zoomout", {"first_size": 1}), ("zoomout", {"components": 0}), ("pgw", {"part_samples": 0}),
        ("im", {"kept": 0.0}), ("im", {"per_sample": 0}),
    ],
)  # fmt: skip
def test_settings_out_of_range_are_refused_before_any_work(method: str, setting: dict[str, object]) -> None:
    formulation = make_method(method, setting)
    with pytest.raises(InputError, match=f"{next(iter(setting))} is .*give .*number"):
        match(Pair.of(SQUARE, SQUARE, cache=None), formulation)


def test_one_candidate_is_no_game() -> None:
    creature = next(spec for spec in Creatures(vertices=600).pairs() if spec.split == "cuts").load()
    pair = Pair.of(creature.part, creature.full, cache=None)
    with pytest.raises(InputError, match="1 candidate matches are no game"):
        match(pair, GameTheoretic(part_samples=1, per_sample=1))
