"""Random forests: known answers, what a forest may be used for, and that neither order nor frame counts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nonrigid.formulations.forest.heat_tests import HeatTests
from nonrigid.formulations.forest.store import load_forest, read_header, save_forest
from nonrigid.formulations.forest.template import Template
from nonrigid.formulations.forest.training import Example, ForestSettings, train_forest
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.random_forest import RandomForest, low_pass
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.spectrum import Spectrum
from nonrigid.geometry.surface import Surface
from nonrigid.solvers.match import match

SMALL = ForestSettings(trees=8, leaf_samples=3, cells=60, tests=40, tries=20, eigenfunctions=50)


def lumpy(count: int = 24, *, bend: float = 0.0) -> Mesh:
    """Return a closed surface without symmetry; `bend` turns its upper half, nearly without stretching it."""
    theta = np.linspace(0.0, np.pi, count)[1:-1]
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * count, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    radius = 1.0 + 0.25 * np.sin(t) ** 2 * np.cos(2 * p + 0.5) + 0.3 * np.sin(t) ** 3 * np.sin(3 * p) + 0.2 * np.cos(t)
    grid = np.stack([radius * np.sin(t) * np.cos(p), radius * np.sin(t) * np.sin(p), 2.0 * radius * np.cos(t)], -1)
    vertices = np.vstack([grid.reshape(-1, 3), [[0, 0, 2.4], [0, 0, -1.6]]])
    rows, columns = grid.shape[:2]
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    sides = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
    ring, top = np.arange(columns), rows * columns
    caps = [
        np.stack([np.full(columns, top), ring, np.roll(ring, -1)], -1),
        np.stack([np.full(columns, top + 1), np.roll(ring, -1) + top - columns, ring + top - columns], -1),
    ]
    angle = bend * np.clip(vertices[:, 2], 0.0, None)
    turned = vertices.copy()
    turned[:, 0] = np.cos(angle) * vertices[:, 0] - np.sin(angle) * vertices[:, 1]
    turned[:, 1] = np.sin(angle) * vertices[:, 0] + np.cos(angle) * vertices[:, 1]
    return Mesh(turned, np.vstack([sides, *caps]), name="lumpy")


def cut(full: Mesh, pose: Mesh, direction: tuple[float, float, float], keep: float, name: str) -> Example:
    """Return what is left of a pose on one side of a plane in the full surface, with its truth."""
    height = full.vertices @ np.asarray(direction)
    faces = pose.faces[(height[pose.faces] <= np.quantile(height, keep)).all(axis=1)]
    used, local = np.unique(faces, return_inverse=True)
    part = Mesh(pose.vertices[used], local.reshape(-1, 3), name=name)
    return Example(pair=Pair.of(part, full), truth=SurfacePoints.at_vertices(full, used), pose=name[:-1])


@pytest.fixture(scope="module")
def examples() -> list[Example]:
    full = lumpy()
    sides = ((1.0, 0.3, 0.2), (-0.4, 1.0, 0.1), (0.1, 0.2, 1.0))
    return [
        cut(full, lumpy(bend=bend), side, 0.75, f"{pose}{number}")
        for pose, bend in (("a", 0.1), ("b", 0.3), ("c", 0.2))
        for number, side in enumerate(sides)
    ]


@pytest.fixture(scope="module")
def method(examples: list[Example]) -> RandomForest:
    learned = [example for example in examples if example.pose != "c"]
    return RandomForest(eigenfunctions=40).trained_on(learned, class_name="lumpy", settings=SMALL)


def errors(method: RandomForest, example: Example) -> np.ndarray:
    found = match(example.pair, method).correspondence
    assert found is not None
    full = example.pair.full.raw
    apart = found.points.positions(full) - example.truth[found.part_vertices].positions(full)
    return np.linalg.norm(apart, axis=1) / np.sqrt(full.area)


def test_heat_is_the_same_after_a_change_of_signs_and_within_an_eigenspace() -> None:
    rng = np.random.default_rng(0)
    functions = rng.standard_normal((6, 3))
    values = np.array([0.0, 2.0, 2.0])
    tests = HeatTests(np.array([2.0, 1.0]), np.array([0.3, 0.1]))
    turn = np.eye(3)
    turn[1:, 1:] = [[0.6, -0.8], [0.8, 0.6]]
    mass = np.ones(6)
    direct = tests.values(Spectrum(values, functions, mass))
    assert np.allclose(direct, tests.values(Spectrum(values, -functions @ turn, mass)), atol=1e-6)
    expected = np.log(functions[:, 0] ** 2 + np.exp(-0.6) * (functions[:, 1:] ** 2).sum(axis=1))
    assert np.allclose(direct[:, 0], expected, atol=1e-6)
    assert np.allclose(direct[:, 1], np.log(functions[:, 0] ** 2), atol=1e-6)


def test_low_pass_of_a_map_within_the_basis_returns_it() -> None:
    rng = np.random.default_rng(1)
    rows, C, mass = rng.standard_normal((50, 4)), rng.standard_normal((6, 4)), rng.uniform(0.5, 2.0, 50)
    problem = low_pass(rows, rows @ C.T, mass)
    assert problem.objective.value({"C": C}) == pytest.approx(0.0, abs=1e-10)
    wanted, other = rng.standard_normal((50, 6)), rng.standard_normal(C.shape)
    direct = float(np.sum(mass[:, None] * (rows @ other.T - wanted) ** 2))
    assert low_pass(rows, wanted, mass).objective.value({"C": other}) == pytest.approx(direct, rel=1e-10)


def test_votes_are_shares(method: RandomForest, examples: list[Example]) -> None:
    assert not isinstance(method.forest, str)
    votes = method.forest.votes(examples[-1].pair)
    assert votes.shape == (len(examples[-1].truth), len(method.forest.template.labels))
    assert np.allclose(votes.sum(axis=1), 1.0, atol=1e-5)


def test_unseen_poses_are_matched_and_the_map_is_better_than_the_votes(
    method: RandomForest, examples: list[Example]
) -> None:
    unseen = [example for example in examples if example.pose == "c"]
    whole = np.mean([errors(method, example).mean() for example in unseen])
    raw = np.mean([errors(replace(method, low_pass=False), example).mean() for example in unseen])
    assert whole < 0.06
    assert whole < raw


def test_no_order_of_examples_or_vertices_changes_the_forest(examples: list[Example]) -> None:
    few = examples[:2]
    first = train_forest(few, settings=SMALL)
    rng = np.random.default_rng(3)
    raw = few[0].pair.part.raw
    new = rng.permutation(len(raw.vertices))
    vertices = np.empty_like(raw.vertices)
    vertices[new] = raw.vertices
    turned = Mesh(vertices / few[0].pair.scale, new[raw.faces], name=raw.name)
    truth = few[0].truth[np.argsort(new)]
    moved = Example(pair=Pair.of(turned, lumpy()), truth=truth, pose=few[0].pose)
    again = train_forest([few[1], moved], settings=SMALL)
    votes, others = first.votes(examples[5].pair), again.votes(examples[5].pair)
    assert abs(votes - others).sum(axis=1).mean() < 0.05


def test_a_forest_finds_its_labels_on_a_moved_and_renumbered_copy(method: RandomForest) -> None:
    assert not isinstance(method.forest, str)
    full = lumpy()
    rng = np.random.default_rng(2)
    new = rng.permutation(len(full.vertices))
    vertices = np.empty_like(full.vertices)
    vertices[new] = full.vertices
    copy = Mesh(vertices, new[full.faces]).transformed(
        rotation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]], translation=[1, 2, 3], scale=7.0
    )
    template = method.forest.template
    assert np.array_equal(template.label_vertices(Surface(copy)), new[template.labels])


def test_fewer_labels_are_cells(examples: list[Example]) -> None:
    template = Template.of(examples[0].pair.full, 50)
    assert len(template.labels) == 50
    assert np.array_equal(template.cell[template.labels], np.arange(50))
    forest = train_forest(examples[:3], settings=replace(SMALL, labels=50, samples=900))
    assert forest.votes(examples[4].pair).shape[1] == 50


def test_a_file_holds_the_whole_forest(method: RandomForest, examples: list[Example], tmp_path: Path) -> None:
    assert not isinstance(method.forest, str)
    place = tmp_path / "lumpy.forest"
    save_forest(method.forest, place)
    read = load_forest(place)
    assert repr(read) == repr(method.forest)
    pair = examples[-1].pair
    assert abs(read.votes(pair) - method.forest.votes(pair)).max() == 0.0
    assert read_header(place)["poses"] == ["a", "b"]
    assert [path.name for path in tmp_path.iterdir()] == ["lumpy.forest"]
    direct, filed = (match(pair, m).correspondence for m in (method, replace(method, forest=str(place))))
    assert direct is not None
    assert filed is not None
    assert np.array_equal(direct.points.faces, filed.points.faces)


def test_a_forest_is_refused_where_it_does_not_belong(
    method: RandomForest, examples: list[Example], tmp_path: Path
) -> None:
    assert not isinstance(method.forest, str)
    place = tmp_path / "lumpy.forest"
    save_forest(method.forest, place)
    filed = replace(method, forest=str(place))
    other = lumpy(22)
    with pytest.raises(InputError, match=r"trained for the surface 'lumpy'.*1058 vertices.*has 882"):
        match(cut(other, other, (1, 0, 0), 0.6, "x0").pair, filed)
    bent = lumpy(bend=1.0)
    with pytest.raises(InputError, match=r"differs from it by up to .* of sqrt\(area\)"):
        match(cut(bent, bent, (1, 0, 0), 0.6, "x0").pair, filed)
    for held in (filed, method):
        with pytest.raises(InputError, match="a"):
            held.held_out("lumpy", "a")
        with pytest.raises(InputError, match=r"unknown|may not"):
            held.held_out("lumpy", None)
        with pytest.raises(InputError, match="class"):
            held.held_out("cat", "c")
    assert filed.held_out("lumpy", "c").digest
    with pytest.raises(InputError, match="hash"):
        match(examples[-1].pair, replace(filed, digest="0" * 16))
    with pytest.raises(InputError, match="need a trained forest"):
        match(examples[-1].pair, RandomForest())
    with pytest.raises(InputError, match="no such forest"):
        match(examples[-1].pair, RandomForest(forest=str(tmp_path / "none.forest")))


def test_a_folder_gives_the_fold_that_never_saw_the_pose(
    method: RandomForest, examples: list[Example], tmp_path: Path
) -> None:
    assert not isinstance(method.forest, str)
    save_forest(method.forest, tmp_path / "one.forest")
    save_forest(replace(method.forest, poses=("b", "c")), tmp_path / "two.forest")
    folder = RandomForest(forest=str(tmp_path))
    assert folder.held_out("lumpy", "a").forest == str(tmp_path / "two.forest")
    assert folder.held_out("lumpy", "c").forest == str(tmp_path / "one.forest")
    with pytest.raises(InputError, match="trained on the tested pose b"):
        folder.held_out("lumpy", "b")
    with pytest.raises(InputError, match=r"one\.forest, two\.forest; name one file"):
        match(examples[-1].pair, folder)


def test_damaged_and_foreign_files_are_refused(method: RandomForest, tmp_path: Path) -> None:
    assert not isinstance(method.forest, str)
    place = tmp_path / "x.forest"
    save_forest(method.forest, place)
    place.write_bytes(place.read_bytes()[:-200])
    with pytest.raises(InputError, match="damaged"):
        load_forest(place)
    np.savez(tmp_path / "y.npz", header=np.array('{"format": "nonrigid forest", "version": 99}'))
    with pytest.raises(InputError, match="version 99"):
        load_forest(tmp_path / "y.npz")
    with pytest.raises(InputError, match="suffix"):
        save_forest(method.forest, tmp_path / "x.npz")


def test_settings_and_examples_are_checked(examples: list[Example]) -> None:
    with pytest.raises(InputError, match="bag is 0"):
        ForestSettings(bag=0.0)
    with pytest.raises(InputError, match="trees is 0"):
        ForestSettings(trees=0)
    with pytest.raises(InputError, match="no training part"):
        train_forest([])
    other = lumpy(22)
    with pytest.raises(InputError, match="another full surface"):
        train_forest([examples[0], cut(other, other, (1, 0, 0), 0.6, "z0")], settings=SMALL)
    with pytest.raises(InputError, match="rows for"):
        replace(examples[0], truth=examples[0].truth[:3])


def test_forests_that_vote_for_other_labels_have_other_names(method: RandomForest) -> None:
    forest = method.forest
    assert not isinstance(forest, str)
    tree = forest.trees[0]
    votes = tree.votes.copy()
    votes.indices = votes.indices[::-1].copy()
    other = replace(forest, trees=(replace(tree, votes=votes), *forest.trees[1:]))
    assert repr(other) != repr(forest)
