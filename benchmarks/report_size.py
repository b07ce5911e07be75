"""Time the report of many runs: python benchmarks/report_size.py [RUNS] [FOLDER].

The runs are made up on balls of 10 242 vertices and pieces of them, in the layout of SHREC'16: forty runs a pair, by
four dense and four sparse methods with five backends each, with four solves of a hundred trace points a run. As in
`nonrigid report`, one process a core writes; that is compared with reading the same runs alone, which no report can do
without.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from nonrigid.benchmark.formats import write_baryc
from nonrigid.benchmark.matched_points import matched_points, write_points
from nonrigid.benchmark.report.write import write_report
from nonrigid.benchmark.store import Store
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

METHODS = ("pfm", "rf", "anchored", "grown", "gt", "en", "im", "spectral")
BACKENDS = ("native", "nlopt:LD_LBFGS", "casadi:ipopt", "cvxpy:CLARABEL", "scipy:L-BFGS-B")
PLAN = """
title = "Made up"
backends = ["native"]
[data]
dataset = "shrec16"
root = "data"
splits = ["cuts"]
[[methods]]
method = "gt"
"""


def main() -> None:
    """Make the runs up, write their report, print what it took."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(temporary)
        fill(folder, count)
        store = Store(folder)
        begun = time.perf_counter()
        index, records = store.index(), store.records()
        read = time.perf_counter() - begun
        begun = time.perf_counter()
        write_report(folder, index, records, jobs=os.cpu_count() or 1)
        written = time.perf_counter() - begun
        size = sum(path.stat().st_size for path in (folder / "report").rglob("*") if path.is_file())
        pages = len(list((folder / "report" / "pairs").iterdir()))
        total = read + written
        sys.stdout.write("  runs  pages  read s  report s  total s  ratio   MB\n")
        sys.stdout.write(f"{len(records):6} {pages:6} {read:7.1f} {written:9.1f} ")
        sys.stdout.write(f"{total:8.1f} {total / read:6.1f} {size / 1e6:4.0f}\n")


def fill(folder: Path, count: int) -> None:
    """Write data, plan and runs."""
    generator = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(subdivisions=5)
    full = Mesh(ball.vertices, ball.faces, name="ball")
    for place in ("null", "cuts"):
        (folder / "data" / place).mkdir(parents=True, exist_ok=True)
    write_off(full, folder / "data" / "null" / "ball.off")
    (folder / "plan.toml").write_text(PLAN)
    store = Store(folder)
    store.prepare()
    labels: dict[str, str] = {}
    for pair in range(-(-count // (len(METHODS) * len(BACKENDS)))):
        name = f"cuts_ball_shape_{pair}"
        kept = np.flatnonzero(full.vertices @ generator.normal(size=3) > 0)
        number = np.full(len(full.vertices), -1)
        number[kept] = np.arange(len(kept))
        faces = number[full.faces]
        part = Mesh(full.vertices[kept], faces[(faces >= 0).all(axis=1)])
        truth = SurfacePoints.at_vertices(full, kept)
        write_off(part, folder / "data" / "cuts" / f"{name}.off")
        for suffix in (".baryc_gt", ".baryc_gt_sym"):
            write_baryc(folder / "data" / "cuts" / f"{name}{suffix}", truth)
        for rank, label in enumerate(METHODS):
            best = generator.uniform(0.5, 1.0)
            for backend in BACKENDS:
                if len(labels) == count:
                    break
                run = f"{pair:04}{label}{backend}".replace(":", "-")
                shown = generator.random(len(kept)) < (1.0 if rank < 4 else 0.02)
                points = SurfacePoints(np.where(shown, truth.faces, -1), truth.barycentric)
                errors = generator.exponential(0.05, int(shown.sum()))
                write_points(store.points_file(run), replace(matched_points(points), errors=errors))
                store.write_run(_record(run, name, label, backend, best, errors, len(kept), generator))
                labels[run] = label
    store.write_index({"title": "Made up", "dataset": "shrec16", "metric": "dijkstra", "runs": labels})


def _record(
    run: str,
    pair: str,
    label: str,
    backend: str,
    best: float,
    errors: np.ndarray,
    rows: int,
    generator: np.random.Generator,
) -> dict[str, object]:
    value = best * (1 - 10 ** generator.uniform(-9, -1))
    seconds = float(generator.lognormal())
    trace = [[seconds * k / 99, float(k + 1), value * k / 99, 1e-12] for k in range(100)]
    stage = {
        "problem": "game", "problem_hash": pair + label, "variables": 3000, "sense": "maximize", "solver": backend,
        "status": "stationary", "usable": True, "message": "a local optimum to first order", "raw_status": "done",
        "route": [backend], "claim": "exact", "objective": value, "violation": 0.0, "stationarity": 1e-8, "bound": None,
        "certificate": None, "build_seconds": 0.01, "solve_seconds": seconds, "evaluations": 100.0, "versions": {},
        "attempts": [], "trace": trace,
    }  # fmt: skip
    return {
        "id": run, "pair": pair, "split": "cuts", "class_name": "ball", "label": label, "method": label,
        "settings": "", "backend": backend, "starts": 1, "seed": 0, "motion_seed": 0, "metric": "dijkstra",
        "status": "stationary", "message": "game: a local optimum to first order", "problem": "game",
        "problem_hash": pair + label, "sense": "maximize", "solver": backend, "variables": 3000, "objective": value,
        "violation": 0.0, "stationarity": 1e-8, "bound": None, "build_seconds": 0.04, "solve_seconds": 4 * seconds,
        "formulation_seconds": 1.0, "evaluations": 400.0, "mean_error": float(errors.mean()),
        "mean_error_per_point": float(errors.mean()), "side": "direct", "match_count": len(errors),
        "unmatched_count": rows - len(errors), "coverage": 0.9, "kept_area": float(generator.uniform(0.2, 0.9)),
        "curve": [float((errors <= 0.005 * k).mean()) for k in range(51)], "source": "made up",
        "finished": "", "stages": [{**stage, "problem": f"game {k}"} for k in range(4)],
    }  # fmt: skip


if __name__ == "__main__":
    main()
