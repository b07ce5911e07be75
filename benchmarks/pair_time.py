"""How long a pair takes by anchored matching: from nothing, and with the template at hand; stage by stage.

Usage: python benchmarks/pair_time.py ROOT [--out pair_time.jsonl] [--names NAME ...]

ROOT holds the folders null, cuts and holes of SHREC'16. Every part is matched twice, each time in a process of its own
with one BLAS thread, after a random rigid motion: with an empty cache (from nothing), and with a cache in which another
part of the same class was matched before (template at hand; the part's geometry is computed anew). That other part is
the one before it in the list, the last for the first.

Seconds are CPU seconds of the process from the meshes in memory to the correspondence, first use of lazily imported
modules included; gigabytes are the most memory the process held. A stage's seconds are those spent in it and in none of
the stages it calls; reading and writing the cache counts to the stage that asked. Rows go to the file one by one, and
those found there are not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from threadpoolctl import threadpool_limits

import nonrigid.formulations.anchored as anchored
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.benchmark.report.export import as_markdown
from nonrigid.formulations.formulation import Pair, Stages
from nonrigid.formulations.judged_maps import Ground
from nonrigid.formulations.sampled_distances import SampledDistances
from nonrigid.formulations.spectral_growth import Bases
from nonrigid.geometry.cache import Cache
from nonrigid.geometry.surface import Surface
from nonrigid.solvers.confine import peak_memory
from nonrigid.solvers.match import match

NOTHING, TEMPLATE = "nothing", "template"
"""What is at hand before a pair is matched."""

CALLS: tuple[tuple[str, Any, tuple[str, ...]], ...] = (
    ("eigenpairs", Surface, ("spectrum",)),
    ("descriptors", Surface, ("shot",)),
    ("farthest samples", Surface, ("samples",)),
    ("distances", Surface, ("distances", "distances_between")),
    ("games stated", SampledDistances, ("payoff",)),
    ("samples placed", SampledDistances, ("placed", "placed_by")),
    ("maps judged", Ground, ("judged",)),
    ("images read off", Bases, ("images", "read_off")),
    ("images moved together", anchored, ("moved_together",)),
)
"""Each stage that is a call, where it is looked up, and its names there."""

PROBLEMS = {"game": "games solved", "map": "maps fitted"}
"""Each stage that is the solution of a problem, by the name of the problem."""

STAGES = (*(stage for stage, _, _ in CALLS), *PROBLEMS.values(), "the rest")
Row = dict[str, Any]


class Clock:
    """Add up the CPU seconds of stages; those of a stage inside another count to the inner one."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)
        self._running = ["the rest"]
        self._since = time.process_time()

    def _turn(self) -> None:
        """Book the time since the last turn to the stage that is running."""
        now = time.process_time()
        self.seconds[self._running[-1]] += now - self._since
        self._since = now

    @contextmanager
    def running(self, stage: str) -> Iterator[None]:
        """Count what happens inside to a stage."""
        self._turn()
        self._running.append(stage)
        try:
            yield
        finally:
            self._turn()
            self._running.pop()

    def watch(self) -> None:
        """Count the calls of `CALLS` to their stages, in this process from now on."""
        for stage, owner, names in CALLS:
            for name in names:
                setattr(owner, name, self._watched(stage, getattr(owner, name)))

    def _watched(self, stage: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*given: Any, **named: Any) -> Any:
            with self.running(stage):
                return call(*given, **named)

        return watched


