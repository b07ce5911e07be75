"""What is wrong in a data set is named with its place and the remedy; leaks and copies are told."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nonrigid.benchmark.datasets.archive import Archive, open_dataset
from nonrigid.benchmark.datasets.checks import Finding, check_archive
from nonrigid.benchmark.datasets.copies import find_copies, in_own_pose, signature
from nonrigid.benchmark.protocol import random_rigid_motion
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict


def faults(root: Path, **more: Any) -> list[Finding]:
    return [finding for finding in check_archive(Archive(root=root, **more)) if finding.kind == "fault"]


def test_a_sound_set_has_no_fault(training: Path, tmp_path: Path, zipped: Callable[[Path, Path], Path]) -> None:
    assert faults(training) == []
    assert faults(zipped(training, tmp_path / "a.zip")) == []


def test_missing_files_of_a_pair_are_named(copy: Path) -> None:
    (copy / "cuts" / "cuts_cat_shape_2.baryc_gt").unlink()
    (copy / "holes" / "holes_cat_shape_1.off").unlink()
    (copy / "holes" / "holes_cat_shape_2.baryc_gt_sym").unlink()
    (copy / "null" / "sea-horse.off").unlink()
    found = {finding.place.removeprefix(str(copy)): finding.problem for finding in faults(copy)}
    assert "the ground truth is missing" in found["/cuts/cuts_cat_shape_2.baryc_gt"]
    assert "the mesh of this shape is missing" in found["/holes/holes_cat_shape_1.off"]
    assert "the mirrored ground truth is missing" in found["/holes/holes_cat_shape_2.baryc_gt_sym"]
    assert "no full shape of the class 'sea-horse'" in found["/null/sea-horse.off"]
    with pytest.raises(InputError, match=r"cuts_cat_shape_2.baryc_gt: the ground truth is missing"):
        open_dataset(copy).pairs()
    assert Archive(root=copy, names=("cuts_cat_shape_1",)).pairs()[0].load().truth is not None


def test_rows_that_do_not_fit_are_named(copy: Path) -> None:
    path = copy / "cuts" / "cuts_cat_shape_1.baryc_gt"
    path.write_text(path.read_text() + "1 1 0 0\n")
    other = copy / "holes" / "holes_cat_shape_2.off"
    other.write_text("\n".join(other.read_text().split("\n")[:50]))
    found = faults(copy)
    assert len(found) == 2
    assert found[0].place == str(path)
    assert "rows, but the part has" in found[0].problem
    assert "training and test sets" in found[0].remedy
    assert found[1].place == str(other)
    assert "cut short" in found[1].problem


def test_triangles_counted_from_zero_are_named(copy: Path) -> None:
    for stem in ("cuts_cat_shape_1", "cuts_cat_shape_2"):
        path = copy / "cuts" / f"{stem}.baryc_gt"
        rows = np.loadtxt(path)
        rows[:, 0] -= 1
        rows[:, 0] = np.maximum(rows[:, 0], 1)  # such a file need not name triangle 0
        rows[5, 0] = 0 if stem.endswith("1") else rows[5, 0]
        np.savetxt(path, rows)
    found = faults(copy)
    assert (found[0].place, found[0].row is not None) == (str(copy / "cuts" / "cuts_cat_shape_1.baryc_gt"), True)
    assert "looks 0-based" in found[0].problem
    assert "counted from 0" in found[1].problem
    assert found[1].remedy == "add 1 to every triangle"


def test_truth_of_another_shape_is_named(copy: Path, test_set: Path) -> None:
    path = copy / "cuts" / "cuts_cat_shape_1.baryc_gt"
    rows = np.loadtxt(path)
    np.savetxt(path, rows[np.random.default_rng(0).permutation(len(rows))])
    shutil.copy(test_set / "holes" / "holes_cat_shape_1.off", copy / "holes" / "holes_cat_shape_1.off")
    found = faults(copy)
    assert ["as that of another shape does" in found[0].problem, "training and test" in found[0].remedy] == [True] * 2
    assert any("holes_cat_shape_1" in finding.place and "training and test" in finding.remedy for finding in found)


def test_swapped_folders_are_named(copy: Path) -> None:
    (copy / "cuts").rename(copy / "kept")
    (copy / "holes").rename(copy / "cuts")
    (copy / "kept").rename(copy / "holes")
    found = faults(copy)
    assert found[0].problem == "a shape of 'holes' among those of 'cuts'"
    with pytest.raises(InputError, match="move it to the folder it belongs to"):
        open_dataset(copy).pairs()


def test_damaged_zips_are_named(training: Path, tmp_path: Path, zipped: Callable[[Path, Path], Path]) -> None:
    archive = zipped(training, tmp_path / "a.zip")
    whole = archive.read_bytes()
    archive.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"a\.zip: is no zip archive, or a truncated one: .*fetch it again"):
        open_dataset(archive).pairs()
    with zipfile.ZipFile(zipped(training, archive)) as packed:
        member = next(info for info in packed.infolist() if info.filename.endswith("cuts_cat_shape_1.off"))
    spoiled = bytearray(whole)
    spoiled[member.header_offset + 200] ^= 0xFF
    archive.write_bytes(spoiled)
    found = faults(archive)
    assert [finding.place for finding in found] == [f"{archive}/{member.filename}"]
    assert "cannot be unpacked" in found[0].problem
    archive.unlink()
    with pytest.raises(InputError, match="no such folder or archive"):
        open_dataset(archive).pairs()


def test_what_is_no_data_set_is_refused(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("hello")
    with pytest.raises(InputError, match="1 files, but no layout"):
        open_dataset(tmp_path).pairs()
    with pytest.raises(InputError, match="0 folders `null`"):
        open_dataset(tmp_path, templates=tmp_path).pairs()


def test_copies_are_found_through_motion_renumbering_and_jitter(training: Path) -> None:
    generator = np.random.default_rng(0)
    parts = [spec.load_part() for spec in open_dataset(training).pairs()]
    known = [(str(place), signature(mesh)) for place, mesh in enumerate(parts)]
    assert find_copies(known) == []
    mesh = parts[3]
    moved = random_rigid_motion(mesh)[0]
    order = generator.permutation(len(mesh.vertices))
    noise = 0.0005 * np.sqrt(mesh.area) * generator.normal(size=mesh.vertices.shape)
    copied = Mesh((moved.vertices + noise)[order], np.argsort(order)[moved.faces][::-1])
    assert find_copies([("new", signature(copied))], known) == [("3", "new")]
    assert find_copies([*known, ("new", signature(copied))]) == [("3", "new")]


def test_leaks_are_told_but_are_no_faults(copy: Path, training: Path, fulls: dict[str, Mesh]) -> None:
    full = fulls["cat"]
    part = restrict(full, full.vertices[full.faces][:, :, 0].min(axis=1) > 0).mesh
    assert in_own_pose(part, full)
    assert not in_own_pose(part.transformed(translation=[0.2, 0, 0]), full)
    leaks = check_archive(Archive(root=copy), against=Archive(root=training))
    assert {finding.kind for finding in leaks} == {"leak"}
    assert sum("the same shape as" in finding.problem for finding in leaks) == 10
