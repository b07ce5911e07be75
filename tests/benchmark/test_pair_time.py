"""The seconds of a pair are told apart by stage, and every pair is timed once from nothing and once after another."""

from __future__ import annotations

import runpy
import time
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "pair_time.py"


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(SCRIPT))


def work(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_a_stage_inside_another_counts_once(script: dict[str, Any]) -> None:
    clock = script["Clock"]()
    with clock.running("the rest"):
        with clock.running("distances"):
            work(0.02)
            with clock.running("eigenpairs"):
                work(0.05)
        work(0.01)
    spent = clock.seconds
    assert spent["distances"] >= 0.02
    assert spent["eigenpairs"] >= 0.05
    assert spent["the rest"] >= 0.01
    assert {stage for stage, seconds in spent.items() if seconds} == {"distances", "eigenpairs", "the rest"}


def test_every_stage_that_is_a_call_exists(script: dict[str, Any]) -> None:
    for _, owner, names in script["CALLS"]:
        assert all(callable(getattr(owner, name)) for name in names)