class Clocked:
    """State the problems of anchored matching as it does, and count the time until each is solved."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock

    def stages(self, pair: Pair) -> Stages:
        """State the problems one by one."""
        stages = anchored.Anchored().stages(pair)
        problem = next(stages)
        while True:
            with self.clock.running(PROBLEMS[problem.name]):
                solution = yield problem
            try:
                problem = stages.send(solution)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]


def run(spec: PairSpec, cache: Path) -> Row:
    """Match one pair, everything derived from its meshes kept in a folder, and say what it took."""
    data = spec.load()
    part = random_rigid_motion(data.part)[0]
    clock = Clock()
    clock.watch()
    with threadpool_limits(1):
        begun = time.process_time()
        with clock.running("the rest"):
            found = match(Pair.of(part, data.full, cache=Cache(cache)), Clocked(clock))
        seconds = time.process_time() - begun
        memory = peak_memory()
        if found.correspondence is None:
            raise RuntimeError(f"{spec.name}: {found.message}")
        error = 100.0 * score(data, found.correspondence.dense(len(part.vertices))).mean_error
    return {
        "pair": spec.name,
        "seconds": round(seconds, 3),
        "gigabytes": memory,
        "problems": len(found.solutions),
        "error": round(error, 4),
        "stages": {stage: round(of, 3) for stage, of in clock.seconds.items()},
    }


def apart(spec: PairSpec, cache: Path) -> Row:
    """Match one pair in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        return executor.submit(run, spec, cache).result()


def following(specs: dict[str, PairSpec], name: str) -> str:
    """Return the part after one in the list of its class, the first for the last."""
    alike = [other for other, spec in specs.items() if spec.class_name == specs[name].class_name]
    return alike[(alike.index(name) + 1) % len(alike)]


def missing(specs: dict[str, PairSpec], names: list[str], known: set[tuple[str, str]]) -> Iterator[Row]:
    """Run what is not known yet: every name from nothing, and in the cache of the part before it."""
    for first in specs:
        second = following(specs, first)
        alone, after = (first, NOTHING), (second, TEMPLATE)
        after_wanted = second != first and second in names and after not in known
        if after_wanted or (first in names and alone not in known):
            with TemporaryDirectory() as folder:
                row = apart(specs[first], Path(folder)) | {"at hand": NOTHING}
                if alone not in known:
                    yield row
                if after_wanted:
                    yield apart(specs[second], Path(folder)) | {"at hand": TEMPLATE}


def totals(rows: list[Row]) -> str:
    """Return seconds, gigabytes and errors, a line for what is at hand and a split."""
    found = []
    for at_hand in (NOTHING, TEMPLATE):
        for split in ("cuts", "holes", ""):
            mine = [row for row in rows if row["at hand"] == at_hand and row["pair"].startswith(split)]
            if mine:
                seconds = sorted(row["seconds"] for row in mine)
                found.append(
                    {
                        "at hand": at_hand,
                        "parts": split or "all",
                        "n": len(mine),
                        "s, median": f"{median(seconds):.1f}",
                        "least": f"{seconds[0]:.1f}",
                        "9th decile": f"{seconds[int(0.9 * len(seconds))]:.1f}",
                        "largest": f"{seconds[-1]:.1f}",
                        "GB, largest": f"{max(row['gigabytes'] for row in mine):.2f}",
                        "mean error": f"{sum(row['error'] for row in mine) / len(mine):.2f}",
                    }
                )
    return as_markdown(found, {key: key for key in found[0]})


def by_stage(rows: list[Row]) -> str:
    """Return the mean and the median of the seconds of each stage, a line a stage."""
    found = []
    for stage in STAGES:
        line: Row = {"stage": stage}
        for at_hand in (NOTHING, TEMPLATE):
            mine = [row["stages"][stage] for row in rows if row["at hand"] == at_hand]
            if mine:
                line |= {
                    f"{at_hand}: mean": f"{sum(mine) / len(mine):.2f}",
                    f"{at_hand}: median": f"{median(mine):.2f}",
                }
        found.append(line)
    return as_markdown(found, {key: key for key in found[0]})


def main() -> None:
    """Run what the file does not hold yet, then write both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--out", type=Path, default=Path("pair_time.jsonl"))
    parser.add_argument("--names", nargs="+")
    given = parser.parse_args()
    specs = {spec.name: spec for spec in Shrec16(root=given.root).pairs()}
    names = given.names or list(specs)
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    with given.out.open("a") as file:
        for row in missing(specs, names, {(row["pair"], row["at hand"]) for row in rows}):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    chosen = [row for row in rows if row["pair"] in names]
    sys.stdout.write(totals(chosen) + "\n" + by_stage(chosen))


if __name__ == "__main__":
    main()
