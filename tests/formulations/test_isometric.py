"""Isometric matching: its cost against the paper's loops, its guards, and one real cut."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.isometric import IsometricMatching, distance_ratios
from nonrigid.formulations.model.assignment_sets import PartialPermutation, cheapest_assignment
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.solvers.bounds.bound import bound
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def distances(points: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))


@pytest.mark.parametrize("ratio", ["folded", "logarithmic"])
def test_the_cost_is_that_of_the_paper_written_as_loops(ratio: str) -> None:
    rng = np.random.default_rng(0)
    part, full = distances(rng.random((5, 3))), distances(rng.random((8, 3)))
    term = TripleDistortion(distance_ratios(part, full, ratio))  # type: ignore[arg-type]
    for _ in range(20):
        chosen = rng.permutation(8)[:5]
        each = []
        for i in range(5):
            others = [a for a in range(5) if a != i]
            r = {a: part[i, a] / full[chosen[i], chosen[a]] for a in others}
            seen = {a: max(r[a], 1 / r[a]) if ratio == "folded" else np.log(r[a]) for a in others}
            each.append(np.mean([abs(seen[a] - seen[c]) for a, c in combinations(others, 2)]))
        P = np.eye(8)[chosen]
        assert term.value_and_gradient(P)[0] == pytest.approx(np.mean(each), rel=1e-12)
        assert float(term.of_maps(chosen)) == pytest.approx(np.mean(each), rel=1e-12)


def test_a_scaled_isometry_costs_nothing_and_only_logarithms_see_an_inconsistent_scale() -> None:
    full = distances(np.random.default_rng(1).random((4, 3)))
    for ratio in ("folded", "logarithmic"):
        assert TripleDistortion(distance_ratios(2.5 * full, full, ratio)).of_maps(np.arange(4)) < 1e-12  # type: ignore[arg-type]
    mixed = full * np.where(np.add.outer(np.arange(4), np.arange(4)) % 2, 2.0, 0.5)
    assert TripleDistortion(distance_ratios(mixed, full, "folded")).of_maps(np.arange(4)) < 1e-12
    assert TripleDistortion(distance_ratios(mixed, full, "logarithmic")).of_maps(np.arange(4)) > 0.5


def test_coincident_samples_are_refused_with_their_numbers() -> None:
    points = np.random.default_rng(2).random((4, 3))
    points[3] = points[1]
    with pytest.raises(InputError, match="samples 1 and 3 of the full surface coincide"):
        distance_ratios(distances(points[:3]), distances(points))


@pytest.mark.parametrize("settings", [{"sources": 2}, {"full_samples": 4}, {"kept": 0.0}, {"extension_samples": 50}])
def test_settings_that_cannot_work_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(InputError):
        next(IsometricMatching(**settings).stages(None))  # type: ignore[arg-type]


def test_assignments_and_their_prices_agree_with_an_independent_solver() -> None:
    from scipy.optimize import linear_sum_assignment

    rng = np.random.default_rng(3)
    for trial in range(60):
        k = int(rng.integers(1, 12))
        n = int(rng.integers(k, 16))
        cost = rng.integers(0, 4, (k, n)).astype(float) if trial % 2 else rng.standard_normal((k, n))
        columns, prices = cheapest_assignment(cost)
        rows, best = linear_sum_assignment(cost)
        assert len(set(columns.tolist())) == k
        assert cost[np.arange(k), columns].sum() == pytest.approx(cost[rows, best].sum(), abs=1e-12)
        assert (prices <= 0.0).all()
        assert (cost - prices).min(axis=1).sum() + prices.sum() == pytest.approx(cost[rows, best].sum(), abs=1e-12)


@pytest.mark.realdata
def test_a_real_cut_is_solved_to_proved_optimality(data: Path) -> None:
    loaded = next(iter(Shrec16(root=data, names=("cuts_dog_shape_2",)).pairs())).load()
    pair, method = Pair.of(loaded.part, loaded.full), IsometricMatching()
    sparse = next(method.stages(pair))
    answer, whole = solve(sparse), solve(sparse, "native:exhaustive")
    assert answer.status is whole.status is Status.CERTIFIED
    assert answer.objective == pytest.approx(whole.objective, abs=1e-15)
    assert bound(sparse, "triple_lift").value == pytest.approx(answer.objective, abs=1e-7)
    found = match(pair, method)
    assert found.status is Status.CERTIFIED
    assert found.correspondence is not None
    assert [solution.problem for solution in found.solutions] == ["sparse", "extension"]
    assert PartialPermutation().violation(found.solutions[1]["X"]) == 0.0
    assert len(found.correspondence) == 80


def test_a_part_with_more_samples_than_the_full_surface_has_vertices_is_matched() -> None:
    fine, coarse = (trimesh.creation.icosphere(subdivisions=level) for level in (3, 1))
    stretched = np.array([1.0, 1.3, 1.7])
    part, full = (Mesh(ball.vertices * stretched, ball.faces) for ball in (fine, coarse))
    found = match(Pair.of(part, full, cache=None), IsometricMatching()).correspondence
    assert found is not None
    assert 0 < len(found) <= len(full.vertices) < 100
