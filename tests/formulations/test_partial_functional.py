"""Partial functional maps: the energy, its descent by turns, the closed forms between, and whole matches."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.candidates import describe
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.functional_maps import (
    estimated_rank,
    orthonormal_map,
    region_of_matches,
    slanted_mask,
    spectral_closest_points,
)
from nonrigid.formulations.model import ModelError
from nonrigid.formulations.model.terms.area_gap import AreaGap
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.formulations.model.terms.masked_data import MaskedBasis, MaskedData, MaskedTarget
from nonrigid.formulations.model.terms.mumford_shah import MumfordShah
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.formulations.partial_functional import Bases, PartialFunctionalMap, Start, _State
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.mesh import Mesh
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve
from nonrigid.solvers.testing import check_term

SMALL = PartialFunctionalMap(
    eigenfunctions=20,
    radii=(0.15,),
    start_radii=(0.15,),
    start_samples=200,
    rounds=3,
    landmarks=15,
    closest_point_samples=150,
    map_evaluations=100,
    region_evaluations=40,
)


def bumpy(columns: int = 34, rows: int = 20) -> Mesh:
    """A tube with bumps that no rotation or mirror image maps onto itself."""
    angle, height = np.meshgrid(np.linspace(0, 2 * np.pi, columns, endpoint=False), np.linspace(0, 4, rows))
    radius = 0.6 + 0.25 * np.exp(-((height - 1.0) ** 2) / 0.3 - 2.0 * (1.0 - np.cos(angle - 1.0)))
    radius += 0.2 * np.exp(-((height - 2.9) ** 2) / 0.2 - 3.0 * (1.0 - np.cos(angle - 3.0))) + 0.05 * height
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    return Mesh(corners, np.concatenate([np.c_[a, b, b + columns], np.c_[a, b + columns, a + columns]]))


def cut(mesh: Mesh, height: float) -> tuple[Mesh, FloatArray]:
    """The part of a mesh below a height, and the number on the whole of each of its vertices."""
    low = mesh.vertices[:, 2] < height
    kept = mesh.faces[low[mesh.faces].all(axis=1)]
    used, inverse = np.unique(kept, return_inverse=True)
    return Mesh(mesh.vertices[used], inverse.reshape(-1, 3)), used


@pytest.fixture(scope="module")
def pair() -> Pair:
    whole = bumpy()
    return Pair.of(cut(whole, 2.7)[0], whole, cache=None)


def test_partial_closed_forms_of_the_energy() -> None:
    flat = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    sharp = MumfordShah(flat.vertices, flat.faces)
    assert sharp.value_and_gradient(np.full(4, 0.5))[0] == 0.0
    # v = x has |grad v| = 1; the corners' mean of xi is xi(0), so f = area * xi(0).
    assert sharp.value_and_gradient(flat.vertices[:, 0])[0] == pytest.approx(np.exp(-0.25 / 0.08))
    assert GramPenalty(np.ones(3)).value_and_gradient(np.eye(5)[:, :3])[0] == 0.0
    assert AreaGap(np.array([1.0, 1.0]), 1.0).value_and_gradient(np.array([0.5, 0.5]))[0] == pytest.approx(0.0)


def test_an_edge_costs_half_its_length() -> None:
    n = 200
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 0.1, n // 10))
    corner = np.arange(n * (n // 10)).reshape(n // 10, n)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    strip = MumfordShah(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]))
    ramp = np.clip((x.ravel() - 0.4) / 0.2, 0.0, 1.0)
    across = 0.2 * np.sqrt(2.0 * np.pi) * 0.9876  # the integral of xi over [0, 1]
    assert strip.value_and_gradient(ramp)[0] == pytest.approx(0.1 * across, rel=2e-3)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_terms_keep_their_contract_near_a_region(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, k, q = 12, 4, 6
    whole = MaskedBasis(rng.standard_normal((n, k)), rng.uniform(0.1, 1.0, n), rng.standard_normal((n, q)))
    check_term(MaskedData(rng.standard_normal((k, q)), whole), [(k, k), n], rng_seed=seed, points=2)
    check_term(MaskedTarget(rng.standard_normal((k, q)), whole), n, rng_seed=seed, points=2)
    check_term(WeightedSquares(rng.standard_normal((k, k))), (k, k), rng_seed=seed, points=2)


def test_single_precision_products_change_six_digits_at_most(pair: Pair) -> None:
    basis, rng = pair.full.spectrum(15), np.random.default_rng(0)
    functions = rng.standard_normal((len(basis.mass), 40))
    target, v = rng.standard_normal((15, 40)), rng.standard_normal(len(basis.mass))
    exact = MaskedTarget(target, MaskedBasis(basis.eigenfunctions, basis.mass, functions)).value_and_gradient(v)
    fast_basis = MaskedBasis(basis.eigenfunctions, basis.mass, functions, np.float32)
    fast = MaskedTarget(target, fast_basis).value_and_gradient(v)
    assert fast[0] == pytest.approx(exact[0], rel=1e-6)
    assert np.abs(fast[1] - exact[1]).max() < 1e-5 * np.abs(exact[1]).max()


def test_functions_of_low_rank_are_those_of_their_factors() -> None:
    rng = np.random.default_rng(0)
    basis, mass, v = rng.standard_normal((12, 4)), rng.uniform(0.1, 1.0, 12), rng.standard_normal(12)
    factor, mixing, target = rng.standard_normal((12, 2)), rng.standard_normal((6, 2)), rng.standard_normal((4, 6))
    whole = MaskedBasis(basis, mass, factor @ mixing.T)
    factored = MaskedBasis(basis, mass, factor, mixing=mixing)
    assert factored.count == whole.count == 6
    value, gradient = MaskedTarget(target, whole).value_and_gradient(v)
    again, slope = MaskedTarget(target, factored).value_and_gradient(v)
    assert again == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(slope, gradient, rtol=1e-10, atol=1e-12)
    check_term(MaskedTarget(target, factored), 12, rng_seed=0, points=2)
    with pytest.raises(ModelError, match="give it 2 columns"):
        MaskedBasis(basis, mass, factor, mixing=mixing.T)


def test_wrong_data_is_refused_in_words() -> None:
    whole = MaskedBasis(np.ones((2, 1)), np.ones(2), np.ones((2, 3)))
    for make, words in (
        (lambda: GroupNorm21(np.eye(2), np.ones((2, 3))), "shapes"),
        (lambda: GroupNorm21(np.eye(2), np.full((2, 2), np.nan)), "not finite"),
        (lambda: MaskedData(np.ones((1, 4)), whole), "3 descriptors"),
        (lambda: MaskedData(np.full((1, 3), np.inf), whole), "not finite"),
        (lambda: MaskedBasis(np.ones((2, 1)), np.ones(3), np.ones((2, 3))), "one a vertex"),
        (lambda: MaskedBasis(np.ones((2, 1)), np.full(2, np.nan), np.ones((2, 3))), "not finite"),
        (lambda: WeightedSquares(np.array([np.nan])), "not finite"),
        (lambda: GramPenalty(np.ones((2, 2))), "finite vector"),
        (lambda: GramPenalty(np.ones(2), diagonal_weight=-1.0), "-1"),
        (lambda: AreaGap(np.ones(2), np.nan), "not finite"),
        (lambda: MumfordShah(np.eye(3), np.array([[0, 1, 3]])), "0 to 2"),
        (lambda: MumfordShah(np.full((3, 3), np.nan), np.array([[0, 1, 2]])), "not finite"),
    ):
        with pytest.raises(ModelError, match=words):
            make()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_closest_points_recover_a_planted_isometry(seed: int) -> None:
    rng = np.random.default_rng(seed)
    full = rng.standard_normal((60, 5))
    planted = np.linalg.qr(rng.standard_normal((5, 3)))[0]
    part = full[:25] @ planted  # each row's image under `planted` is near its own row only if it lies in the range
    full[:25] = part @ planted.T
    found, distance = spectral_closest_points(planted + 0.03 * rng.standard_normal((5, 3)), part, full, iterations=20)
    assert np.allclose(found.T @ found, np.eye(3), atol=1e-12)
    assert distance < 0.1
    again, closer = spectral_closest_points(found, part, full, iterations=5)
    assert closer <= distance + 1e-12
    assert again.shape == (5, 3)


def test_the_mask_vanishes_along_the_slanted_diagonal() -> None:
    mask = slanted_mask(8, 4)
    assert (mask >= 0.0).all()
    assert [int(mask[row].argmin()) for row in (0, 2, 4, 6)] == [0, 1, 2, 3]
    assert estimated_rank(np.arange(8.0) * 2.0, np.arange(8.0)) == 4


def test_the_joint_energy_falls_with_every_block(pair: Pair) -> None:
    bases = Bases.of(pair, 20, 150)
    joint = SMALL.joint(pair, bases, (describe(pair.part, (0.15,)), describe(pair.full, (0.15,))))
    values = {"C": np.eye(20), "v": np.full(len(bases.full.mass), 0.6)}
    energies = [joint.objective.value(values)]
    for _ in range(3):
        for moved, held in (("C", "v"), ("v", "C")):
            block = joint.fix(**{held: values[held]})
            answer = solve(block, start={moved: values[moved]}, limits=Limits(evaluations=40))
            values[moved] = answer[moved]
            energies.append(joint.objective.value(values))
            # The data of the two blocks is computed in single precision.
            assert answer.objective == pytest.approx(energies[-1], rel=1e-5)
    assert all(after <= before * (1.0 + 1e-5) for before, after in pairwise(energies))
    assert energies[-1] < 1e-3 * energies[0]


@pytest.mark.parametrize("backend", ["native", {"C": "nlopt:LD_LBFGS", "v": "nlopt:LD_LBFGS"}])
def test_a_cut_tube_is_found_again(backend: str | dict[str, str]) -> None:
    whole = bumpy()
    part, truth = cut(whole, 2.7)
    moved, _, _ = random_rigid_motion(part, 3)
    found = match(Pair.of(moved, whole, cache=None), SMALL, backend)
    assert found.correspondence is not None
    assert {solution.problem for solution in found.solutions} == {"C", "v"}
    apart = np.linalg.norm(
        found.correspondence.points.positions(whole) - whole.vertices[truth[found.correspondence.part_vertices]], axis=1
    )
    assert np.median(apart) / np.sqrt(whole.area) < 0.06


@pytest.mark.parametrize("start", ["mask", "descriptors", "anchors"])
def test_each_start_states_the_published_sequence_of_steps(pair: Pair, start: Start) -> None:
    found = match(pair, replace(SMALL, start=start, landmarks=0, map_evaluations=20, region_evaluations=10))
    steps = [solution.problem for solution in found.solutions if solution.problem in ("C", "v")]
    assert steps[0] == "C"
    assert all(one != other for one, other in pairwise(steps))
    assert len(steps) <= 2 * SMALL.rounds - 1
    assert found.correspondence is not None


def test_the_start_whose_step_in_c_ends_lowest_goes_on(pair: Pair) -> None:
    settings = replace(SMALL, landmarks=0, map_evaluations=60)
    trials = {
        start: match(pair, replace(settings, start=start, rounds=2)).solutions[2].objective
        for start in ("mask", "descriptors")
    }
    steps = match(pair, settings).solutions
    energies = [solution.objective for solution in steps if solution.problem == "C"]
    assert [energies[1], energies[3]] == pytest.approx([trials["mask"], trials["descriptors"]], rel=1e-9)
    assert len(steps) in (6, 8)  # two starts of C v C, and at most one more round of the better one: v C
    both = PartialFunctionalMap(start_radii=())
    with pytest.raises(InputError, match="start_radii is empty"):
        match(pair, both)


def test_starts_that_tie_and_differ_go_on_and_the_others_do_not(pair: Pair) -> None:
    bases = Bases.of(pair, SMALL.eigenfunctions, SMALL.closest_point_samples)
    right, other = np.eye(bases.size), np.diag((-1.0) ** np.arange(bases.size))
    tried = [
        _State(C=other, v=np.ones(1), energy=1.04),
        _State(C=right, v=np.ones(1), energy=1.0),
        _State(C=right, v=np.ones(1), energy=1.01),
        _State(C=-right, v=np.ones(1), energy=1.2),
    ]
    assert bases.contenders(tried) == [tried[1], tried[0]]
    assert bases.contenders(tried[2:]) == [tried[2]]


def test_the_end_with_the_lowest_energy_is_the_answer(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonrigid.formulations.partial_functional._NEAR", np.inf)
    monkeypatch.setattr("nonrigid.formulations.partial_functional._APART", -1.0)
    steps = match(pair, replace(SMALL, landmarks=0, map_evaluations=30, region_evaluations=20)).solutions
    assert len(steps) in (8, 10)  # both starts go on: C v C each, then v C unless they had settled


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_a_map_of_matches_forgets_the_wrong_third(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planted = np.linalg.qr(rng.standard_normal((6, 4)))[0]
    part = rng.standard_normal((90, 4))
    full = part @ planted.T
    full[:30] = full[rng.permutation(90)[:30]]
    found = orthonormal_map(part, full)
    assert np.allclose(found.T @ found, np.eye(4), atol=1e-12)
    assert np.linalg.norm(found - planted) < 0.1


def test_the_region_of_matches_has_the_area_and_the_place_of_the_matches(pair: Pair) -> None:
    full, low = pair.full.spectrum(40), pair.full.mesh.vertices[:, 2] < np.median(pair.full.mesh.vertices[:, 2])
    region = region_of_matches(np.flatnonzero(low), full.mass[low], full, float(full.mass[low].sum()))
    assert full.mass @ region == pytest.approx(full.mass[low].sum(), abs=2 * full.mass.max())
    assert full.mass @ (region * low) > 0.85 * full.mass[low].sum()


def test_scale_changes_nothing() -> None:
    whole = bumpy(24, 14)
    part, _ = cut(whole, 2.7)
    settings = PartialFunctionalMap(eigenfunctions=8, radii=(0.3,), start_radii=(0.3,), rounds=1, landmarks=0)
    answers = [
        match(Pair.of(part.transformed(scale=f), whole.transformed(scale=f), cache=None), settings) for f in (1.0, 64.0)
    ]
    first, second = (answer.solutions[0].objective for answer in answers)
    assert first == pytest.approx(second, rel=1e-6)


def test_wrong_settings_are_refused_in_words(pair: Pair) -> None:
    with pytest.raises(UnknownNameError, match="start"):
        match(pair, PartialFunctionalMap(start="nothing"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rounds is 0"):
        match(pair, PartialFunctionalMap(rounds=0))


@pytest.mark.realdata
def test_a_real_cut_is_matched(data: Path) -> None:
    loaded = next(iter(Shrec16(root=data, names=("cuts_wolf_shape_7",)).pairs())).load()
    settings = PartialFunctionalMap(eigenfunctions=30, rounds=3, landmarks=20, region_evaluations=30)
    errors = []
    for seed, scale in ((0, 1.0), (1, 3.7)):
        moved, _, _ = random_rigid_motion(loaded.part, seed)
        found = match(Pair.of(moved.transformed(scale=scale), loaded.full.transformed(scale=scale)), settings)
        assert found.correspondence is not None
        assert len(found.correspondence) == len(loaded.part.vertices)
        errors.append(score(loaded, found.correspondence.dense(len(loaded.part.vertices))).mean_error)
    assert errors[0] < 0.05
    assert errors[1] == pytest.approx(errors[0], rel=0.05)
