"""Executors are named in words, refused with a reason, and plans are estimated before they are run."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nonrigid.benchmark import helper
from nonrigid.benchmark.executors import Dask, Executor, InProcess, Joblib, make_executor
from nonrigid.benchmark.task import WorkerLostError
from nonrigid.geometry.errors import InputError, UnknownNameError


def test_executors_are_named() -> None:
    assert make_executor("joblib", workers=3) == Joblib(workers=3)
    assert make_executor("inprocess") == InProcess()
    assert make_executor("dask", scheduler="tcp://h:1") == Dask(scheduler="tcp://h:1")
    assert all(isinstance(make_executor(kind), Executor) for kind in ("joblib", "dask", "inprocess"))


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        ("slurm", {}, "unknown executor 'slurm'; choose one of: dask, inprocess, joblib"),
        ("joblib", {"workers": 0}, "--jobs is 0"),
        ("joblib", {"scheduler": "tcp://h:1"}, "give --executor dask"),
        ("inprocess", {"workers": 2}, "inprocess is one process"),
    ],
)
def test_a_wrong_executor_is_refused(kind: str, more: dict[str, Any], words: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=words):
        make_executor(kind, **more)


def test_a_dry_run_estimates_and_runs_nothing(tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    answer = nonrigid("bench", "demo", "--out", tmp_path / "out", "--dry-run", "--jobs", "2")
    assert answer.code == 0, answer.err
    assert "40 runs, 0 finished; the other 40 take about 0.017 h with 2 processes" in answer.out
    assert "assumed: none is finished" in answer.out
    assert not (tmp_path / "out").exists()


def test_a_share_is_written_as_a_fraction(tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    answer = nonrigid("bench", "demo", "--out", tmp_path, "--share", "3/2")
    assert answer.code == 2
    assert "--share is '3/2'" in answer.err


def test_a_dry_run_counts_its_share(tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    whole, half = (
        json.loads(nonrigid("bench", "demo", "--out", tmp_path / "out", "--dry-run", "--json", *more).out)["runs"]
        for more in ((), ("--share", "1/2"))
    )
    assert half == whole // 2


def test_a_lost_helper_is_a_lost_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    gone = subprocess.Popen(
        [sys.executable, "-c", "import sys; sys.stdin.read(1)"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    monkeypatch.setattr(helper._here, "process", gone, raising=False)
    with pytest.raises(WorkerLostError, match="the process beside a worker ended"):
        helper.in_helper("a task")  # type: ignore[arg-type]


def test_errors_travel_between_processes() -> None:
    error = UnknownNameError("backend", "nlop", ["native", "nlopt"])
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
