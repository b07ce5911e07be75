"""Growing maps: how often the last is fitted again, what is corrected before a fit, and what turned patches cost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.judged_maps import Ground
from nonrigid.formulations.orientation import Orientation
from nonrigid.formulations.sampled_distances import sampled_distances
from nonrigid.formulations.spectral_growth import AGAIN, bases, grown
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.solvers.solve import solve


@pytest.fixture(scope="module")
def ground(creature: PairData) -> Ground:
    pair = Pair.of(creature.part, creature.full)
    descriptors = trusted_descriptors(pair, (0.08, 0.15), power=1.0)
    samples = sampled_distances(pair, descriptors, part_samples=200, placed_samples=400, full_samples=700)
    basis = bases(
        pair, descriptors, part_size=60, full_size=120, descriptor_weight=0.004, components=20, last_components=40
    )
    return Ground(pair, basis, samples, samples, Orientation.of(pair, samples.points))


@pytest.fixture(scope="module")
def true_images(creature: PairData, ground: Ground) -> IntArray:
    full, part = ground.pair.full, ground.pair.part
    nearest = full.clean_view.from_raw(creature.truth).nearest_corner(full.mesh)
    return np.asarray(nearest[part.clean_view.raw_of_vertex[ground.along.points]], dtype=np.int64)


def grow(
    ground: Ground,
    images: IntArray,
    corrected: Callable[[IntArray], IntArray] | None = None,
    unsettled: Callable[[IntArray], bool] | None = None,
) -> tuple[int, FloatArray, IntArray]:
    """Return how many maps were fitted, the last one, and its images."""
    steps = grown(
        ground.basis,
        ground.along.points,
        images,
        ground.basis.sizes(20, 3),
        grid=ground.along.grid,
        corrected=corrected,
        unsettled=unsettled,
    )
    fits, problem = 0, next(steps)
    while True:
        fits += 1
        try:
            problem = steps.send(solve(problem))
        except StopIteration as end:
            return (fits, *end.value)


def test_the_last_map_is_fitted_again_while_it_is_unsettled(ground: Ground, true_images: IntArray) -> None:
    calls: list[IntArray] = []

    def twice(images: IntArray) -> bool:
        calls.append(images)
        return len(calls) < 3

    assert grow(ground, true_images)[0] == 3
    fits, C, images = grow(ground, true_images, unsettled=twice)
    assert fits == 3 + 2
    assert len(C) == ground.basis.sizes(20, 3)[-1]
    np.testing.assert_array_equal(calls[-1], images)
    assert grow(ground, true_images, unsettled=lambda images: True)[0] == 3 + AGAIN


def test_images_are_corrected_before_every_fit_but_the_first(ground: Ground, true_images: IntArray) -> None:
    seen: list[IntArray] = []

    def to_truth(images: IntArray) -> IntArray:
        seen.append(images)
        return true_images

    fits, _, images = grow(ground, np.roll(true_images, 100), to_truth)
    assert (fits, len(seen)) == (3, 2)
    places = ground.pair.full.mesh.vertices
    apart = np.linalg.norm(places[images] - places[true_images], axis=1)
    assert np.median(apart) < 0.02
    assert np.median(np.linalg.norm(places[seen[0]] - places[true_images], axis=1)) > 0.1


def test_samples_in_patches_that_are_turned_over_have_no_confidence(ground: Ground, true_images: IntArray) -> None:
    orientation, places = ground.orientation, ground.pair.full.mesh.vertices
    C = np.eye(2)
    right = ground.judged(C, true_images, true_images)
    assert orientation.turned_over(true_images).mean() < 0.01
    # A patch of neighbours is laid down mirrored: each goes where its own mirror image in the patch's plane lies.
    middle = int(orientation.sense(true_images).argmax())
    patch = np.r_[middle, orientation.near[middle]]
    centre = places[true_images[patch]].mean(axis=0)
    axis = np.linalg.svd(places[true_images[patch]] - centre)[2][0]
    aims = places[true_images[patch]] - 2.0 * ((places[true_images[patch]] - centre) @ axis)[:, None] * axis
    wrong = true_images.copy()
    wrong[patch] = np.linalg.norm(places[None] - aims[:, None], axis=2).argmin(axis=1)
    over = orientation.turned_over(wrong)
    assert over[middle]
    worse = ground.judged(C, wrong, wrong)
    confidence = ground.confidence(ground.along.points, wrong)
    assert worse.score == pytest.approx(confidence[~over].sum() / len(over))
    assert worse.score < right.score
