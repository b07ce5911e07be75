import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.benchmark.datasets.anatomy import FOX, TROLL
from nonrigid.benchmark.datasets.creatures import Creatures, posed_creature
from nonrigid.benchmark.datasets.protocols import Dataset, PairData
from nonrigid.benchmark.datasets.recipe import cut_by_plane, cut_planes, grow_holes
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.formats import write_baryc
from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import face_pieces, restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import decimate, isosurface

BALL = decimate(isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.08), 600)
SMALL = Creatures(vertices=800)


@pytest.fixture(scope="module")
def pairs() -> list[PairData]:
    return [spec.load() for spec in SMALL.pairs()]


def test_creatures_are_a_dataset_that_can_be_sent_away() -> None:
    assert isinstance(SMALL, Dataset)
    specs = SMALL.pairs()
    assert len({spec.name for spec in specs}) == len(specs) == 8
    assert [spec.name for spec in pickle.loads(pickle.dumps(specs))] == [spec.name for spec in specs]
    with pytest.raises(InputError, match="100 vertices are too few"):
        Creatures(vertices=100)


def test_creature_parts_are_one_clean_piece(pairs: list[PairData]) -> None:
    for pair in pairs:
        assert face_pieces(pair.part).max() == 0
        assert clean(pair.part).repairs == ()
        assert clean(pair.full).repairs == ()
        assert abs(len(pair.full.vertices) - 800) <= 2
        assert 0.3 < pair.kept_area < 0.8


def test_creatures_move_nearly_isometrically(pairs: list[PairData]) -> None:
    for pair in pairs:
        i, j = pair.part.edges.T
        long = np.linalg.norm(pair.part.vertices[i] - pair.part.vertices[j], axis=1)
        for points in (pair.truth, pair.mirrored):
            assert points is not None
            place = points.positions(pair.full)
            low, middle, high = np.percentile(np.linalg.norm(place[i] - place[j], axis=1) / long, [5, 50, 95])
            assert 0.78 < low < 0.97 < middle < 1.03 < high < 1.27


def test_remeshed_poses_share_no_triangulation(pairs: list[PairData]) -> None:
    for pair in pairs:
        assert pair.truth is not None
        assert (pair.truth.barycentric.max(axis=1) > 0.999).mean() < 0.05


def test_neutral_pose_is_mapped_to_itself_and_mirrored_twice_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TROLL.poses[0], "chest", (0, 0, 0))
    for bone in list(TROLL.poses[0]):
        monkeypatch.setitem(TROLL.poses[0], bone, (0, 0, 0))
    made = posed_creature(TROLL, 0, vertices=800)
    full = Mesh(made["full vertices"], made["full faces"])
    vertices = np.asarray(made["part vertices"], dtype=float)
    unit = np.sqrt(full.area)
    truth = SurfacePoints(made["truth faces"], made["truth weights"]).positions(full)
    assert np.linalg.norm(truth - vertices, axis=1).max() < 0.02 * unit
    mirrored = SurfacePoints(made["mirrored faces"], made["mirrored weights"]).positions(full)
    assert np.linalg.norm(mirrored * [-1, 1, 1] - vertices, axis=1).max() < 0.02 * unit


def test_creatures_are_the_same_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    for folder in ("a", "b"):
        monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path / folder))
        made.append(posed_creature(FOX, 0, vertices=600))
    assert made[0].keys() == made[1].keys()
    assert all(made[0][key].tobytes() == made[1][key].tobytes() for key in made[0])


@settings(max_examples=12, deadline=None)
@given(st.integers(1, 20), st.floats(0.5, 0.95), st.integers(0, 1000))
def test_holes_leave_one_piece_of_the_promised_area(holes: int, keep: float, seed: int) -> None:
    kept = grow_holes(BALL, holes=holes, keep=keep, seed=seed)
    part = restrict(BALL, kept)
    assert keep - BALL.face_areas.max() / BALL.area <= part.kept_area <= keep
    assert face_pieces(part.mesh).max() == 0
    assert clean(part.mesh).repairs == ()
    np.testing.assert_array_equal(kept, grow_holes(BALL, holes=holes, keep=keep, seed=seed))


def test_impossible_holes_are_refused() -> None:
    with pytest.raises(InputError, match=r"keep is 1.5"):
        grow_holes(BALL, holes=3, keep=1.5, seed=0)
    with pytest.raises(InputError, match="cannot grow"):
        grow_holes(BALL, holes=300, keep=0.001, seed=0)


