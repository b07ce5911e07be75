"""Do one run of a benchmark: match one pair by one method and backend, and score the answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from time import perf_counter

import joblib
import numpy as np

from nonrigid.benchmark.accuracy import accuracy_of, is_accepted
from nonrigid.benchmark.choices import backend_words, guarded, parse_backend
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.environment import known_environment, source_digest
from nonrigid.benchmark.formats import write_corr
from nonrigid.benchmark.matched_points import matched_points, write_points
from nonrigid.benchmark.protocol import Score, covered, score
from nonrigid.benchmark.store import Record, StorageError, Store
from nonrigid.formulations.formulation import Formulation, Pair, Stages
from nonrigid.formulations.model import Problem
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import NonrigidError
from nonrigid.geometry.points import SurfacePoints
from nonrigid.solvers.backend import backend_class
from nonrigid.solvers.confine import is_out_of_memory, peak_memory
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match
from nonrigid.solvers.solution import Solution
from nonrigid.solvers.status import Status

TRACE_POINTS = 100
"""Points of a solver's trace that are kept, evenly chosen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """Hold one row of a plan: everything that a run depends on but the pair's meshes.

    `limits` bound each solve, `run_seconds` the whole run, which is killed then; None for no bound.
    """

    pair: str
    split: str
    class_name: str
    label: str
    method: str
    formulation: Formulation
    backend: str
    starts: int
    seed: int
    motion_seed: int | None
    metric: str
    limits: Limits
    data_hash: str
    run_seconds: float | None = None

    @property
    def id(self) -> str:
        """Hash of the row, the meshes and the versions; the label does not count."""
        return content_hash(
            *_versions(self.backend),
            self.pair,
            repr(self.formulation),
            self.backend,
            self.starts,
            self.seed,
            self.motion_seed,
            self.metric,
            repr(self.limits),
            self.run_seconds,
            self.data_hash,
        )[:20]


@cache
def _versions(backend: str) -> tuple[str, ...]:
    names = sorted({word.partition(":")[0] for word in backend_words(parse_backend(backend))})
    return version("nonrigid"), *(f"{name} {sorted(backend_class(name).versions().items())}" for name in names)


def do_run(run: Run, data: PairData, pair: Pair, store: Store) -> Record:
    """Match, score, and write correspondence and record. What a method or backend raises becomes the row's message.

    `pair` holds the moved part; scores are taken on `data`, where the ground truth is.
    """
    choice = parse_backend(run.backend)
    observed = Observed(run.formulation)
    record = _head(run)
    begun = perf_counter()
    try:
        found = match(pair, observed, choice, starts=run.starts, seed=run.seed, limits=guarded(run.limits, choice))
        record |= {
            "status": found.status.value,
            "message": found.message,
            "build_seconds": found.build_seconds,
            "solve_seconds": found.solve_seconds,
            "formulation_seconds": found.formulation_seconds,
            "evaluations": float(sum(solution.evaluations for solution in found.solutions)),
            "stages": [_stage(*both) for both in zip(found.solutions, observed.seen, strict=True)],
        }
        solved = found.correspondence is not None
        record["accepted"] = solved and all(is_accepted(solution, run.limits) for solution in found.solutions)
        if found.solutions:
            first: Mapping[str, object] = record["stages"][0]
            names = ("problem", "problem_hash", "sense", "solver", "variables")
            record |= {name: first[name] for name in (*names, "objective", "violation", "stationarity", "bound")}
        if found.correspondence is not None:
            points = found.correspondence.dense(len(data.part.vertices))
            scored = None if data.truth is None else score(data, points, geodesics=run.metric)
            record |= _counted(data, points) if scored is None else _scored(scored)
            with store.writing():
                write_corr(store.match_file(run.id), points)
                write_points(store.points_file(run.id), matched_points(points, scored, found.solutions))
    except StorageError:
        raise
    except Exception as failure:
        # A method or library of a third party may raise anything; the row says so, and the benchmark goes on.
        record |= _failed(failure, run.limits)
    record |= {"total_seconds": perf_counter() - begun, "peak_memory": peak_memory()}
    return _write(record, store)


def write_failure(run: Run, failure: Exception, store: Store) -> Record:
    """Write the record of a run that could not even start."""
    return _write(_head(run) | _failed(failure, run.limits), store)


def write_loss(run: Run, status: str, message: str, store: Store) -> Record:
    """Write the record of a run whose process was lost: killed at its limit, or ended by a crash."""
    return _write(_head(run) | {"status": status, "message": message}, store)


def memory_words(words: str, limits: Limits) -> str:
    """Return the message of a run that filled its memory, given what was said then."""
    return f"{limits.memory_gb:g} GB of memory are spent ({' '.join(words.split())})"


@dataclass
class Observed:
    """Stand for a formulation, and note the size and the hash of every problem that it states."""

    formulation: Formulation
    seen: list[tuple[int, str | None]] = field(default_factory=list)

    def stages(self, pair: Pair) -> Stages:
        """State the formulation's problems, unchanged."""
        stages = self.formulation.stages(pair)
        try:
            problem = next(stages)
            while True:
                self.seen.append((sum(variable.size for variable in problem.variables), problem_hash(problem)))
                solution = yield problem
                problem = stages.send(solution)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]


