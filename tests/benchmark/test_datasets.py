import shutil
from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.formats import write_baryc
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import decimate, isosurface

BALL = decimate(isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.08), 600)


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
