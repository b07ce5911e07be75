"""The commands do what they say; bad input gives one line and exit code 2."""

from __future__ import annotations

import contextlib
import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import read_corr, write_corr
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh

Command = Callable[..., Any]

SMALL = ("--set", "part_samples=30", "--set", "full_samples=150", "--set", "per_sample=5", "--set", "groups=1")


@pytest.fixture(scope="module")
def matched(files: Path, nonrigid: Command) -> Path:
    out = files / "m.corr"
    answer = nonrigid("match", files / "part.off", files / "full.off", "--out", out, *SMALL, "--json")
    assert answer.code == 0, answer.err
    record = json.loads(answer.out)
    assert record["status"] in ("stationary", "certified")
    assert record["stages"][0]["variables"] == 150
    return out


def test_match_writes_one_row_a_vertex(matched: Path, person: PairData) -> None:
    points = read_corr(matched, full=person.full, expected_rows=len(person.part.vertices))
    assert 3 <= points.matched.sum() <= 30


def test_score_needs_the_part_for_coverage_alone(matched: Path, files: Path, nonrigid: Command) -> None:
    truth = (
        "--full",
        files / "full.off",
        "--truth",
        files / "part.baryc_gt",
        "--mirrored",
        files / "part.baryc_gt_sym",
    )
    without = json.loads(nonrigid("score", matched, *truth, "--json").out)
    whole = json.loads(nonrigid("score", matched, *truth, "--part", files / "part.off", "--json").out)
    assert without["coverage"] is None
    assert 0 < whole["coverage"] <= 1
    assert all(without[key] == whole[key] for key in without if key not in ("coverage", "kept_area"))
    assert without["mean_error_x100"] >= without["mean_error_per_point_x100"]
    shown = nonrigid("score", matched, *truth)
    assert shown.code == 0
    assert "give --part" in shown.out


def test_the_truth_scores_zero(person: PairData, files: Path, tmp_path: Path, nonrigid: Command) -> None:
    assert person.truth is not None
    write_corr(tmp_path / "t.corr", person.truth)
    answer = nonrigid(
        "score", tmp_path / "t.corr", "--full", files / "full.off", "--truth", files / "part.baryc_gt", "--json"
    )
    record = json.loads(answer.out)
    assert record["mean_error_x100"] < 1e-3
    assert record["unmatched"] == 0


def test_a_refused_solver_exits_with_one(files: Path, tmp_path: Path, nonrigid: Command) -> None:
    words = ("match", files / "part.off", files / "full.off", "--out", tmp_path / "m.corr", *SMALL)
    answer = nonrigid(*words, "--backend", "casadi:bonmin")
    assert answer.code == 1
    assert "refused" in answer.out
    assert "80 strategies" in answer.err
    assert len(answer.err.splitlines()) == 1
    assert not (tmp_path / "m.corr").exists()


def test_a_chain_and_a_backend_a_stage(files: Path, tmp_path: Path, nonrigid: Command) -> None:
    words = ("match", files / "part.off", files / "full.off", "--out", tmp_path / "m.corr", *SMALL, "--json")
    answer = nonrigid(*words, "--backend", "game=casadi:bonmin+native:replicator,local=scipy", "--time-limit", 20)
    assert answer.code == 0, answer.err
    stages = json.loads(answer.out)["stages"]
    assert stages[0]["solver"] == "native:replicator"
    assert stages[-1]["solver"].startswith("scipy:")


def test_the_matrix_has_every_backend_and_says_why_not(nonrigid: Command) -> None:
    answer = nonrigid("solvers", "--problem", "gt", "--set", "part_samples=60", "--set", "full_samples=200", "--json")
    rows = json.loads(answer.out)
    assert {row["backend"] for row in rows} >= {"native", "nlopt", "casadi", "cvxpy", "scipy"}
    bonmin = next(row for row in rows if row["algorithm"] == "bonmin")
    assert not bonmin["accepted"]
    assert "80" in bonmin["answer"]
    assert bonmin["small_answer"].startswith("via")
    assert all(row["answer"] for row in rows)


def test_cite_gives_each_entry_once(nonrigid: Command) -> None:
    answer = nonrigid("cite")
    keys = [line for line in answer.out.splitlines() if line.startswith("@")]
    assert len(keys) == len(set(keys)) > 20
    assert answer.out.count("{") == answer.out.count("}")


def test_cache_is_counted_and_cleared(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, nonrigid: Command) -> None:
    monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path))
    (tmp_path / "ab").mkdir()
    np.savez(tmp_path / "ab" / "abc.npz", x=np.ones(3))
    assert json.loads(nonrigid("cache", "info", "--json").out)["entries"] == 1
    assert json.loads(nonrigid("cache", "clear", "--json").out)["removed"] == 1
    assert nonrigid("cache", "info").out.startswith("0 results")


