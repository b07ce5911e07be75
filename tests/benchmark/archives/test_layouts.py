"""Data sets in files are found by their layout, and read alike from folders and zips, whole and by folds."""

from __future__ import annotations

import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nonrigid.benchmark.contact_sheet import contact_sheet
from nonrigid.benchmark.datasets.archive import Archive, open_dataset
from nonrigid.benchmark.datasets.checks import Finding, check_archive
from nonrigid.benchmark.datasets.convert import LAYOUTS, convert
from nonrigid.benchmark.datasets.folds import Fold, select_fold
from nonrigid.benchmark.datasets.inventory import full_shape_rows, part_rows, summary_rows
from nonrigid.benchmark.formats import write_vts
from nonrigid.benchmark.plan import read_plan
from nonrigid.benchmark.render import View
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.writers import write_mesh


def faults(root: Path, **more: Any) -> list[Finding]:
    return [finding for finding in check_archive(Archive(root=root, **more)) if finding.kind == "fault"]


def test_folder_and_zip_give_the_same_pairs(
    training: Path, tmp_path: Path, fulls: dict[str, Mesh], zipped: Callable[[Path, Path], Path]
) -> None:
    specs = open_dataset(training).pairs()
    assert [spec.name for spec in specs[:3]] == [f"cuts_cat_shape_{number}" for number in (1, 2, 10)]
    assert {spec.class_name for spec in specs} == set(fulls)
    assert {spec.metadata["archive"] for spec in specs} == {training.name}
    assert [spec.source_pose for spec in specs[:3]] == ["cat1", "cat2", "cat1"]
    archive = zipped(training, tmp_path / "any.zip")
    packed = pickle.loads(pickle.dumps(open_dataset(archive).pairs()))
    assert [spec.name for spec in packed] == [spec.name for spec in specs]
    for one, two in zip(specs[::4], packed[::4], strict=True):
        here, there = one.load(), two.load()
        assert here.part.vertices.tobytes() == there.part.vertices.tobytes()
        assert here.truth is not None
        assert there.truth is not None
        assert here.truth.faces.tolist() == there.truth.faces.tolist()
        assert str(there.part.file).startswith(str(archive))
    assert list(tmp_path.iterdir()) == [archive]


def test_shapes_beside_maps_may_be_named_as_those_of_the_track(training: Path, tmp_path: Path) -> None:
    part = open_dataset(training).pairs()[0].load()
    assert part.truth is not None
    for folder in ("shapes", "maps"):
        (tmp_path / folder).mkdir()
    write_off(part.part, tmp_path / "shapes" / "cuts_cat_shape_1.off")
    write_off(part.full, tmp_path / "shapes" / "cat.off")
    rows = part.truth.nearest_corner(part.full)
    (tmp_path / "maps" / "cuts_cat_shape_1_cat.map").write_text("".join(f"{row}\n" for row in rows))
    (found,) = open_dataset(tmp_path).pairs()
    assert found.metadata["layout"] == "maps"
    np.testing.assert_array_equal(found.load().truth.nearest_corner(part.full), rows)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("name", "suffix"), [("out.zip", ".mat"), ("out", ".vert"), ("out", ".ply")])
def test_every_layout_comes_back_as_written(
    training: Path, tmp_path: Path, layout: str, name: str, suffix: str
) -> None:
    source = open_dataset(training)
    lost = convert(source, tmp_path / name, layout=layout, mesh_suffix=suffix)
    assert lost == (["mirrored truth", "source poses"] if layout == "maps" else [])
    again = open_dataset(tmp_path / name)
    assert {spec.metadata["layout"] for spec in again.pairs()} == {layout}
    back = {(spec.split, spec.class_name, spec.metadata["number"]): spec for spec in again.pairs()}
    assert len(back) == 10
    for spec in source.pairs():
        old, new = spec.load(), back[spec.split, spec.class_name, spec.metadata["number"]].load()
        assert old.part.vertices.tobytes() == new.part.vertices.tobytes()
        assert old.full.faces.tobytes() == new.full.faces.tobytes()
        assert old.truth is not None
        assert new.truth is not None
        np.testing.assert_array_equal(old.truth.nearest_corner(old.full), new.truth.nearest_corner(new.full))
        assert (new.mirrored is None) == (layout == "maps")
        if layout != "maps":
            assert new.metadata["source_pose"] == old.metadata["source_pose"]
    assert list(tmp_path.iterdir()) == [tmp_path / name]
    with pytest.raises(InputError, match="something here already"):
        convert(source, tmp_path / name)


