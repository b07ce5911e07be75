"""Every run ends as a row, and no finished run is lost or done twice."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from nonrigid.benchmark.aggregate import scored_rows
from nonrigid.benchmark.plan import Plan, read_plan
from nonrigid.benchmark.report.table import refusals, summary
from nonrigid.benchmark.report.write import write_report
from nonrigid.benchmark.run import do_run, problem_hash
from nonrigid.benchmark.runner import plan_runs, run_plan
from nonrigid.benchmark.schema import SCHEMA_VERSION
from nonrigid.benchmark.store import Store, with_gaps
from nonrigid.benchmark.tables import COLUMNS
from nonrigid.formulations.formulation import Pair, Stages
from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh

TEXT = """
backends = ["native", "native:replicator", "casadi:bonmin", "scipy:L-BFGS-B"]
[data]
dataset = "creatures"
vertices = 600
names = ["cuts_cat_shape_1", "holes_cat_shape_2"]
[limits]
seconds = 10
[[methods]]
method = "gt"
settings = { part_samples = 30, full_samples = 150, per_sample = 5, groups = 1 }
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    path = tmp_path_factory.mktemp("plan") / "small.toml"
    path.write_text(TEXT)
    return read_plan(path)


@pytest.fixture(scope="module")
def results(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("results")
    run_plan(plan, out, quiet=True)
    return out


def test_every_run_is_a_row_and_a_refusal_says_why(results: Path) -> None:
    records = Store(results).records()
    assert len(records) == 8
    lost = [record for record in records if record["backend"] == "casadi:bonmin"]
    assert {record["status"] for record in lost} == {"refused"}
    assert [(row["runs"], "strategies" in str(row["reason"])) for row in refusals(records)] == [(2, True)]
    for record in records:
        if record not in lost:
            assert record["mean_error"] >= 0
            assert record["gap"] >= 0
            assert len(record["curve"]) == 51
            assert Store(results).match_file(record["id"]).is_file()
    rows = summary(records)
    assert [row["split"] for row in rows[:3]] == ["all", "cuts", "holes"]
    assert rows[-1]["pairs"] == "0/1"
    assert rows[-1]["solve_seconds"] is None


def test_the_table_is_parquet_with_a_schema(results: Path) -> None:
    table = pq.read_table(results / "runs.parquet")
    assert table.schema.metadata[b"nonrigid_schema"] == str(SCHEMA_VERSION).encode()
    assert table.column_names == list(COLUMNS)
    stages = json.loads(table["stages"][0].as_py())
    assert stages[0]["trace"]
    environment = json.loads((results / "environment.json").read_text())
    assert environment["packages"]["numpy"]
    assert environment["blas"]


def test_finished_runs_are_skipped_and_lost_ones_repeated(plan: Plan, results: Path) -> None:
    files = sorted((results / "runs").iterdir())
    before = {path: path.stat().st_mtime_ns for path in files}
    first = Store(results).records()
    files[0].unlink()
    again = run_plan(plan, results, quiet=True)
    after = {path: path.stat().st_mtime_ns for path in files}
    assert [path for path in files if after[path] != before[path]] == [files[0]]
    keys = ("id", "status", "objective", "mean_error", "gap")
    assert [[r.get(key) for key in keys] for r in again] == [[r.get(key) for key in keys] for r in first]


def test_a_killed_benchmark_goes_on_where_it_was(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(TEXT)
    code = "from nonrigid.benchmark.cli import main; main()"
    words = [sys.executable, "-c", code, "bench", "plan.toml", "--out", "res", "--jobs", "1"]
    runs = tmp_path / "res" / "runs"
    child = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not list(runs.glob("*.json")) and child.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    kept = {path: path.stat().st_mtime_ns for path in runs.glob("*.json")}
    assert kept
    answer = subprocess.run([*words, "--json"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert answer.returncode == 0, answer.stderr
    assert len(list(runs.glob("*.json"))) == 8
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in kept.items())
    assert {row["backend"] for row in json.loads(answer.stdout)} == set(read_plan(tmp_path / "plan.toml").backends)


def test_two_processes_give_the_same_results(plan: Plan, results: Path, tmp_path: Path) -> None:
    parallel = run_plan(plan, tmp_path, jobs=2, quiet=True)
    keys = ("id", "problem_hash", "objective", "mean_error")
    serial = Store(results).records()
    assert [[r.get(key) for key in keys] for r in parallel] == [[r.get(key) for key in keys] for r in serial]


def test_an_id_changes_with_what_the_run_depends_on(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(TEXT.replace("seconds = 10", "seconds = 11"))
    other = read_plan(tmp_path / "other.toml")
    spec = plan.pairs()[0]
    mine, theirs = plan_runs(plan, spec), plan_runs(other, spec)
    ids = [run.id for run in mine + theirs]
    assert len(set(ids)) == 8
    assert [run.id for run in plan_runs(plan, spec)] == [run.id for run in mine]


@dataclass(frozen=True, kw_only=True)
class Broken:
    """A method that fails after its first problem."""

    def stages(self, pair: Pair) -> Stages:
        u = Variable("u", 3)
        yield Problem("first", maximize(QuadraticForm(np.ones((3, 3)) - np.eye(3))(u)), u @ Simplex())
        raise ZeroDivisionError("no second problem")


def test_a_failing_method_is_a_row(plan: Plan, tmp_path: Path) -> None:
    spec = plan.pairs()[0]
    run = plan_runs(plan, spec)[0]
    store = Store(tmp_path)
    store.prepare()
    data = spec.load()
    broken = type(run)(**{**vars(run), "formulation": Broken()})
    record = do_run(broken, data, Pair.of(data.part, data.full), store)
    assert (record["status"], record["message"]) == ("error", "ZeroDivisionError: no second problem")
    assert store.has(broken.id)


def test_objectives_are_compared_on_equal_problems_only() -> None:
    def run(digest: str | None, value: float, sense: str = "maximize") -> dict[str, Any]:
        return {"stages": [{"problem_hash": digest, "sense": sense, "usable": True, "objective": value}]}

    found = with_gaps([run("a", 2.0), run("a", 1.0), run("b", 1.0), run(None, 1.0), run("c", 1.0, "minimize")])
    assert [record["gap"] for record in found] == [0.0, 0.5, 0.0, None, 0.0]
    u = Variable("u", 3)
    game = Problem("game", maximize(QuadraticForm(np.eye(3))(u)), u @ Simplex())
    same = Problem("other name", maximize(QuadraticForm(np.eye(3))(u)), u @ Simplex())
    other = Problem("game", maximize(QuadraticForm(2 * np.eye(3))(u)), u @ Simplex())
    assert problem_hash(game) == problem_hash(same) != problem_hash(other)


def test_the_report_is_complete_and_asks_nobody(results: Path, nonrigid: Callable[..., Any]) -> None:
    answer = nonrigid("report", results, "--json")
    assert answer.code == 0
    page = Path(json.loads(answer.out)["page"]).read_text()
    assert "http://" not in page
    assert "https://" not in page
    assert all(backend in page for backend in ("native:replicator", "casadi:bonmin"))
    for name in ("curves.png", "curves-dark.svg", "time-light.svg", "solvers.csv", "solvers.md", "runs.csv"):
        assert (results / "report" / name).stat().st_size > 100
    assert "SLSQP" not in page
    assert "cvxpy" not in nonrigid("cite", results).out
    assert "rodola2012game" in nonrigid("cite", results).out


def test_an_unfinished_benchmark_can_be_reported(plan: Plan, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.prepare()
    store.write_index({"title": "<b>t</b>", "dataset": "creatures", "metric": "dijkstra", "runs": {"a": "gt"}})
    page = write_report(tmp_path, store.index(), store.records()).read_text()
    assert "1 of 1 runs are not finished" in page
    assert "&lt;b&gt;" in page


def test_results_of_another_schema_are_refused(tmp_path: Path) -> None:
    (tmp_path / "index.json").write_text('{"schema": 99}')
    with pytest.raises(InputError, match="schema 99"):
        Store(tmp_path).index()


def test_a_mesh_that_cannot_be_matched_is_a_row(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(part: Mesh, full: Mesh) -> Pair:
        raise InputError("two pieces", remedy="keep one")

    monkeypatch.setattr("nonrigid.benchmark.task.Pair.of", refuse)
    records = run_plan(plan, tmp_path, quiet=True)
    assert {(record["status"], record["message"]) for record in records} == {("error", "two pieces; keep one")}


def test_a_file_that_is_no_index_is_refused(tmp_path: Path) -> None:
    (tmp_path / "index.json").write_text("[]")
    with pytest.raises(InputError, match=r"index\.json: is no index of results; repeat"):
        Store(tmp_path).index()


def test_methods_that_are_the_same_are_refused(tmp_path: Path) -> None:
    twin = TEXT + '[[methods]]\nmethod = "gt"\nlabel = "twin"\nsettings = { part_samples = 30, full_samples = 150, '
    (tmp_path / "twin.toml").write_text(twin + "per_sample = 5, groups = 1 }\n")
    with pytest.raises(InputError, match="the methods 'gt' and 'twin' are the same with the same settings; leave one"):
        run_plan(read_plan(tmp_path / "twin.toml"), tmp_path / "out", quiet=True)


def test_files_of_others_in_the_folder_stay(plan: Plan, results: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(results, out)
    for name in (".s0.toml.swp", ".my.notes.txt", "thesis.part"):
        (out / name).write_text("mine")
    (out / ".a.b.c").mkdir()
    (out / ".index.json.x1").write_text("half")
    (out / "runs" / ".0.json.x1").write_text("half")
    run_plan(plan, out, quiet=True)
    assert all((out / name).exists() for name in (".s0.toml.swp", ".my.notes.txt", "thesis.part", ".a.b.c"))
    assert not (out / ".index.json.x1").exists()
    assert not (out / "runs" / ".0.json.x1").exists()


def test_matches_without_truth_are_counted(plan: Plan, tmp_path: Path) -> None:
    spec = replace(plan.pairs()[0], truth=None, mirrored=None)
    run = plan_runs(plan, spec)[0]
    store = Store(tmp_path)
    store.prepare()
    data = spec.load()
    record = do_run(run, data, Pair.of(data.part, data.full), store)
    assert record["match_count"] > 0
    assert record.get("mean_error") is None
    assert summary([record])[0]["pairs"] == "1/1"
    assert not refusals([record])
    assert not scored_rows([record])