def _bad_meshes(folder: Path, person: PairData) -> None:
    text = (folder / "part.off").read_text().splitlines()
    (folder / "truncated.off").write_text("\n".join(text[: len(text) // 2]))
    (folder / "nan.off").write_text("\n".join([*text[:2], "nan 0 0", *text[3:]]))
    (folder / "index.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "flat.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n")
    moved = np.vstack([person.part.vertices, person.part.vertices + 100])
    write_off(
        Mesh(moved, np.vstack([person.part.faces, person.part.faces + len(person.part.vertices)])), folder / "two.off"
    )
    (folder / "short.baryc_gt").write_text("1.0 1 0 0\n")
    (folder / "mesh.txt").write_text("OFF")


BAD = {
    "missing file": ("match none.off full.off --out m.corr", "no such file"),
    "truncated OFF": ("match truncated.off full.off --out m.corr", "truncated.off"),
    "NaN": ("match nan.off full.off --out m.corr", "nan.off"),
    "index out of range": ("match index.off full.off --out m.corr", "index.off"),
    "empty mesh": ("match empty.off full.off --out m.corr", "empty.off"),
    "several components": ("match two.off full.off --out m.corr", "pieces"),
    "zero area": ("match flat.off full.off --out m.corr", "area"),
    "wrong suffix": ("match mesh.txt full.off --out m.corr", "suffix"),
    "part larger than the whole": ("match full.off part.off --out m.corr", "times the area"),
    "truth with a wrong row count": ("score m.corr --full full.off --truth short.baryc_gt --part part.off", "1 rows"),
    "truth that does not fit": ("score m.corr --full full.off --truth short.baryc_gt", "rows"),
    "unknown metric": ("score m.corr --full full.off --truth part.baryc_gt --metric crow", "crow"),
    "unknown method": ("match part.off full.off --out m.corr --method zz", "unknown method 'zz'"),
    "unknown backend": ("match part.off full.off --out m.corr --backend ipopt", "unknown backend 'ipopt'"),
    "unknown algorithm": ("match part.off full.off --out m.corr --backend nlopt:LD_X", "LD_CCSAQ"),
    "empty chain": ("match part.off full.off --out m.corr --backend native+", "empty"),
    "unknown setting": ("match part.off full.off --out m.corr --set width=3", "kernel_width"),
    "setting without value": ("match part.off full.off --out m.corr --set width", "name=value"),
    "setting of a wrong type": ("match part.off full.off --out m.corr --set part_samples=2.5", "whole number"),
    "unknown option": ("match part.off full.off --out m.corr --speed 3", "--speed"),
    "missing option": ("match part.off full.off", "out"),
    "word for a number": ("match part.off full.off --out m.corr --seed one", "--seed"),
    "time limit of zero": ("match part.off full.off --out m.corr --time-limit 0", "seconds is 0"),
    "no starts": ("match part.off full.off --out m.corr --starts 0", "starts is 0"),
    "folder that is not there": ("match part.off full.off --out none/m.corr", "none"),
    "unknown command": ("mach part.off", "mach"),
    "no command": ("", "command"),
    "missing plan": ("bench none.toml --out res", "none.toml"),
    "no jobs": ("bench demo --out res --jobs 0", "--jobs is 0"),
    "no results": ("report .", "no results"),
}


@pytest.mark.parametrize("name", list(BAD))
def test_bad_input_gives_one_line_and_exit_code_two(
    name: str,
    files: Path,
    person: PairData,
    matched: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    nonrigid: Command,
) -> None:
    for source in [*files.glob("*.off"), *files.glob("*gt*"), matched]:
        shutil.copy(source, tmp_path)
    _bad_meshes(tmp_path, person)
    monkeypatch.chdir(tmp_path)
    words, expected = BAD[name]
    answer = nonrigid(*words.split())
    assert answer.code == 2
    assert len(answer.err.splitlines()) == 1
    assert answer.err.startswith("nonrigid: ")
    assert expected in answer.err
    assert "Traceback" not in answer.out + answer.err


def test_the_installed_command_behaves_alike(tmp_path: Path) -> None:
    code = "from nonrigid.benchmark.cli import main; main()"
    words = [sys.executable, "-c", code, "match", "a.off", "b.off", "--out", "c.corr"]
    answer = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert answer.returncode == 2
    assert answer.stderr == "nonrigid: a.off: there is no such file; check the path\n"
    assert answer.stdout == ""


def test_an_interrupted_benchmark_says_what_is_kept(tmp_path: Path) -> None:
    # Processes begun in the background may ignore the signal from birth.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from nonrigid.benchmark.cli import main; main()"
    words = [sys.executable, "-c", code, "bench", "demo", "--out", "results"]
    child = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    deadline = time.monotonic() + 100.0
    while not (tmp_path / "results" / "index.json").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    heard = ""
    while not heard and time.monotonic() < deadline:
        # Once may not be enough: a library that is just being cleared away swallows what is raised there.
        child.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            heard = child.communicate(timeout=8)[1]
    assert child.returncode == 130
    assert heard.splitlines()[-1] == "nonrigid: interrupted; finished runs are kept"


def test_a_benchmark_says_why_runs_have_no_match(tmp_path: Path, nonrigid: Command) -> None:
    (tmp_path / "p.toml").write_text(
        'backends = ["native"]\n[data]\ndataset = "creatures"\nvertices = 600\nnames = ["cuts_cat_shape_1"]\n'
        '[[methods]]\nmethod = "gt"\nsettings = { part_samples = 0 }\n'
    )
    answer = nonrigid("bench", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out"), "--quiet")
    assert "native: 1 without a match (error), such as cuts_cat_shape_1: part_samples is 0" in answer.out


def test_match_says_what_was_mended(files: Path, tmp_path: Path, nonrigid: Command) -> None:
    lines = (files / "part.off").read_text().splitlines()
    vertices, faces, edges = lines[1].split()
    lines[1] = f"{vertices} {int(faces) + 1} {edges}"
    (tmp_path / "part.off").write_text("\n".join([*lines, "3 0 0 1", ""]))
    words = ("match", tmp_path / "part.off", files / "full.off", "--out", tmp_path / "m.corr", *SMALL)
    mended = "dropped 1 face that names a vertex twice"
    assert f"part.off, as it was matched: {mended}" in nonrigid(*words).out
    assert json.loads(nonrigid(*words, "--json").out)["repairs"] == {"part.off": [mended], "full.off": []}
