from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import write_baryc, write_corr
from nonrigid.benchmark.predictions import predicted
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.points import SurfacePoints

Command = Callable[..., Any]


@pytest.fixture
def dataset(person: PairData, tmp_path: Path) -> Path:
    """Return a data set in files: the same part twice, once as a cut and once with holes."""
    root = tmp_path / "set"
    assert person.truth is not None
    assert person.mirrored is not None
    (root / "null").mkdir(parents=True)
    write_off(person.full, root / "null" / "anton.off")
    for split in ("cuts", "holes"):
        (root / split).mkdir()
        write_off(person.part, root / split / f"{split}_anton_shape_1.off")
        write_baryc(root / split / f"{split}_anton_shape_1.baryc_gt", person.truth)
        write_baryc(root / split / f"{split}_anton_shape_1.baryc_gt_sym", person.mirrored)
    return root


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "theirs").mkdir()
    return tmp_path / "theirs"


def test_a_folder_is_scored_as_its_files_are(
    person: PairData, dataset: Path, folder: Path, tmp_path: Path, nonrigid: Command
) -> None:
    assert person.truth is not None
    rolled = SurfacePoints(np.roll(person.truth.faces, 5), np.roll(person.truth.barycentric, 5, axis=0))
    prediction = folder / "cuts_anton_shape_1.corr"
    write_corr(prediction, rolled)
    (folder / "stranger.vts").write_text("1\n")
    words = ("score", folder, "--data", dataset, "--out", tmp_path / "out", "--label", "they", "--json")
    answer = json.loads(nonrigid(*words).out)
    assert answer["without_prediction"] == ["holes_anton_shape_1"]
    assert answer["unused"] == ["stranger"]
    place = dataset / "cuts" / "cuts_anton_shape_1"
    sides = ("--truth", place.with_suffix(".baryc_gt"), "--mirrored", place.with_suffix(".baryc_gt_sym"))
    single = json.loads(nonrigid("score", prediction, "--full", dataset / "null" / "anton.off", *sides, "--json").out)
    (row,) = answer["scores"]
    assert row["method"] == "they"
    assert row["mean_error_x100"] == pytest.approx(single["mean_error_x100"], rel=1e-9)
    assert nonrigid("report", tmp_path / "out").code == 0
    # Once a prediction changes, so do the scores.
    write_corr(prediction, person.truth)
    assert json.loads(nonrigid(*words).out)["scores"][0]["mean_error_x100"] < 1e-3


def test_what_cannot_be_scored_is_named(dataset: Path, folder: Path, nonrigid: Command) -> None:
    assert "holds no predictions" in nonrigid("score", folder, "--data", dataset).err
    (folder / "a.map").write_text("0\n")
    answer = nonrigid("score", folder, "--data", dataset)
    assert answer.code == 2
    assert "cuts_anton_shape_1.corr" in answer.err
    assert "give --data" in nonrigid("score", folder).err
    assert "give --full and --truth" in nonrigid("score", folder / "a.map").err
    # What would be passed over is refused.
    assert "leave --part out" in nonrigid("score", folder, "--data", dataset, "--part", folder / "a.map").err
    assert "leave --label out" in nonrigid("score", folder / "a.map", "--label", "they").err
    (folder / "a.vts").write_text("1\n")
    with pytest.raises(InputError, match="keep one of them"):
        predicted(folder)
