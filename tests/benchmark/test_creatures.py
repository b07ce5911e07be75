import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.datasets.bestiary import ANATOMIES
from nonrigid.benchmark.datasets.creatures import Creature, Creatures
from nonrigid.benchmark.datasets.dense import dense_classes
from nonrigid.benchmark.datasets.posed import remeshed
from nonrigid.benchmark.datasets.protocols import Dataset, PairData
from nonrigid.benchmark.datasets.recipe import Recipe
from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import face_pieces
from nonrigid.geometry.points import SurfacePoints

SMALL = Creatures(vertices=800)
CAT = next(one for one in SMALL.classes() if one.name == "cat")
CHOSEN = ("cuts_cat_shape_1", "cuts_cat_shape_2", "cuts_cat_shape_7", "holes_cat_shape_2", "holes_cat_shape_14")


@pytest.fixture(scope="module")
def pairs() -> list[PairData]:
    return [spec.load() for spec in SMALL.pairs() if spec.name in CHOSEN]


def test_creatures_are_a_dataset_that_can_be_sent_away() -> None:
    assert isinstance(SMALL, Dataset)
    specs = SMALL.pairs()
    assert len({spec.name for spec in specs}) == len(specs) == 8 * 8 * (6 + 9)
    assert [spec.name for spec in pickle.loads(pickle.dumps(specs))] == [spec.name for spec in specs]
    with pytest.raises(InputError, match="100 vertices are too few"):
        Creatures(vertices=100)


def test_every_creature_has_eight_poses_of_bones_it_has() -> None:
    for anatomy in ANATOMIES:
        assert len(anatomy.poses) >= 8
        both = anatomy.both_sides()
        bones = [bone.name for bone in both.bones]
        assert len(set(bones)) == len(bones)
        for number, bone in enumerate(both.bones):
            assert bone.parent in ("", *bones[:number])
        assert {name for pose in anatomy.poses for name in pose} <= set(bones)
        assert {flesh.bone for flesh in both.flesh} <= set(bones)


def test_parts_are_one_clean_piece(pairs: list[PairData]) -> None:
    assert [pair.name for pair in pairs] == list(CHOSEN)
    for pair in pairs:
        assert face_pieces(pair.part).max() == 0
        assert clean(pair.part).repairs == ()
        assert clean(pair.full).repairs == ()
        assert abs(len(pair.full.vertices) - 800) <= 2
        assert len(pair.full.vertices) - len(pair.full.edges) + len(pair.full.faces) == 2
        assert 0.1 < pair.kept_area < 0.95


def test_creatures_move_nearly_isometrically(pairs: list[PairData]) -> None:
    for pair in pairs:
        i, j = pair.part.edges.T
        long = np.linalg.norm(pair.part.vertices[i] - pair.part.vertices[j], axis=1)
        for points in (pair.truth, pair.mirrored):
            assert points is not None
            place = points.positions(pair.full)
            low, middle, high = np.percentile(np.linalg.norm(place[i] - place[j], axis=1) / long, [5, 50, 95])
            assert 0.75 < low < high < 1.3
            assert 0.97 < middle < 1.03


def test_remeshed_poses_share_no_triangulation(pairs: list[PairData]) -> None:
    for pair in pairs:
        assert pair.truth is not None
        assert (pair.truth.barycentric.max(axis=1) > 0.999).mean() < 0.05


def test_uncut_and_unposed_the_truth_is_the_identity_and_mirrored_twice_too() -> None:
    still = replace(CAT, anatomy=replace(CAT.anatomy, poses=({},)))
    shape, full = still.posed("cat1"), still.template()
    unit = np.sqrt(full.area)
    assert shape.mirrored is not None
    assert np.linalg.norm(shape.truth.positions(full) - shape.mesh.vertices, axis=1).max() < 0.02 * unit
    mirrored = shape.mirrored.positions(full) * [-1, 1, 1]
    assert np.linalg.norm(mirrored - shape.mesh.vertices, axis=1).max() < 0.02 * unit


def test_creatures_are_the_same_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = Creature(anatomy=CAT.anatomy, vertices=600)
    made = []
    for folder in ("a", "b"):
        monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path / folder))
        shape = one.posed("cat3")
        assert shape.mirrored is not None
        arrays = (shape.mesh.vertices, shape.mesh.faces, shape.truth.barycentric, shape.mirrored.faces)
        made.append(b"".join(array.tobytes() for array in arrays))
    assert made[0] == made[1]


@pytest.fixture
def dense(tmp_path: Path) -> Path:
    """Return a folder with a dense class in two poses."""
    template = CAT.template()
    bent = template.vertices + 0.1 * np.sin(3 * template.vertices[:, [1, 2, 0]])
    write_off(template, tmp_path / "thing0.off")
    write_off(Mesh(bent, template.faces), tmp_path / "thing3.off")
    write_off(template, tmp_path / "alone1.off")
    return tmp_path


def test_any_dense_class_can_be_cut(dense: Path) -> None:
    data = Recipe(root=dense, vertices=500)
    specs = data.pairs()
    assert len(specs) == 15
    assert {spec.source_pose for spec in specs} == {"thing3"}
    for spec in (specs[0], specs[8]):
        pair = spec.load()
        assert pair.mirrored is None
        assert pair.truth is not None
        assert face_pieces(pair.part).max() == 0
        place = pair.truth.positions(pair.full)
        # The pose undone by a few rounds of the fixed point of p + 0.1 sin(3 p'): the truth has to lie there.
        undone = pair.part.vertices.copy()
        for _ in range(60):
            undone = pair.part.vertices - 0.1 * np.sin(3 * undone[:, [1, 2, 0]])
        assert np.quantile(np.linalg.norm(place - undone, axis=1), 0.99) < 0.02 * np.sqrt(pair.full.area)


def test_order_of_the_dense_vertices_changes_nothing() -> None:
    mesh = CAT.template()
    order = np.random.default_rng(3).permutation(len(mesh.vertices))
    other = Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces[::-1]])
    first, second = remeshed(mesh, 300, 7), remeshed(other, 300, 7)
    np.testing.assert_allclose(first.vertices, second.vertices, atol=2e-6)
    np.testing.assert_array_equal(first.faces, second.faces)


def test_folders_without_poses_are_named(dense: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        dense_classes(dense / "none", vertices=500, seed=0)
    write_off(CAT.template(), dense / "thing3.off")
    faces = CAT.template().faces.copy()
    faces[0] = faces[0][::-1] * 0 + [0, 1, 2]
    write_off(Mesh(CAT.template().vertices, faces), dense / "thing3.off")
    with pytest.raises(InputError, match="has not the triangles of thing0"):
        Recipe(root=dense, vertices=500).pairs()[0].load()
    (dense / "thing3.off").unlink()
    with pytest.raises(InputError, match="no two meshes"):
        Recipe(root=dense).pairs()
    with pytest.raises(InputError, match="3 vertices are too few"):
        Recipe(root=dense, vertices=3)


def test_points_of_a_whole_pose_lie_on_the_template() -> None:
    shape = CAT.posed("cat1")
    assert len(shape.truth) == len(shape.mesh.vertices)
    assert isinstance(shape.truth, SurfacePoints)
    shape.truth.check(CAT.template())
