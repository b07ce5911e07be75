"""Disturb a benchmark in every way that a long one is disturbed, and compare its results with an undisturbed one.

A plan of quick runs, some of which crash, hang or fill their memory on purpose, is killed with SIGKILL at random
moments, loses a worker, and meets a full disk; it is restarted until it is complete. Then the same plan is done by a
Dask scheduler with two workers in processes of their own, one of which is killed on the way. Prints what happened as a
table; exits with 1 where results differ, a finished run was lost or done twice, or a process was left running.

    python benchmarks/chaos.py [--small] [--no-dask] [--json] [--seed 0] [--folder DIR]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chaos_trial import write_trial

MARK = "NONRIGID_CHAOS"  # in the environment of every process that this script starts, by which it finds those left
COMPARED = ("status", "message", "objective", "violation", "stationarity", "match_count", "mean_error", "curve")


@dataclass
class Stage:
    """Hold the folders of a trial, and what was seen."""

    folder: Path
    small: bool
    rng: random.Random
    rows: list[tuple[str, str, bool]] = field(default_factory=list)

    @property
    def plan(self) -> Path:
        """File of the plan."""
        return self.folder / "plan.toml"

    def environment(self, events: str) -> dict[str, str]:
        """Return the environment of a process whose runs note what they do in the file `events`."""
        found = {**os.environ, MARK: str(self.folder), "NONRIGID_CHAOS_EVENTS": str(self.folder / events)}
        found["PYTHONPATH"] = os.pathsep.join(filter(None, [str(self.folder / "site"), os.environ.get("PYTHONPATH")]))
        found["NONRIGID_CACHE"] = str(self.folder / "cache")
        return found | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

    def start(self, out: Path, events: str, *words: str, limit: int | None = None) -> subprocess.Popen[str]:
        """Start `nonrigid bench`; `limit` bounds the size of each file that it writes, in bytes."""
        code = "from nonrigid.benchmark.cli import main; main()"
        command = [sys.executable, "-c", code, "bench", str(self.plan), "--out", str(out), "--quiet", "--json", *words]

        def confine() -> None:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # to write a core may take longer than a run
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        return subprocess.Popen(
            command,
            env=self.environment(events),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=confine,
        )

    def say(self, what: str, seen: str, good: bool = True) -> None:
        """Add a row to the table."""
        self.rows.append((what, seen, good))
        sys.stderr.write(f"{what}: {seen}{'' if good else ' (WRONG)'}\n")


def finished(out: Path) -> dict[str, float]:
    """Return the finished runs, and when each was."""
    return {path.stem: path.stat().st_mtime for path in (out / "runs").glob("[!.]*.json")}


def results(out: Path) -> dict[str, list[object]]:
    """Return what has to be the same in two benchmarks."""
    found = {}
    for run in finished(out):
        record = json.loads((out / "runs" / f"{run}.json").read_text())
        found[run] = [record.get(key) for key in COMPARED]
    return found


def left_running(stage: Stage) -> list[int]:
    """Return the processes of this trial that still run; zombies have no environment."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if (
                int(place.name) != os.getpid()
                and f"{MARK}={stage.folder}\0".encode() in (place / "environ").read_bytes()
            ):
                found.append(int(place.name))
    return found


def wait_gone(stage: Stage, seconds: float = 10.0) -> float | None:
    """Return how long it takes until no process is left; None if that is longer."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        if not left_running(stage):
            return time.monotonic() - begun
        time.sleep(0.05)
    return None


def wait_runs(out: Path, count: int, process: subprocess.Popen[str], seconds: float = 120.0) -> bool:
    """Wait until so many runs are finished; tell whether they are."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and process.poll() is None:
        if len(finished(out)) >= count:
            return True
        time.sleep(0.02)
    return len(finished(out)) >= count