def test_a_cut_keeps_the_side_of_the_plane_that_the_truth_says() -> None:
    vertices = np.arange(len(BALL.vertices))
    truth = SurfacePoints.at_vertices(BALL, vertices)
    bent = Mesh(BALL.vertices * [1, 2, 1] + [0, 0, 7], BALL.faces)
    for point, normal in zip(*cut_planes(BALL, 4, 1), strict=True):
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        kept = cut_by_plane(bent, truth, BALL, point=point, normal=normal)
        used = np.unique(bent.faces[kept])
        assert ((BALL.vertices[used] - point) @ normal > 0).all()
        assert 0.2 < BALL.face_areas[kept].sum() / BALL.area < 0.8
    with pytest.raises(InputError, match="leaves nothing"):
        cut_by_plane(bent, truth, BALL, point=np.array([9.0, 0, 0]), normal=np.array([1.0, 0, 0]))


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Return a tiny archive with the official layout."""
    root = tmp_path / "shrec16"
    for folder in ("null", "cuts", "holes"):
        (root / folder).mkdir(parents=True)
    write_off(BALL, root / "null" / "cat.off")
    part = restrict(BALL, BALL.vertices[BALL.faces][:, :, 0].min(axis=1) > 0)
    truth = SurfacePoints.at_vertices(BALL, part.vertex_of_part)
    for stem in ("cuts/cuts_cat_shape_2", "cuts/cuts_cat_shape_10", "holes/holes_cat_shape_1"):
        write_off(part.mesh, root / f"{stem}.off")
        write_baryc(root / f"{stem}.baryc_gt", truth)
        write_baryc(root / f"{stem}.baryc_gt_sym", truth)
    (root / "source_poses.csv").write_text(
        "shape,vertices,faces,source_pose\ncuts_cat_shape_2,1,1,cat0\ncuts_cat_shape_10,1,1,cat10\n"
    )
    return tmp_path


def test_shrec16_is_found_by_its_layout(archive: Path) -> None:
    for root in (archive, archive / "shrec16"):
        specs = Shrec16(root=root).pairs()
        assert [spec.name for spec in specs] == ["cuts_cat_shape_2", "cuts_cat_shape_10", "holes_cat_shape_1"]
        assert [spec.own_pose for spec in specs] == [True, False, None]
    pair = specs[1].load()
    assert pair.truth is not None
    np.testing.assert_allclose(pair.truth.positions(pair.full), pair.part.vertices)
    assert pair.metadata["source_pose"] == "cat10"
    assert len(Shrec16(root=archive, splits=("holes",)).pairs()) == 1
    assert Shrec16(root=archive, names=("cuts_cat_shape_10",)).pairs()[0].name == "cuts_cat_shape_10"


def test_what_is_missing_is_named(archive: Path) -> None:
    with pytest.raises(UnknownNameError, match="cuts_dog_shape_1"):
        Shrec16(root=archive, names=("cuts_dog_shape_1",)).pairs()
    with pytest.raises(UnknownNameError, match="cracks"):
        Shrec16(root=archive, splits=("cracks",)).pairs()
    with pytest.raises(InputError, match="null"):
        Shrec16(root=archive / "none").pairs()
    specs = Shrec16(root=archive).pairs()
    for lost in ("cuts_cat_shape_2.off", "cuts_cat_shape_10.baryc_gt"):
        (archive / "shrec16" / "cuts" / lost).unlink()
        with pytest.raises(InputError, match=lost):
            Shrec16(root=archive).pairs()
        shutil.copy(archive / "shrec16" / "holes" / ("holes_cat_shape_1" + Path(lost).suffix), archive / "kept")
        shutil.move(archive / "kept", archive / "shrec16" / "cuts" / lost)
    (archive / "shrec16" / "holes" / "holes_cat_shape_1.baryc_gt_sym").unlink()
    with pytest.raises(InputError, match="lacks its mirrored file"):
        specs[2].load()
    shutil.rmtree(archive / "shrec16" / "holes")
    with pytest.raises(InputError, match="split 'holes'"):
        Shrec16(root=archive).pairs()
    (archive / "shrec16" / "source_poses.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match=r"source_poses.csv, row 2"):
        Shrec16(root=archive, splits=("cuts",)).pairs()


def test_ground_truth_of_another_part_is_refused(archive: Path) -> None:
    path = archive / "shrec16" / "cuts" / "cuts_cat_shape_2.baryc_gt"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(InputError, match=r"cuts_cat_shape_2.baryc_gt: \d+ rows, but the part has \d+ vertices"):
        Shrec16(root=archive).pairs()[0].load()


@pytest.mark.realdata
def test_real_pairs_are_read(data: Path) -> None:
    specs = Shrec16(root=data).pairs()
    assert len(specs) == 131
    assert sum(spec.split == "cuts" for spec in specs) == 74
    by_name = {spec.name: spec for spec in specs}
    assert all(spec.own_pose is not None for spec in specs)
    for name in ("cuts_wolf_shape_4", "holes_cat_shape_4"):
        pair = by_name[name].load()
        assert pair.truth is not None
        i, j = pair.part.edges.T
        place = pair.truth.positions(pair.full)
        ratio = np.linalg.norm(place[i] - place[j], axis=1) / np.linalg.norm(
            pair.part.vertices[i] - pair.part.vertices[j], axis=1
        )
        assert np.median(ratio) == pytest.approx(1.0, abs=0.02)
        if by_name[name].own_pose:
            assert np.linalg.norm(place - pair.part.vertices, axis=1).max() < 0.01 * np.sqrt(pair.full.area)
