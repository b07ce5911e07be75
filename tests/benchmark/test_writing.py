import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nonrigid.benchmark.datasets.creatures import Creature, Creatures
from nonrigid.benchmark.datasets.parts import part_pairs
from nonrigid.benchmark.datasets.protocols import PairData, PairSpec
from nonrigid.benchmark.datasets.recipe import Recipe
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.datasets.statistics import part_statistics, summary
from nonrigid.benchmark.datasets.writing import write_dataset
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


class OneCat:
    """A cat in one pose."""

    name = "one cat"

    def classes(self) -> list[Creature]:
        cat = next(one for one in Creatures(vertices=600).classes() if one.name == "cat")
        return [replace(cat, anatomy=replace(cat.anatomy, poses=cat.anatomy.poses[:1]))]

    def pairs(self) -> list[PairSpec]:
        return part_pairs(self.classes(), seed=0)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "cats"
    assert write_dataset(OneCat(), folder) == 15
    return folder


def test_what_is_written_is_read_as_it_was_made(written: Path) -> None:
    made, read = OneCat().pairs(), Shrec16(root=written).pairs()
    assert {spec.name for spec in read} == {spec.name for spec in made}
    first = next(spec for spec in read if spec.name == made[0].name).load()
    again = made[0].load()
    np.testing.assert_array_equal(first.part.vertices, again.part.vertices)
    np.testing.assert_array_equal(first.full.faces, again.full.faces)
    for mine, its in ((first.truth, again.truth), (first.mirrored, again.mirrored)):
        assert mine is not None
        assert its is not None
        np.testing.assert_array_equal(mine.faces, its.faces)
        np.testing.assert_allclose(mine.barycentric, its.barycentric, atol=1e-15)
    with (written / "source_poses.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["shape"] for row in rows] == [spec.name for spec in made]
    assert int(rows[0]["vertices"]) == len(again.part.vertices)


def test_a_broken_off_run_is_taken_up_and_gives_the_same_bytes(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(written)
    monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path / "cold"))
    for lost in ("cuts/cuts_cat_shape_3.off", "holes/holes_cat_shape_1.baryc_gt", "holes/holes_cat_shape_1.off"):
        (written / lost).unlink()
    (written / "source_poses.csv").unlink()
    write_dataset(OneCat(), written)
    assert contents(written) == before


def test_a_folder_of_something_else_is_left_alone(written: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        write_dataset(OneCat(), tmp_path)
    with pytest.raises(InputError, match="holds another data set"):
        write_dataset(Creatures(vertices=700), written)


def test_the_command_makes_parts_of_meshes(tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    source = tmp_path / "dense"
    source.mkdir()
    template = OneCat().classes()[0].template()
    write_off(template, source / "thing0.off")
    write_off(template.transformed(scale=1.1), source / "thing1.off")
    made = nonrigid("data", "make", "recipe", "--from", source, "--out", tmp_path / "out", "--vertices", 500)
    assert made.code == 0
    assert "15 parts" in made.out
    assert len(list((tmp_path / "out" / "cuts").glob("*.off"))) == 6
    assert len(Recipe(root=source, vertices=500).pairs()) == 15
    assert nonrigid("data", "make", "recipe", "--out", tmp_path / "no").code == 2
    assert nonrigid("data", "make", "creatures", "--from", source, "--out", tmp_path / "no").code == 2


def test_statistics_of_a_known_part() -> None:
    grid = Mesh([[x, y, 0] for x in range(3) for y in range(3)],
                [[3 * x + y, 3 * x + y + 3, 3 * x + y + 4] for x in range(2) for y in range(2)]
                + [[3 * x + y, 3 * x + y + 4, 3 * x + y + 1] for x in range(2) for y in range(2)])  # fmt: skip
    part = Mesh([[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 1, 2]])
    row = part_statistics(PairData(name="p", part=part, full=grid, truth=SurfacePoints.at_vertices(grid, [0, 3, 4])))
    assert row["area_kept"] == pytest.approx(2.0 / 4.0)
    assert row["boundary_length"] == pytest.approx((4 + np.sqrt(8)) / 2)
    assert (row["boundary_loops"], row["ratio_50"]) == (1, pytest.approx(0.5))
    assert summary([row, {**row, "vertices": 5}])["vertices"] == (4.0, 3.0, 5.0)


def test_area_is_accounted_for_and_the_truth_does_not_jump() -> None:
    for spec in OneCat().pairs()[::4]:
        row = part_statistics(spec.load())
        assert 0.1 < float(str(row["area_kept"])) < 0.98
        assert float(str(row["ratio_5"])) > 0.8
        assert float(str(row["ratio_95"])) < 1.25