def children(process: int) -> list[int]:
    """Return the child processes of a process."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if int((place / "stat").read_text().rsplit(")", 1)[1].split()[1]) == process:
                found.append(int(place.name))
    return found


def busy_workers(process: subprocess.Popen[str]) -> list[int]:
    """Return the workers of a benchmark that are at a run, waiting for one; none if it ends before."""
    while process.poll() is None:
        if workers := [child for child in children(process.pid) if children(child)]:
            return workers
        time.sleep(0.005)
    return []


@contextlib.contextmanager
def small_disk(stage: Stage) -> Iterator[tuple[Path, bool]]:
    """Offer a folder on a file system of 0.5 MB where this user may mount one, else any folder."""
    out = stage.folder / "disturbed"
    out.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=500k", "tmpfs", str(out)]
    mounted = not stage.small and subprocess.run(words, capture_output=True, check=False).returncode == 0
    try:
        yield out, mounted
    finally:
        if mounted:
            subprocess.run(["umount", str(out)], check=False)


def disturb(stage: Stage, out: Path, mounted: bool, total: int) -> set[str]:
    """Kill, fill and restart until the plan is complete; return the runs that began again though they were finished."""
    kills, worst = (1 if stage.small else 10), 0.0
    seen: dict[str, float] = {}
    twice: set[str] = set()
    worker_killed = disk_full = False
    killed = turn = 0
    while turn < kills + 12:
        turn += 1
        before = finished(out)
        for run, when in before.items():
            if seen.setdefault(run, when) != when:
                twice.add(run)
        if set(seen) - set(before):
            stage.say("finished runs lost", str(len(set(seen) - set(before))), good=False)
        limit = 9000 if not mounted and not disk_full else None
        process = stage.start(out, "events.txt", "--jobs", "2", limit=limit)
        want = min(len(before) + (1 if stage.small else stage.rng.randint(1, 6)), total)
        if not worker_killed and (disk_full or stage.small) and wait_runs(out, want, process):
            workers = busy_workers(process)
            if workers:
                os.kill(stage.rng.choice(workers), signal.SIGKILL)
                worker_killed = True
                time.sleep(0.3)
                stage.say(
                    "worker killed", f"at {len(finished(out))} runs; the benchmark went on", process.poll() is None
                )
                want = min(len(finished(out)) + 2, total)
        if disk_full and killed < kills and wait_runs(out, want, process) and process.poll() is None:
            time.sleep(stage.rng.uniform(0.0, 0.3))
            os.kill(process.pid, signal.SIGKILL)
            killed += 1
        words = process.communicate(timeout=600)[1]
        gone = wait_gone(stage)
        worst = max(worst, 99.0 if gone is None else gone)
        if "results cannot be written" in words:
            disk_full = True
            how = "a file system of 0.5 MB" if mounted else "a limit on the size of files"
            stage.say("disk full", f"{how}, exit code {process.returncode}: {' '.join(words.split())[:150]}")
            if mounted:
                subprocess.run(["mount", "-o", "remount,size=200m", str(out)], check=True)
        elif process.returncode == 0:
            break
        elif process.returncode != -signal.SIGKILL:
            stage.say("unexpected end", f"code {process.returncode}: {words[-300:]}", good=False)
            break
    stage.say("killed with SIGKILL", f"{killed} times, restarts {turn - 1}", killed == kills)
    stage.say("worker killed once", str(worker_killed), worker_killed)
    stage.say("disk full once", str(disk_full), disk_full)
    stage.say("processes left by a killed benchmark", f"none after {worst:.2g} s", worst < 10.0)
    for run, when in finished(out).items():
        if seen.setdefault(run, when) != when:
            twice.add(run)
    return twice


def compare(stage: Stage, name: str, out: Path, truth: dict[str, list[object]], total: int) -> None:
    """Compare results with those of the undisturbed benchmark."""
    found = results(out)
    differing = [run for run in truth if found.get(run) != truth[run]]
    good = not differing and len(found) == len(truth) == total
    seen = f"{len(found)} of {total} runs, {len(differing)} differ from the undisturbed"
    for run in differing:
        mine = found.get(run, [None] * len(COMPARED))
        other = [
            f"{key} {a} for {b}"
            for key, a, b in zip(COMPARED, mine, truth[run], strict=True)
            if a != b and key != "curve"
        ]
        seen += f"; {run}: {', '.join(other)}"
    stage.say(f"results of {name}", seen, good)


def count_statuses(out: Path) -> str:
    """Return how many runs ended with which status."""
    count: dict[str, int] = {}
    for values in results(out).values():
        count[str(values[0])] = count.get(str(values[0]), 0) + 1
    return ", ".join(f"{number} {status}" for status, number in sorted(count.items()))


def repeated(stage: Stage, events: str) -> str:
    """Say how many runs began more than once."""
    begun: dict[str, int] = {}
    path = stage.folder / events
    for line in path.read_text().splitlines() if path.is_file() else []:
        word, kind, number, rows, _ = line.split()
        if word == "begin":
            begun[f"{kind} {number} {rows}"] = begun.get(f"{kind} {number} {rows}", 0) + 1
    again = sum(count - 1 for count in begun.values())
    return f"{sum(begun.values())} beginnings of {len(begun)} runs, {again} of them again after an interruption"


def on_dask(stage: Stage, truth: dict[str, list[object]], total: int) -> None:
    """Do the plan on a scheduler and two workers in processes of their own, and kill one worker on the way."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address, out = f"tcp://127.0.0.1:{port}", stage.folder / "dask"
    dask = [sys.executable, "-m", "dask"]
    quiet: dict[str, Any] = {
        "env": stage.environment("dask.txt"),
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet
    )
    options = ["--nthreads", "1", "--no-dashboard", "--no-nanny", "--local-directory", str(stage.folder / "space")]
    workers = [subprocess.Popen([*dask, "worker", address, *options], **quiet) for _ in range(2)]
    try:
        process = stage.start(out, "dask.txt", "--executor", "dask", "--scheduler", address, "--jobs", "2")
        wait_runs(out, total // 3, process)
        workers[0].kill()
        stage.say("Dask worker killed", f"at {len(finished(out))} runs of {total}", process.poll() is None)
        words = process.communicate(timeout=600)[1]
        stage.say("Dask benchmark ended", f"code {process.returncode} {words[-200:]}", process.returncode == 0)
        compare(stage, "Dask, two workers, one lost", out, truth, total)
        stage.say("Dask beginnings", repeated(stage, "dask.txt"))
    finally:
        for one in (*workers, scheduler):
            one.kill()
            one.wait()
    gone = wait_gone(stage)
    stage.say("processes left by Dask", "none" if gone is not None else str(left_running(stage)), gone is not None)


def main() -> int:
    """Run the trial and print its table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--small", action="store_true")
    parser.add_argument("--no-dask", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp(prefix="nonrigid-chaos-"))
    folder.mkdir(parents=True, exist_ok=True)
    stage = Stage(folder.resolve(), options.small, random.Random(options.seed))
    begun = time.monotonic()
    try:
        total = write_trial(stage.folder, stage.rng, small=stage.small)
        calm = stage.folder / "undisturbed"
        process = stage.start(calm, "calm.txt", "--jobs", "2")
        words = process.communicate(timeout=600)[1]
        stage.say("undisturbed", f"{len(finished(calm))} runs: {count_statuses(calm)} {words[-300:]}", not words)
        truth = results(calm)
        with small_disk(stage) as (out, mounted):
            twice = disturb(stage, out, mounted, total)
            compare(stage, "the disturbed benchmark", out, truth, total)
            stage.say("beginnings", repeated(stage, "events.txt"))
            stage.say("finished runs done twice", str(len(twice)), not twice)
        if not options.no_dask:
            on_dask(stage, truth, total)
    finally:
        for process_id in left_running(stage):
            os.kill(process_id, signal.SIGKILL)
        if options.folder is None:
            shutil.rmtree(folder, ignore_errors=True)
    good = all(row[2] for row in stage.rows)
    lines = [f"| {what} | {seen} | {'ok' if fine else 'WRONG'} |" for what, seen, fine in stage.rows]
    table = "\n".join(["| event | seen | |", "| --- | --- | --- |", *lines, f"\n{time.monotonic() - begun:.0f} s"])
    sys.stdout.write((json.dumps({"good": good, "rows": stage.rows}) if options.json else table) + "\n")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
