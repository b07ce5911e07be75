"""Tables of older versions are read, those of newer ones refused, and results of several machines put together."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nonrigid.benchmark.merge import merge_results
from nonrigid.benchmark.schema import SCHEMA_VERSION
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.tables import COLUMNS, ENVIRONMENTS, TRACES, read_table, write_tables
from nonrigid.geometry.errors import InputError


def record(run: str, error: float = 0.1, **more: object) -> dict[str, Any]:
    stage = {
        "problem": "game",
        "problem_hash": "h",
        "sense": "maximize",
        "usable": True,
        "objective": 1.0,
        "trace": [[0.1, 1.0, 0.5, 0.0], [0.2, 2.0, 1.0, 0.0]],
    }
    head = {"id": run, "pair": "p", "split": "cuts", "label": "gt", "method": "gt", "backend": "native", "source": "s"}
    return {**head, "status": "stationary", "message": "", "mean_error": error, "stages": [stage], **more}


def folder(place: Path, records: list[dict[str, Any]], **index: object) -> Path:
    store = Store(place)
    store.prepare()
    for one in records:
        store.write_run(one)
        store.match_file(one["id"]).write_text("1 1 0 0\n")
    store.write_environment("e1", {"python": "3.11", "packages": {"numpy": "2"}, "blas": [{"version": "1"}]})
    labels = {one["id"]: one["label"] for one in records}
    store.write_index({"title": "t", "dataset": "d", "metric": "m", "runs": labels, **index})
    return place


def old_table(place: Path) -> Path:
    names = [name for name in COLUMNS if name not in COLUMNS_OF_TWO]
    table = pa.table({name: pa.array([None], COLUMNS[name]) for name in names})
    pq.write_table(table.replace_schema_metadata({"nonrigid_schema": "1"}), place)
    return place


COLUMNS_OF_TWO = ("accuracy", "accepted", "total_seconds", "peak_memory", "environment")


def test_a_table_of_schema_1_gets_the_columns_of_today(tmp_path: Path) -> None:
    table = read_table(old_table(tmp_path / "runs.parquet"))
    assert table.column_names == list(COLUMNS)
    assert table.schema.metadata[b"nonrigid_schema"] == str(SCHEMA_VERSION).encode()
    assert [str(table.schema.field(name).type) for name in COLUMNS_OF_TWO] == [
        "string",
        "bool",
        *["double"] * 2,
        "string",
    ]


def test_a_newer_table_and_another_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.parquet"
    pq.write_table(pa.table({"id": ["a"]}).replace_schema_metadata({"nonrigid_schema": "3"}), path)
    with pytest.raises(InputError, match=r"runs.parquet: schema 3, but this version reads 1 to 2"):
        read_table(path)
    pq.write_table(pa.table({"id": ["a"]}), path)
    with pytest.raises(InputError, match="schema none"):
        read_table(path)
    path.write_text("no table")
    with pytest.raises(InputError, match="cannot be read as parquet"):
        read_table(path)


def test_a_record_of_schema_1_is_read_and_a_newer_one_refused(tmp_path: Path) -> None:
    store = Store(folder(tmp_path / "a", [record("x")]))
    path = store.runs / "x.json"
    path.write_text(json.dumps({**record("x"), "schema": 1}))
    (tmp_path / "a" / "index.json").write_text(
        (tmp_path / "a" / "index.json").read_text().replace('"schema": 2', '"schema": 1')
    )
    assert store.records()[0]["accepted"] is None
    path.write_text(json.dumps({**record("x"), "schema": 3}))
    with pytest.raises(InputError, match=r"x.json: schema 3"):
        store.records()


def test_traces_and_environments_are_tables(tmp_path: Path) -> None:
    store = Store(folder(tmp_path, [record("x"), record("y")]))
    store.write_table(store.records())
    traces = pq.read_table(tmp_path / "traces.parquet")
    assert traces.column_names == list(TRACES)
    assert traces["objective"].to_pylist() == [0.5, 1.0] * 2
    facts = pq.read_table(tmp_path / "environment.parquet")
    assert facts.column_names == list(ENVIRONMENTS)
    assert {(row["name"], row["value"]) for row in facts.to_pylist()} == {
        ("python", "3.11"),
        ("packages.numpy", "2"),
        ("blas.0.version", "1"),
    }
    assert write_tables(tmp_path, [], {}).name == "runs.parquet"


def test_shares_are_merged(tmp_path: Path) -> None:
    both = {"runs": {"x": "gt", "y": "gt"}}
    one = folder(tmp_path / "1", [record("x")], **both)
    two = folder(tmp_path / "2", [record("y"), record("x", 0.1 + 1e-9)], **both)
    found = merge_results([one, two], tmp_path / "out")
    assert [run["id"] for run in found] == ["x", "y"]
    assert found[0]["mean_error"] == 0.1
    assert Store(tmp_path / "out").match_file("y").is_file()
    assert read_table(tmp_path / "out" / "runs.parquet")["id"].to_pylist() == ["x", "y"]


def test_conflicts_are_named(tmp_path: Path) -> None:
    one, two = folder(tmp_path / "1", [record("x")]), folder(tmp_path / "2", [record("x", 0.3)])
    words = r"1 runs have different results: x \(p by gt with native\): mean_error is 0.1 in .*1 and 0.3 in .*2"
    with pytest.raises(InputError, match=words):
        merge_results([one, two], tmp_path / "out")
    assert not (tmp_path / "out").exists()
    other = folder(tmp_path / "3", [record("z")], metric="exact")
    with pytest.raises(InputError, match=r"its metric is exact, that of .* m"):
        merge_results([one, other], tmp_path / "out")
    shutil.copytree(one, tmp_path / "out")
    with pytest.raises(InputError, match="holds results already"):
        merge_results([one], tmp_path / "out")


def test_other_data_and_other_settings_under_one_label_are_not_mixed(tmp_path: Path) -> None:
    one = folder(tmp_path / "1", [record("x", settings="GT(20)")], data="creatures 800")
    other = folder(tmp_path / "2", [record("y", settings="GT(20)")], data="creatures 2500")
    with pytest.raises(InputError, match=r"its data is creatures 2500, that of .* creatures 800"):
        merge_results([one, other], tmp_path / "out")
    twin = folder(tmp_path / "3", [record("z", settings="GT(80)")], data="creatures 800")
    with pytest.raises(InputError, match=r"'gt' with native on p has other settings than in .*1; give each its own"):
        merge_results([one, twin], tmp_path / "out")
    seeds = folder(tmp_path / "4", [record("s", settings="GT(20)", seed=1)], data="creatures 800")
    assert len(merge_results([one, seeds], tmp_path / "out")) == 2
