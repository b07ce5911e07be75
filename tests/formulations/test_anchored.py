"""Anchored matching: its closed form is the optimum, points between vertices, and invariance of the whole method."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ortho_group

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.anchored import LAST_STARTS, STARTS, Anchored
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.interpolation import closest_feature_points
from nonrigid.formulations.judged_maps import KEEPING, Ground
from nonrigid.formulations.orientation import Orientation
from nonrigid.formulations.sampled_distances import sampled_distances
from nonrigid.formulations.spectral_growth import bases, map_fit
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.maps import nearest_rows
from nonrigid.geometry.mesh import Mesh
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve

SMALL = Anchored(
    radii=(0.08, 0.15), part_samples=200, full_samples=700, fitted_samples=400, part_size=60, full_size=120, starts=2
)
"""Settings for meshes of 1,500 vertices, in whose triangles small SHOT balls find too few neighbours."""


def found(data: PairData, part: Mesh, full: Mesh, method: Anchored = SMALL) -> Correspondence:
    matched = match(Pair.of(part, full), method).correspondence
    assert matched is not None
    return matched


@pytest.fixture(scope="module")
def matched(creature: PairData) -> Correspondence:
    return found(creature, random_rigid_motion(creature.part)[0], creature.full)


@pytest.mark.parametrize("backend", ["native", "casadi:ipopt", "nlopt:LD_SLSQP", "scipy:SLSQP"])
def test_every_backend_reaches_the_closed_form_of_the_map_fit(backend: str) -> None:
    rough = np.random.default_rng(0).standard_normal((6, 4))
    solution = solve(map_fit("map", rough), backend)
    # The maximum of <K, C> over C'C = I is the sum of the singular values of K.
    assert solution.objective == pytest.approx(np.linalg.svd(rough, compute_uv=False).sum(), rel=1e-6)
    assert solution.violation <= 1e-7


def test_the_map_fit_recovers_an_orthonormal_map() -> None:
    true = ortho_group.rvs(7, random_state=1)[:, :4]
    solution = solve(map_fit("map", 3.0 * true))
    assert solution.status.value == "stationary"
    np.testing.assert_allclose(solution["C"], true, atol=1e-12)


def test_points_of_the_surface_are_found_in_its_own_coordinates(creature: PairData) -> None:
    full = creature.full
    rng = np.random.default_rng(0)
    faces = rng.integers(0, len(full.faces), 200)
    places = np.einsum("pc,pcx->px", rng.dirichlet(np.ones(3), 200), full.vertices[full.faces[faces]])
    corner = full.faces[faces, 0]
    points = closest_feature_points(places, full.vertices, full, corner)
    np.testing.assert_allclose(points.positions(full), places, atol=1e-9 * np.sqrt(full.area))


def test_all_principal_components_measure_like_the_descriptors(creature: PairData) -> None:
    """A rotation of the descriptors' coordinates keeps their inner products, hence every nearest vertex."""
    pair = Pair.of(creature.part, creature.full)
    descriptors = trusted_descriptors(pair, SMALL.radii, power=1.0)
    basis = bases(
        pair, descriptors, part_size=30, full_size=60, descriptor_weight=0.01, components=10, last_components=10**6
    )
    C, points = np.eye(40, 20), np.arange(0, len(pair.part.mesh.vertices), 7)
    turned = basis.queries(C, points, 10**6)
    size = turned.shape[1] - len(C)
    weight = np.pi * len(C) ** 2 * basis.descriptor_weight
    whole = (
        np.hstack([weight * descriptors.queries(points), turned[:, size:]]),
        np.hstack([descriptors.targets(), basis.full[:, : len(C)]]),
    )
    found = nearest_rows(turned, basis.targets(10**6)[:, : turned.shape[1]])[0]
    np.testing.assert_array_equal(nearest_rows(*whole)[0], found)
    fewer = basis.queries(C, points, basis.components)
    assert fewer.shape == (len(points), 10 + 40)
    grown = nearest_rows(fewer, basis.targets(basis.components)[:, : fewer.shape[1]])[0]
    np.testing.assert_array_equal(basis.images(C, points), grown)
    np.testing.assert_array_equal(basis.images(C, points, grown), grown)


def test_every_vertex_of_a_creature_is_matched_well(creature: PairData, matched: Correspondence) -> None:
    result = score(creature, matched.dense(len(creature.part.vertices)))
    assert result.unmatched_count == 0
    assert result.mean_error < 0.04
    assert np.ptp(matched.confidence) > 0.0
    assert 0.0 <= matched.confidence.min() <= matched.confidence.max() <= 1.0


