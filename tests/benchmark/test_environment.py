"""What a benchmark's processes load, and what they remember."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from nonrigid.benchmark.datasets.files import load_mesh
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh

CODE = """
import sys
import nonrigid.benchmark.cli
from nonrigid.benchmark.environment import known_environment
word, found = known_environment()
assert len(word) == 12 and found["backends"]["casadi"], found
print(*sys.modules)
"""


def test_a_process_that_forks_for_runs_holds_no_library_it_does_not_need() -> None:
    loaded = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True).stdout.split()
    assert "numpy" in loaded
    for heavy in ("casadi", "cvxpy", "nlopt", "matplotlib", "pyarrow", "trimesh", "scipy.stats"):
        assert heavy not in loaded


def test_a_mesh_is_read_once_as_long_as_its_file_stays_the_same(tmp_path: Path) -> None:
    place = tmp_path / "triangle.off"
    write_off(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), place)
    first = load_mesh(place)
    assert load_mesh(place) is first
    write_off(Mesh([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 1, 2]]), place)
    os.utime(place, ns=(0, place.stat().st_mtime_ns + 1))
    assert load_mesh(place).area == 2.0
