"""Solvers of the game-theoretic matching problem against the replicator dynamics: time and memory against size.

Usage: python benchmarks/game_solvers.py [--sizes 500 1000 2000 4000] [--payoff FILE.npz ...] [--seconds 20]
       [--solvers native:replicator ...] [--figure out.png]

The replicator runs first, to a stationarity of 1e-6 or to the time limit; the stationarity it reached is the target of
all others: "to target" is the time at which an iterate first had it. Every run is a process of its own with one BLAS
thread. A payoff file holds one square matrix, and stands for its own size; other sizes use synthetic payoffs, planted
in noisy distances. Expect the best native dynamic to need at most a tenth of the replicator's time at 2000 strategies.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.backend import make_backend, resolved
from nonrigid.solvers.judge import judge
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.once import solve_once
from nonrigid.solvers.solution import TracePoint

REPLICATOR = "native:replicator"
SOLVERS = (
    "native:infection_immunisation",
    "native:pairwise_frank_wolfe",
    "native:projected_gradient",
    "casadi:ipopt",
    "nlopt:LD_CCSAQ",
    "scipy:L-BFGS-B",
    "scipy:SLSQP",
    "scipy:trust-constr",
    "cvxpy:CLARABEL",
    "cvxpy:nlp-IPOPT",
    "cvxpy:nlp-UNO",
    "sifted:casadi:ipopt",
    "sifted:nlopt:LD_CCSAQ",
    "sifted:cvxpy:CLARABEL",
)
TARGET = 1e-6
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
Row = dict[str, Any]


def main() -> None:
    """Run all solvers at all sizes and write the table, the two ratios, and the figure if asked for."""
    options = _options()
    if options.child:
        sys.stdout.write(json.dumps(_measured(options.child[0], options.child[1], options.seconds, options.tolerance)))
        return
    given = {len(matrix): path for path in options.payoff for matrix in [_payoff(path)]}
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for n in sorted({*options.sizes, *given} if options.sizes else given):
            path = given.get(n)
            if path is None:
                path = Path(folder) / f"{n}.npz"
                np.savez(path, payoff=planted_payoff(n))
            rows += _table(n, path, options, real=n in given)
    if options.figure is not None:
        _draw(rows, options.figure)


def planted_payoff(n: int, seed: int = 0, candidates: int = 10) -> FloatArray:
    """Return exp(-200 eps^2) for a partial matching in the plane: ten candidates a point, right for 60 % of points."""
    rng = np.random.default_rng(seed)
    m = n // candidates
    source = rng.random((m, 2))
    target = source + 0.03 * rng.standard_normal((m, 2))
    left = np.repeat(np.arange(m), candidates)
    right = rng.integers(0, m, len(left))
    matched = np.flatnonzero(rng.random(m) < 0.6)
    right[matched * candidates] = matched

    def lengths(points: FloatArray, which: Any) -> FloatArray:
        between = np.linalg.norm(points[:, None] - points[None], axis=2)
        return np.asarray(between[np.ix_(which, which)])

    payoff = np.exp(-200.0 * (lengths(source, left) - lengths(target, right)) ** 2)
    payoff[(left[:, None] == left) | (right[:, None] == right)] = 0.0
    return np.asarray(0.5 * (payoff + payoff.T))


def _table(n: int, path: Path, options: argparse.Namespace, *, real: bool) -> list[Row]:
    write = sys.stdout.write
    write(
        f"\n{n} strategies, {'payoff of ' + path.name if real else 'synthetic payoff'}, limit {options.seconds:g} s\n"
    )
    write(f"{'solver':<32}{'build s':>9}{'solve s':>9}{'to target':>11}{'stationarity':>14}{'objective':>14}")
    write(f"{'peak MB':>9}{'evals':>9}  status\n")
    rows, target = [], TARGET
    for spec in (REPLICATOR, *options.solvers):
        row = _child(spec, path, options.seconds, target)
        if spec == REPLICATOR and "stationarity" in row:
            target = max(row["stationarity"], TARGET)
        if "stationarity" not in row:
            write(f"{spec:<32}{'left out: ' + row['reason']}\n")
            continue
        row |= {"n": n, "spec": spec, "reached": row["stationarity"] <= 1.0001 * target}
        row["time"] = row["solve"] if row["first"] is None else row["first"]
        write(f"{spec:<32}{row['build']:9.3f}{row['solve']:9.3f}")
        write(f"{row['time']:11.3f}" if row["reached"] else f"{'never':>11}")
        write(f"{row['stationarity']:14.1e}{row['objective']:14.9f}{row['peak']:9.0f}{row['evaluations']:9.1f}")
        write(f"  {row['status']}\n")
        rows.append(row)
    _ratios(rows)
    return rows


def _ratios(rows: list[Row]) -> None:
    write = sys.stdout.write
    times = {row["spec"]: row["time"] for row in rows if row["reached"]}
    natives = {spec: time for spec, time in times.items() if spec.startswith("native:") and spec != REPLICATOR}
    if not natives or REPLICATOR not in times:
        return
    best = min(natives, key=lambda spec: natives[spec])
    write(f"best native ({best}) / replicator: {natives[best] / times[REPLICATOR]:.4f}\n")
    for ipopt in ("casadi:ipopt", "sifted:casadi:ipopt"):
        if ipopt in times:
            write(f"{ipopt} / best native: {times[ipopt] / natives[best]:.2f}\n")


def _child(spec: str, path: Path, seconds: float, tolerance: float) -> Row:
    command = [sys.executable, __file__, "--child", spec, str(path), "--seconds", str(seconds)]
    command += ["--tolerance", repr(tolerance)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=4 * seconds + 60, env=os.environ | ONE_THREAD
        )
    except subprocess.TimeoutExpired:
        return {"reason": f"killed after {4 * seconds + 60:g} s"}
    if done.returncode != 0:
        return {"reason": (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1][:150]}
    row: Row = json.loads(done.stdout.splitlines()[-1])
    return row


def _measured(spec: str, path: str, seconds: float, tolerance: float) -> Row:
    matrix = _payoff(Path(path))
    u = Variable("u", len(matrix))
    problem = Problem("game-theoretic", maximize(QuadraticForm(matrix)(u)), u @ Simplex())
    _forget_peak()
    first: list[float] = []

    def watch(point: FloatArray, trace: TracePoint) -> None:
        if not first and judge(problem, {"u": point}).stationarity <= tolerance:
            first.append(trace.seconds)

    backend = resolved(make_backend(spec), problem)
    start = {"u": Simplex().center((len(matrix),))}
    limits = Limits(seconds=seconds, tolerance=tolerance)
    answer = solve_once(problem, backend, start, limits, None if spec == REPLICATOR else watch)
    if not answer.values:
        return {"reason": f"{answer.status.value}: {answer.message} {answer.raw_status}"}
    return {
        "build": answer.build_seconds,
        "solve": answer.solve_seconds,
        "first": first[0] if first else None,
        "stationarity": answer.stationarity,
        "objective": answer.objective,
        "evaluations": answer.evaluations,
        "status": answer.status.value,
        "peak": _peak_megabytes(),
    }


def _payoff(path: Path) -> FloatArray:
    with np.load(path) as file:
        return np.asarray(file["payoff" if "payoff" in file.files else file.files[0]], dtype=float)


def _forget_peak() -> None:
    """Start the peak anew, so that building the problem does not count, where the system can (Linux)."""
    switch = Path("/proc/self/clear_refs")
    if switch.exists():
        switch.write_text("5")


def _peak_megabytes() -> float:
    status = Path("/proc/self/status")
    if status.exists():
        fields = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        return int(fields["VmHWM"].split()[0]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 if sys.platform == "linux" else 1024) / 1024


def _draw(rows: list[Row], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 5))
    for axis, key, label in ((axes[0], "time", "time to the target in s"), (axes[1], "peak", "peak memory in MB")):
        for spec in dict.fromkeys(row["spec"] for row in rows):
            mine = [row for row in rows if row["spec"] == spec]
            style = "--" if spec.startswith("sifted") else "-"
            (line,) = axis.loglog([row["n"] for row in mine], [row[key] for row in mine], style, label=spec)
            for row in mine:
                filled = line.get_color() if row["reached"] else "none"
                axis.loglog(row["n"], row[key], "o", color=line.get_color(), markerfacecolor=filled)
        axis.set_xlabel("strategies n")
        axis.set_ylabel(label)
        axis.grid(visible=True, which="both", alpha=0.3)
    axes[1].legend(fontsize=7)
    figure.suptitle("Game-theoretic matching; hollow: the replicator's final stationarity was not reached")
    figure.tight_layout()
    figure.savefig(path, dpi=150)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Game solvers against the replicator: time and memory against size.")
    parser.add_argument("--sizes", type=int, nargs="*", default=[500, 1000, 2000, 4000])
    parser.add_argument("--payoff", type=Path, nargs="*", default=[])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--solvers", nargs="*", default=list(SOLVERS))
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--tolerance", type=float, default=TARGET, help=argparse.SUPPRESS)
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    main()