def test_order_frame_and_scale_change_nothing(creature: PairData, matched: Correspondence) -> None:
    rng = np.random.default_rng(3)
    part, full = random_rigid_motion(creature.part)[0], creature.full
    for mesh_of, scale in ((random_rigid_motion(creature.part, 5)[0], 0.01), (part, 100.0)):
        order, target = rng.permutation(len(part.vertices)), rng.permutation(len(full.vertices))
        moved = Mesh(mesh_of.vertices[order] * scale, np.argsort(order)[part.faces])
        whole = random_rigid_motion(full, 7)[0]
        whole = Mesh(whole.vertices[target] * scale, np.argsort(target)[full.faces])
        again = found(creature, moved, whole)
        back = np.empty((len(part.vertices), 3))
        back[order[again.part_vertices]] = again.points.positions(Mesh(full.vertices[target], whole.faces))
        before = matched.dense(len(part.vertices)).positions(full)
        apart = np.linalg.norm(back - before, axis=1) / np.sqrt(full.area)
        assert np.quantile(apart, 0.99) < 1e-3


def test_images_that_move_together_are_nearer_the_truth(creature: PairData, matched: Correspondence) -> None:
    apart = found(creature, random_rigid_motion(creature.part)[0], creature.full, replace(SMALL, rigid_rounds=0))
    count = len(creature.part.vertices)
    together, alone = (score(creature, images.dense(count)).mean_error for images in (matched, apart))
    assert together < 0.9 * alone


def test_a_map_that_stays_unsure_is_started_in_every_way(creature: PairData) -> None:
    part = random_rigid_motion(creature.part)[0]
    hopeless = replace(
        SMALL,
        oriented=False,
        starts=len(STARTS + LAST_STARTS),
        enough=2.0,
        agreement=2.0,
        unsure=2.0,
        repeats=1,
        steps=2,
        last_steps=0,
    )
    named = [solution.problem for solution in match(Pair.of(part, creature.full), hopeless).solutions]
    groups = [len(list(run)) for name, run in groupby(named) if name == "game"]
    assert len(groups) == len(STARTS) + len(LAST_STARTS)
    assert groups[1] >= 1  # groups peeled off one after another
    tried = len(groups) + 1 + len(LAST_STARTS)  # once a start, once more the best and the last
    assert named.count("map") == 2 * 2 * tried  # freely and on a leash
    sure = [
        solution.problem for solution in match(Pair.of(part, creature.full), replace(hopeless, enough=0.0)).solutions
    ]
    assert sure[:3] == ["game", "map", "map"]


def test_three_starts_that_lead_to_the_same_map_are_enough(creature: PairData) -> None:
    pair = Pair.of(random_rigid_motion(creature.part)[0], creature.full)
    few = replace(SMALL, oriented=False, starts=6, enough=2.0, unsure=0.0, repeats=0, steps=2, last_steps=0)

    def starts(method: Anchored) -> float:
        named = [solution.problem for solution in match(pair, method).solutions]
        return named.count("map") / few.steps

    assert starts(replace(few, agreement=0.0)) == 3
    assert starts(replace(few, agreement=2.0)) == 6
    # Without ways across what was cut out, starts that go along the part would repeat others.
    assert starts(replace(few, agreement=2.0, bridged=False)) == sum(start.bridged for start in STARTS + LAST_STARTS)


def test_agreement_is_the_share_of_samples_in_the_same_place(creature: PairData) -> None:
    pair = Pair.of(creature.part, creature.full)
    descriptors = trusted_descriptors(pair, SMALL.radii, power=1.0)
    along = sampled_distances(pair, descriptors, part_samples=20, placed_samples=40, full_samples=70)
    basis = bases(
        pair, descriptors, part_size=30, full_size=60, descriptor_weight=0.01, components=9, last_components=9
    )
    ground = Ground(pair, basis, along, along, Orientation.of(pair, along.points))
    images = along.grid[:40]
    far = images.copy()
    far[:10] = along.grid[60:70]
    here, there = (ground.judged(np.eye(60, 30), np.arange(40), one) for one in (images, far))
    assert ground.agreement(here, here) == 1.0
    assert ground.agreement(here, there) == 0.75


def test_a_map_that_stays_unsure_also_grows_on_a_leash(creature: PairData) -> None:
    pair = Pair.of(random_rigid_motion(creature.part)[0], creature.full)
    few = replace(SMALL, oriented=False, starts=1, enough=0.0, repeats=1, steps=2, last_steps=3)
    counts = {
        unsure: [solution.problem for solution in match(pair, replace(few, unsure=unsure)).solutions].count("map")
        for unsure in (0.0, 2.0)
    }
    assert counts[0.0] == 2 + 3
    assert counts[2.0] == 2 * 2 + 3 + 3