def test_conversion_gives_the_same_bytes_each_time(training: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        convert(open_dataset(training), tmp_path / f"{name}.zip")
        with zipfile.ZipFile(tmp_path / f"{name}.zip") as archive:
            archive.extractall(tmp_path / name)
    names = sorted(path.relative_to(tmp_path / "a" / "a") for path in (tmp_path / "a").rglob("*.*"))
    assert all((tmp_path / "a" / "a" / n).read_bytes() == (tmp_path / "b" / "b" / n).read_bytes() for n in names)
    with pytest.raises(UnknownNameError, match="layout 'posed'"):
        convert(open_dataset(training), tmp_path / "c", layout="posed")


def test_a_test_set_takes_its_full_shapes_from_the_training_set(
    training: Path, test_set: Path, tmp_path: Path, zipped: Callable[[Path, Path], Path]
) -> None:
    with pytest.raises(InputError, match=r"in no folder `null`.*give `templates`"):
        open_dataset(test_set).pairs()
    specs = open_dataset(test_set, templates=training).pairs()
    assert all(spec.truth is None for spec in specs)
    assert specs[0].load().truth is None
    assert faults(test_set, templates=training) == []
    zipped(training, tmp_path / f"{training.name}.zip")
    zipped(test_set, tmp_path / f"{test_set.name}.zip")
    both = open_dataset(tmp_path).pairs()
    assert len({spec.name for spec in both}) == len(both) == 20
    assert {spec.metadata["archive"] for spec in both} == {training.name, test_set.name}
    assert both[0].name == f"{training.name}-cuts_cat_shape_1"


def test_posed_classes_and_common_numbers(tmp_path: Path, fulls: dict[str, Mesh]) -> None:
    full = fulls["cat"]
    order = np.random.default_rng(0).permutation(len(full.vertices))
    renumber = np.argsort(order)
    bent = Mesh(full.vertices[order] * [1, 1.2, 1], renumber[full.faces])
    for folder in ("off", "corres"):
        (tmp_path / "faust" / folder).mkdir(parents=True)
    rows = np.arange(0, len(full.vertices), 2)
    for name, mesh, numbers in (("tr_reg_000", full, rows), ("tr_reg_007", bent, renumber[rows])):
        write_off(mesh, tmp_path / "faust" / "off" / f"{name}.off")
        write_vts(tmp_path / "faust" / "corres" / f"{name}.vts", SurfacePoints.at_vertices(mesh, numbers), mesh)
    (spec,) = open_dataset(tmp_path / "faust").pairs()
    assert (spec.name, spec.class_name, spec.split) == ("tr_reg_007", "tr_reg", "full")
    pair = spec.load()
    assert pair.truth is not None
    np.testing.assert_array_equal(pair.truth.nearest_corner(full)[renumber[rows]], rows)
    assert pair.truth.matched.sum() == len(rows)
    (tmp_path / "tosca").mkdir()
    for number, suffix in ((0, ".mat"), (3, ".vert"), (11, ".off")):
        write_mesh(full.transformed(scale=1 + number), tmp_path / "tosca" / f"cat{number}{suffix}")
    three, eleven = open_dataset(tmp_path / "tosca").pairs()
    assert (three.name, eleven.name, eleven.source_pose) == ("cat3", "cat11", "cat11")
    same = three.load().truth
    assert same is not None
    np.testing.assert_array_equal(same.nearest_corner(full), np.arange(len(full.vertices)))
    write_off(restrict(full, np.arange(len(full.faces)) > 9).mesh, tmp_path / "tosca" / "cat11.off")
    with pytest.raises(InputError, match=r"cat11.off: 29\d vertices, but .*cat0.mat has 300: they are not numbered"):
        eleven.load()


def test_folds_are_by_source_pose_and_named(training: Path) -> None:
    specs = open_dataset(training).pairs()
    folds = [select_fold(specs, Fold(number=number, count=3)) for number in (1, 2, 3)]
    assert sorted(spec.name for fold in folds for spec in fold) == sorted(spec.name for spec in specs)
    poses = [{(spec.class_name, spec.source_pose) for spec in fold} for fold in folds]
    assert sum(map(len, poses)) == len(set.union(*poses)) == 4
    other = select_fold(specs[::-1], Fold(number=1, count=3))
    assert {spec.name for spec in other} == {spec.name for spec in folds[0]}
    tested, learned = (Archive(root=training, fold=word) for word in ("2/3 seed 1", "not 2/3 seed 1"))
    assert len(tested.pairs()) + len(learned.pairs()) == len(specs)
    assert learned.name == f"{training.name} fold not 2/3 seed 1 by source pose"
    for wrong in ("2", "3/2", "1/1", "a/b", "1/2 seed", "0/4"):
        with pytest.raises(InputError):
            Fold.parse(wrong)
    with pytest.raises(InputError, match="4 source poses for 7 folds"):
        Archive(root=training, fold="1/7").pairs()


def test_folds_need_source_poses(copy: Path) -> None:
    (copy / "source_poses.csv").unlink()
    with pytest.raises(InputError, match=r"the source pose of 10 pairs is not known.*source_poses.csv"):
        Archive(root=copy, fold="1/2").pairs()


def test_inventory_counts_shapes(training: Path, fulls: dict[str, Mesh]) -> None:
    dataset = open_dataset(training)
    rows = full_shape_rows(dataset)
    assert [(row["class"], row["vertices"], row["euler"], row["defects"]) for row in rows] == [
        (name, len(mesh.vertices), 2, "") for name, mesh in sorted(fulls.items())
    ]
    summary = summary_rows(part_rows(dataset))
    assert [(row["split"], row["class"], row["shapes"]) for row in summary][:3] == [
        ("cuts", "cat", 3), ("cuts", "sea-horse", 3), ("cuts", "all", 6)
    ]  # fmt: skip
    assert {row["truth"] for row in summary} == {"direct and mirrored"}


def test_commands_look_check_convert_and_draw(copy: Path, tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    answer = nonrigid("data", "info", copy, "--json")
    assert (answer.code, '"set: parts"' in answer.out, '"euler": 2' in answer.out) == (0, False, True)
    assert "10 parts of 2 full shapes" in nonrigid("data", "info", copy, "--parts").out
    assert nonrigid("data", "check", copy).out.startswith("0 faults, 0 leaks")
    assert "10 pairs written" in nonrigid("data", "convert", copy, tmp_path / "b.zip", "--layout", "repacked").out
    assert nonrigid("data", "show", tmp_path / "b.zip", "--out", tmp_path / "a.png", "--size", 40).code == 0
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    (copy / "cuts" / "cuts_cat_shape_1.off").unlink()
    answer = nonrigid("data", "check", copy)
    assert (answer.code, answer.out.count("fault: ")) == (1, 1)
    assert nonrigid("data", "convert", copy, tmp_path / "c").code == 2


def test_a_contact_sheet_shows_every_class(training: Path) -> None:
    dataset = open_dataset(training)
    image, shown = contact_sheet(dataset, size=40, per_class=1, view=View(azimuth=0, elevation=0))
    assert shown == 8
    assert image.shape == (4 * 56, 80, 4)
    assert (image[:40, :40, :3] < 200).any()
    assert contact_sheet(dataset, splits=("cuts",), size=40)[1] == 8
    with pytest.raises(UnknownNameError, match="cracks"):
        contact_sheet(dataset, splits=("cracks",))
    with pytest.raises(InputError, match="at least 32 pixels"):
        contact_sheet(dataset, size=4)


def test_a_test_set_is_matched_and_submitted(
    training: Path, test_set: Path, tmp_path: Path, nonrigid: Callable[..., Any], zipped: Callable[[Path, Path], Path]
) -> None:
    zipped(test_set, tmp_path / f"{test_set.name}.zip")
    shutil.copytree(training, tmp_path / "train")
    (tmp_path / "plan.toml").write_text(
        'backends = ["native"]\n[data]\ndataset = "archive"\ntemplates = "train"\n'
        f'root = "{test_set.name}.zip"\nnames = ["cuts_cat_shape_1", "holes_cat_shape_1"]\n'
        '[[methods]]\nmethod = "gt"\nsettings = { part_samples = 20, full_samples = 60, groups = 1 }\n'
    )
    assert [spec.truth for spec in read_plan(tmp_path / "plan.toml").pairs()] == [None, None]
    answer = nonrigid("bench", tmp_path / "plan.toml", "--out", tmp_path / "res", "--quiet")
    assert (answer.code, test_set.name in answer.out) == (0, True)
    assert "without a match" not in answer.out
    assert "cannot be shown" not in nonrigid("report", tmp_path / "res", "--jobs", "1").out
    answer = nonrigid("data", "submit", tmp_path / "res", "--out", tmp_path / "mine.zip")
    assert answer.code == 0, answer.err
    with zipfile.ZipFile(tmp_path / "mine.zip") as packed:
        assert packed.namelist() == ["mine/cuts_cat_shape_1.corr", "mine/holes_cat_shape_1.corr"]
    assert nonrigid("data", "submit", tmp_path / "res", "--out", tmp_path / "m.zip", "--label", "en").code == 2


@pytest.mark.realdata
def test_real_sets_are_counted_as_described(data: Path) -> None:
    names = ("cuts_cat_shape_1", "cuts_david_shape_1", "cuts_wolf_shape_1")
    dataset = Archive(root=data / "shrec16", names=names)
    keys = ("class", "vertices", "faces", "boundary_edges", "nonmanifold_edges", "euler")
    assert [tuple(row[key] for key in keys) for row in full_shape_rows(dataset)] == [
        ("cat", 10000, 19940, 60, 12, 12),
        ("david", 10000, 19950, 52, 0, -1),
        ("wolf", 4344, 8684, 0, 0, 2),
    ]


@pytest.mark.realdata
def test_real_pairs_check_and_come_back(data: Path, tmp_path: Path) -> None:
    names = ("cuts_wolf_shape_1", "cuts_wolf_shape_7", "holes_wolf_shape_1")
    chosen = Archive(root=data / "shrec16", names=names)
    convert(chosen, tmp_path / "a.zip", layout="repacked", mesh_suffix=".ply")
    convert(open_dataset(tmp_path / "a.zip"), tmp_path / "b", layout="shrec16")
    for old, new in zip(chosen.pairs(), open_dataset(tmp_path / "b").pairs(), strict=True):
        assert old.load().part.vertices.tobytes() == new.load().part.vertices.tobytes()
        assert old.source_pose == new.source_pose
    findings = check_archive(open_dataset(tmp_path / "b"))
    assert {finding.kind for finding in findings} == {"leak"}
    own = {spec.name for spec in chosen.pairs() if spec.own_pose}
    assert {Path(finding.place).stem for finding in findings} == own
