"""Training by pose: from files to forests, to matches, and to a benchmark that refuses what a forest has seen."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import read_corr, write_baryc
from nonrigid.benchmark.held_out import Refused, held_out_for
from nonrigid.benchmark.plan import read_plan
from nonrigid.benchmark.runner import run_plan
from nonrigid.formulations.elastic_net import ElasticNetMatching
from nonrigid.formulations.forest.store import read_header
from nonrigid.geometry.io import write_off

POSES = {
    "cuts_person_shape_1": "person1",
    "cuts_person_shape_2": "person2",
    "cuts_person_shape_3": "person2",
    "holes_person_shape_1": "person3",
}
SETTINGS = ("trees=3", "cells=20", "tests=20", "tries=10", "eigenfunctions=30")
SMALL = tuple(word for setting in SETTINGS for word in ("--set", setting))


@pytest.fixture(scope="module")
def shapes(person: PairData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same part four times, as if of three poses: what is learned does not matter here."""
    root = tmp_path_factory.mktemp("shapes")
    assert person.truth is not None
    assert person.mirrored is not None
    for folder in ("null", "cuts", "holes"):
        (root / folder).mkdir()
    write_off(person.full, root / "null" / "person.off")
    for name in POSES:
        stem = root / name.partition("_")[0] / name
        write_off(person.part, stem.with_suffix(".off"))
        write_baryc(stem.with_suffix(".baryc_gt"), person.truth)
        write_baryc(stem.with_suffix(".baryc_gt_sym"), person.mirrored)
    rows = "".join(f"{shape},{pose}\n" for shape, pose in POSES.items())
    (root / "source_poses.csv").write_text("shape,source_pose\n" + rows, encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def forests(shapes: Path, nonrigid: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One forest a fold."""
    out = tmp_path_factory.mktemp("forests")
    done = nonrigid("train", "rf", "--data", shapes, "--out", out, "--folds", 3, *SMALL, "--json")
    assert done.code == 0, done.err
    assert [row["class"] for row in json.loads(done.out)] == ["person"] * 3
    return out


@pytest.fixture(scope="module")
def single(shapes: Path, nonrigid: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One forest that has not seen the first pose."""
    out = tmp_path_factory.mktemp("forest") / "person.forest"
    words = ("--class", "person", "--leave-out", "person1")
    done = nonrigid("train", "rf", "--data", shapes, "--out", out, *words, *SMALL)
    assert done.code == 0, done.err
    assert "3 parts of 2 poses" in done.out
    return out


def test_each_fold_lacks_poses_of_its_own(forests: Path) -> None:
    seen = [set(read_header(file)["poses"]) for file in sorted(forests.iterdir())]
    missing = [set(POSES.values()) - poses for poses in seen]
    assert sorted(map(len, missing)) == [1, 1, 1]
    assert set.union(*missing) == set(POSES.values())


def test_a_pair_is_matched_from_the_command_line(
    single: Path, files: Path, person: PairData, nonrigid: Callable[..., Any], tmp_path: Path
) -> None:
    out = tmp_path / "m.corr"
    words = ("match", files / "part.off", files / "full.off", "--out", out, "--method", "rf")
    done = nonrigid(*words, "--set", f"forest={single}", "--set", "eigenfunctions=20")
    assert done.code == 0, done.err
    assert read_corr(out, full=person.full).matched.all()
    refused = nonrigid(*words)
    assert refused.code == 2
    assert "random forests need a trained forest" in refused.err


def bench(shapes: Path, forest: Path, folder: Path) -> dict[str, dict[str, Any]]:
    settings = f'{{ forest = "{forest.as_posix()}", eigenfunctions = 20 }}'
    text = f'backends = ["native"]\n[data]\ndataset = "shrec16"\n[[methods]]\nmethod = "rf"\nsettings = {settings}\n'
    plan = folder / "plan.toml"
    plan.write_text(text, encoding="utf-8")
    return {row["pair"]: row for row in run_plan(read_plan(plan, data=shapes), folder / "out", quiet=True)}


def test_folds_test_every_pair_with_a_forest_that_never_saw_its_pose(
    shapes: Path, forests: Path, tmp_path: Path
) -> None:
    rows = bench(shapes, forests, tmp_path)
    assert set(rows) == set(POSES)
    for name, row in rows.items():
        assert row["match_count"] > 0, row["message"]
        used = row["settings"].partition("forest='")[2].partition("'")[0]
        assert POSES[name] not in read_header(used)["poses"]


def test_a_pair_whose_pose_was_trained_on_is_refused_in_its_row(shapes: Path, single: Path, tmp_path: Path) -> None:
    rows = bench(shapes, single, tmp_path)
    assert rows["cuts_person_shape_1"]["match_count"] > 0
    for name in set(POSES) - {"cuts_person_shape_1"}:
        assert rows[name]["status"] == "error"
        assert f"trained on the tested pose {POSES[name]}" in rows[name]["message"]


def test_only_methods_that_learn_are_held_out(shapes: Path) -> None:
    spec = read_plan("demo").pairs()[0]
    method = ElasticNetMatching()
    assert held_out_for(method, spec) is method
    assert not isinstance(held_out_for(method, spec), Refused)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--folds", 1), "1 folds"),
        (("--folds", 2, "--leave-out", "person1"), "one of the two"),
        (("--leave-out", "person9"), "unknown source pose 'person9'"),
        (("--class", "cow"), "unknown class 'cow'"),
        (("--leave-out", "person1", "--leave-out", "person2", "--leave-out", "person3"), "no part is left"),
        (("--set", "trees=0"), "trees is 0"),
        (("--set", "bushes=1"), "unknown setting of ForestSettings 'bushes'"),
    ],
)
def test_what_cannot_be_trained_is_said(
    words: tuple[object, ...], complaint: str, shapes: Path, nonrigid: Callable[..., Any], tmp_path: Path
) -> None:
    done = nonrigid("train", "rf", "--data", shapes, "--out", tmp_path / "f", *words)
    assert done.code == 2
    assert complaint in done.err
