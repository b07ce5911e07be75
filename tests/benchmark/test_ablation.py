"""The table of what an idea is worth compares pair by pair, cuts and holed shapes apart."""

from __future__ import annotations

import runpy
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "ablation.py"


def record(label: str, pair: str, error: float | None) -> dict[str, object]:
    seconds = {"formulation_seconds": 2.0, "solve_seconds": 1.0}
    return {"label": label, "pair": pair, "split": pair.split("_")[0], "mean_error": error, **seconds}


def test_a_label_is_compared_on_the_pairs_that_both_matched() -> None:
    records = [record("whole", f"cuts_{k}", 0.01 * k) for k in range(5)] + [record("whole", "holes_0", 0.01)]
    records += [record("less", f"cuts_{k}", 0.01 * k + 0.01) for k in range(4)] + [record("less", "cuts_4", None)]
    whole, less = runpy.run_path(str(SCRIPT))["rows"](records, "whole")
    assert (whole["cuts: n"], whole["cuts: mean"], whole["holes: n"], whole["s"]) == (5, "2.00", 1, "3.0")
    assert "cuts: difference" not in whole
    assert (less["cuts: n"], less["cuts: mean"], less["cuts: worse, better"]) == (4, "2.50", "4, 0")
    assert less["cuts: difference"] == "+1.00 (+1.00 to +1.00)"
    assert "holes: n" not in less