def problem_hash(problem: Problem) -> str | None:
    """Return a hash of a problem's data; None where a term holds something that has no stable content, as a lambda."""
    try:
        digest = joblib.hash((problem.objective, problem.memberships, dict(problem.constraints)), hash_name="sha1")
    except Exception:  # whatever pickling a third party's term raises
        return None
    return str(digest)


def _failed(failure: Exception, limits: Limits) -> Record:
    words = str(failure) if isinstance(failure, NonrigidError) else f"{type(failure).__name__}: {failure}"
    if limits.memory_gb is not None and is_out_of_memory(words):
        return {"status": Status.LIMIT.value, "message": memory_words(words, limits)}
    return {"status": "error", "message": " ".join(words.split())}


def _write(record: Record, store: Store) -> Record:
    record["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
    store.write_run(record)
    return record


def _head(run: Run) -> Record:
    return {
        "id": run.id,
        "pair": run.pair,
        "split": run.split,
        "class_name": run.class_name,
        "label": run.label,
        "method": run.method,
        "settings": repr(run.formulation),
        "backend": run.backend,
        "starts": run.starts,
        "seed": run.seed,
        "motion_seed": run.motion_seed,
        "metric": run.metric,
        "limits": repr(run.limits),
        "source": source_digest(),
        "accuracy": accuracy_of(run.limits),
        "accepted": False,
        "total_seconds": None,
        "peak_memory": None,
        "environment": known_environment()[0],
        "stages": [],
    }


def _stage(solution: Solution, seen: tuple[int, str | None]) -> Record:
    variables, digest = seen
    step = max(1, -(-len(solution.trace) // TRACE_POINTS))
    return {
        "problem": solution.problem,
        "problem_hash": digest,
        "variables": variables,
        "sense": solution.sense.value,
        "solver": solution.spec,
        "status": solution.status.value,
        "usable": solution.usable,
        "message": solution.message,
        "raw_status": solution.raw_status,
        "route": list(solution.route),
        "claim": solution.claim,
        "objective": solution.objective,
        "violation": solution.violation,
        "stationarity": solution.stationarity,
        "bound": None if solution.bound is None else solution.bound.value,
        "certificate": solution.certificate,
        "build_seconds": solution.build_seconds,
        "solve_seconds": solution.solve_seconds,
        "evaluations": solution.evaluations,
        "versions": dict(solution.versions),
        "attempts": [{**vars(attempt), "status": attempt.status.value} for attempt in solution.attempts],
        "trace": [[p.seconds, p.evaluations, p.objective, p.violation] for p in solution.trace[::step]],
    }


def _counted(data: PairData, points: SurfacePoints) -> Record:
    """Return what is known of a correspondence without ground truth."""
    count = int(points.matched.sum())
    return {
        "match_count": count,
        "unmatched_count": len(points) - count,
        "coverage": covered(data, points),
        "kept_area": data.kept_area,
    }


def _scored(result: Score) -> Record:
    return {
        "mean_error": result.mean_error,
        "mean_error_per_point": result.mean_error_per_point,
        "side": result.side,
        "match_count": result.match_count,
        "unmatched_count": result.unmatched_count,
        "coverage": result.coverage,
        "kept_area": result.kept_area,
        "curve": np.asarray(result.curve).tolist(),
    }