def test_ways_across_what_was_cut_out_are_never_longer_and_count_half(creature: PairData) -> None:
    pair = Pair.of(creature.part, creature.full)
    descriptors = trusted_descriptors(pair, SMALL.radii, power=1.0)
    along = sampled_distances(pair, descriptors, part_samples=200, placed_samples=400, full_samples=700)
    bridged = along.measured(pair, "bridged")
    assert (bridged.on_part <= along.on_part + 1e-9).all()
    assert (bridged.on_part < along.on_part - 1e-3).any()
    assert bridged.measured(pair, "dijkstra").on_part.tobytes() == along.on_part.tobytes()
    basis = bases(
        pair, descriptors, part_size=30, full_size=60, descriptor_weight=0.01, components=9, last_components=9
    )
    ground = Ground(pair, basis, along, bridged, Orientation.of(pair, along.points))
    images = pair.full.samples(len(along.points))
    each = [way.confidence(pair, along.points, images, width=KEEPING) for way in (along, bridged)]
    assert np.allclose(ground.confidence(along.points, images), np.mean(each, axis=0))


def test_a_patch_sent_to_the_wrong_limb_is_brought_back(creature: PairData) -> None:
    pair = Pair.of(creature.part, creature.full)
    descriptors = trusted_descriptors(pair, SMALL.radii, power=1.0)
    samples = sampled_distances(pair, descriptors, part_samples=200, placed_samples=400, full_samples=700)
    where = pair.full.mesh.vertices
    true = pair.full.clean_view.from_raw(creature.truth).nearest_corner(pair.full.mesh)
    true = true[pair.part.clean_view.raw_of_vertex]
    wrong = int(np.linalg.norm(where - where[true[0]], axis=1).argmax())
    patch = np.flatnonzero(pair.part.distances([0])[0] < 0.05)
    assert 1 < len(patch) < 0.05 * len(true)
    nearest = true.copy()
    nearest[patch] = wrong
    rows, around = samples.strays(pair, np.arange(len(nearest)), nearest, 0.1, share=0.6, reach=0.12, keeping=KEEPING)
    assert set(patch) <= set(rows)
    off = np.linalg.norm(where[around] - where[true[rows]], axis=1)
    assert np.quantile(off[np.isin(rows, patch)], 0.9) < 0.1
    images = samples.leashed(pair, nearest[samples.points], 0.1, share=0.6, reach=0.12, descriptor_weight=0.03)
    assert not (images == wrong).any()


@pytest.mark.realdata
def test_a_real_cut_is_matched_at_every_vertex(data: Path) -> None:
    pair = Shrec16(root=data, names=("cuts_wolf_shape_2",)).pairs()[0].load()
    matched = found(pair, random_rigid_motion(pair.part)[0], pair.full, Anchored())
    result = score(pair, matched.dense(len(pair.part.vertices)))
    assert result.unmatched_count == 0
    assert result.mean_error < 0.02


def test_matches_can_be_kept_to_vertices_and_the_slow_growth_be_left_out(creature: PairData) -> None:
    part = random_rigid_motion(creature.part)[0]
    small = replace(SMALL, starts=1, repeats=0, unsure=0.0, steps=2, last_steps=0, between_vertices=False)
    result = match(Pair.of(part, creature.full), small)
    assert [solution.problem for solution in result.solutions] == ["game", "map", "map"]
    assert result.correspondence is not None
    assert (result.correspondence.points.barycentric.max(axis=1) == 1.0).all()


@pytest.mark.parametrize(
    "settings", [{"steps": 0}, {"starts": 7}, {"last_steps": -1}, {"leash": -0.1}, {"rigid_reach": 0.0}]
)
def test_numbers_out_of_range_are_refused(creature: PairData, settings: dict[str, int]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(settings))} is .*give a number "):
        match(Pair.of(creature.part, creature.full), replace(SMALL, **settings))  # type: ignore[arg-type]


def test_likeness_is_the_trusted_cosine_of_descriptors(creature: PairData) -> None:
    pair = Pair.of(creature.part, creature.full)
    seen = trusted_descriptors(pair, SMALL.radii, power=1.0)
    every = 32 * 10 * len(SMALL.radii)
    whole = bases(pair, seen, part_size=5, full_size=9, descriptor_weight=1.0, components=80, last_components=every)
    points, vertices = np.array([3, 50, 7]), np.array([8, 1, 90])
    expected = (seen.queries(points) * seen.targets()[vertices]).sum(axis=1)
    np.testing.assert_allclose(whole.likeness(points, vertices), expected, atol=1e-9)
    assert (np.abs(expected) <= 1.0 + 1e-9).all()
