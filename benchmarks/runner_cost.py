"""What the runner itself costs a run, and what a second worker gains.

Usage: python benchmarks/runner_cost.py [--runs 60] [--seconds 0.5] [--repeats 7]

The method does next to nothing, then sleeps. The cost of the runner is the time of a run beyond the same match and
score called directly in this process (the peer); expect at most 20 ms on an idle machine. Direct calls and the runner
take turns, since machines change their speed: each cost is a difference of neighbours. The processor time of both is
printed too, which a busy machine disturbs less. Throughput is measured with runs that sleep, so that it shows the
runner's share and not the number of cores.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
from pathlib import Path

import chaos
import numpy as np
from chaos_trial import PLAN, write_trial

from nonrigid.geometry.arrays import FloatArray


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        stage = chaos.Stage(Path(folder), True, random.Random(0))
        write_trial(stage.folder, stage.rng, small=True)
        environment = stage.environment("events.txt")
        os.environ.update(environment)
        sys.path.insert(0, str(stage.folder / "site"))
        measure(stage, options.runs, options.seconds, options.repeats)


def measure(stage: chaos.Stage, count: int, seconds: float, repeats: int) -> None:
    """Time direct calls, one worker and two workers."""
    from nonrigid.benchmark.executors import make_executor
    from nonrigid.benchmark.plan import read_plan
    from nonrigid.benchmark.protocol import random_rigid_motion, score
    from nonrigid.benchmark.runner import run_plan
    from nonrigid.formulations.formulation import Pair
    from nonrigid.solvers.match import match

    def plan(pause: float) -> Path:
        text = PLAN.format(run_seconds=60, splits='["cuts"]')
        for number in range(count):
            text += f'[[methods]]\nmethod = "trial"\nlabel = "t{number}"\n'
            text += f"settings = {{ number = {number}, seconds = {pause} }}\n"
        place: Path = stage.plan
        place.write_text(text)
        return place

    idle = read_plan(plan(0.0))
    data = idle.pairs()[0].load()
    pair = Pair.of(random_rigid_motion(data.part, 0)[0], data.full)
    turns = []
    for turn in range(repeats):
        times, worked = [], spent()
        for entry in idle.methods:
            begun = time.perf_counter()
            found = match(pair, entry.formulation, "native", limits=idle.limits)
            assert found.correspondence is not None
            score(data, found.correspondence.dense(len(data.part.vertices)))
            times.append(time.perf_counter() - begun)
        work, worked = spent() - worked, spent()
        out = stage.folder / f"idle{turn}"
        # As a user starts it: this process holds more than the command does, and is slower to fork.
        if stage.start(out, "events.txt").wait():
            raise SystemExit("the benchmark failed")
        ended = np.sort([path.stat().st_mtime for path in (out / "runs").glob("*.json")])
        turns.append((np.median(times), np.median(np.diff(ended)), (spent() - worked - work) / count))
    direct, each, work = 1e3 * np.array(turns).T
    lines = [f"{'direct match and score':34s} {spread(direct)} ms a run"]
    lines += [f"{'run_plan, from record to record':34s} {spread(each)} ms a run"]
    lines += [f"{'cost of the runner':34s} {spread(each - direct)} ms a run, ratio {np.median(each / direct):.2f}"]
    lines += [f"{'the same in processor time':34s} {spread(work)} ms a run, start-up included"]
    rates = []
    slow = read_plan(plan(seconds))
    for workers in (1, 2):
        out = stage.folder / f"out{workers}"
        run_plan(slow, out, executor=make_executor("joblib", workers=workers), quiet=True)
        ended = np.sort([path.stat().st_mtime for path in (out / "runs").glob("*.json")])
        rates.append((len(ended) - 1) / (ended[-1] - ended[0]))
        lines += [f"{f'throughput, {workers} worker(s)':34s} {rates[-1]:8.2f} runs a second"]
    lines += [f"{'ratio of two workers to one':34s} {rates[1] / rates[0]:8.2f}"]
    sys.stdout.write("\n".join(lines) + "\n")


def spread(values: FloatArray) -> str:
    """Return the median of some values and, in brackets, the least and the largest."""
    return f"{np.median(values):8.1f} ({values.min():.1f} to {values.max():.1f})"


def spent() -> float:
    """Return the processor time, in seconds, of this process and its ended children."""
    return sum(os.times()[:4])


if __name__ == "__main__":
    main()
