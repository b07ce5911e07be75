"""A benchmark that is killed, starved, crashed and robbed of workers ends with the results of one left in peace."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

CHAOS = Path(__file__).resolve().parents[2] / "benchmarks" / "chaos.py"


def test_a_disturbed_benchmark_ends_like_an_undisturbed_one(tmp_path: Path) -> None:
    words = [sys.executable, str(CHAOS), "--small", "--json", "--folder", str(tmp_path)]
    answer = subprocess.run(words, capture_output=True, text=True, check=False)
    assert answer.stdout, answer.stderr
    rows = json.loads(answer.stdout)["rows"]
    assert answer.returncode == 0, [row for row in rows if not row[2]]
    seen = {what: words for what, words, _ in rows}
    assert "1 backend_error" in seen["undisturbed"]
    assert "2 limit" in seen["undisturbed"]
    assert {"disk full once", "worker killed once", "Dask worker killed"} <= set(seen)
