"""Keep the runs of a benchmark in a folder: one file a run, written whole or not at all, and one table of all."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.terminal import json_text
from nonrigid.geometry.errors import InputError

SCHEMA_VERSION = 1
Record = dict[str, Any]

_TEXT, _REAL, _WHOLE = pa.string(), pa.float64(), pa.int64()
COLUMNS: Mapping[str, pa.DataType] = {
    **dict.fromkeys(("id", "pair", "split", "class_name", "label", "method", "settings", "backend"), _TEXT),
    **dict.fromkeys(("starts", "seed", "motion_seed"), _WHOLE),
    **dict.fromkeys(("metric", "status", "message", "solver", "problem", "problem_hash", "sense"), _TEXT),
    "variables": _WHOLE,
    **dict.fromkeys(("objective", "gap", "violation", "stationarity", "bound"), _REAL),
    **dict.fromkeys(("build_seconds", "solve_seconds", "formulation_seconds", "evaluations"), _REAL),
    **dict.fromkeys(("mean_error", "mean_error_per_point", "coverage", "kept_area"), _REAL),
    "side": _TEXT,
    **dict.fromkeys(("match_count", "unmatched_count"), _WHOLE),
    "curve": pa.list_(pa.float64()),
    **dict.fromkeys(("stages", "source", "finished"), _TEXT),
}
"""Columns of runs.parquet. Errors are fractions of sqrt(full area); objective and gap are the first problem's."""


class Store:
    """Read and write the results of one plan in a folder.

    Parameters
    ----------
    folder
        Holds `plan.toml`, `environment.json`, `index.json` (what the plan asks for), `runs/<id>.json`,
        `matches/<id>.corr`, `matches/<id>.npz` and, once complete, `runs.parquet`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs = folder / "runs"
        self.matches = folder / "matches"

    def prepare(self) -> None:
        """Make the folders; raise `InputError` where a file stands in the way."""
        for place in (self.runs, self.matches):
            try:
                place.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(
                    f"cannot be made a folder ({error})", file=place, remedy="name another --out"
                ) from None

    def match_file(self, run: str) -> Path:
        """Return where the correspondence of a run is kept."""
        return self.matches / f"{run}.corr"

    def points_file(self, run: str) -> Path:
        """Return where a run's matches are kept with their errors; see `nonrigid.benchmark.matched_points`."""
        return self.matches / f"{run}.npz"

    def has(self, run: str) -> bool:
        """Tell whether a run is finished."""
        return (self.runs / f"{run}.json").is_file()

    def finished(self, wanted: Iterable[str]) -> set[str]:
        """Return which of these runs are finished."""
        return {run for run in wanted if self.has(run)}

    def write_run(self, record: Record) -> None:
        """Write one run."""
        write_text(self.runs / f"{record['id']}.json", json_text({"schema": SCHEMA_VERSION, **record}) + "\n")

    def write_index(self, index: Record) -> None:
        """Write what the plan asks for."""
        write_text(self.folder / "index.json", json_text({"schema": SCHEMA_VERSION, **index}) + "\n")

    def index(self) -> Record:
        """Return what the plan asks for; raise `InputError` where there are no results."""
        path = self.folder / "index.json"
        if not path.is_file():
            raise InputError(
                "holds no results", file=self.folder, remedy="run `nonrigid bench PLAN --out` with it first"
            )
        found = _read(path)
        if found.get("schema") != SCHEMA_VERSION:
            raise InputError(
                f"schema {found.get('schema')}, but this version reads {SCHEMA_VERSION}",
                file=path,
                remedy="use the version of nonrigid that wrote it",
            )
        return found

    def records(self) -> list[Record]:
        """Return the finished runs of the plan, in its order, with the gap of each to the best known objective."""
        labels: dict[str, str] = self.index()["runs"]
        found = [{**_read(self.runs / f"{run}.json"), "label": label} for run, label in labels.items() if self.has(run)]
        return with_gaps(found)

    def write_table(self, records: list[Record]) -> Path:
        """Write runs.parquet, whole or not at all, and return its path."""
        rows = [{**record, "stages": json.dumps(record.get("stages", []))} for record in records]
        columns = {
            name: pa.array([row.get(name) for row in rows], type=kind, from_pandas=True)
            for name, kind in COLUMNS.items()
        }
        table = pa.table(columns).replace_schema_metadata({"nonrigid_schema": str(SCHEMA_VERSION)})
        path = self.folder / "runs.parquet"
        handle, temporary = tempfile.mkstemp(dir=self.folder, suffix=".part")
        os.close(handle)
        try:
            pq.write_table(table, temporary)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        return path


def with_gaps(records: list[Record]) -> list[Record]:
    """Add to each run and stage the relative gap to the best objective known for the same problem.

    gap = |best - objective| / max(|best|, 1e-12). A later problem of a method depends on the answers to earlier ones;
    hence objectives are compared between problems of equal data only, told by their hash. None where a stage has no
    usable point or its problem no hash.

    Examples
    --------
    >>> def run(value):
    ...     stage = {"problem_hash": "a", "sense": "maximize", "usable": True, "objective": value}
    ...     return {"stages": [stage]}
    >>> [run["gap"] for run in with_gaps([run(0.5), run(0.4)])]
    [0.0, 0.2]
    """
    best: dict[str, float] = {}
    for stage in (stage for record in records for stage in record["stages"] if _comparable(stage)):
        better = max if stage["sense"] == "maximize" else min
        key = stage["problem_hash"]
        best[key] = better(best.get(key, stage["objective"]), stage["objective"])
    finished = []
    for record in records:
        stages = [{**stage, "gap": _gap(stage, best)} for stage in record["stages"]]
        finished.append({**record, "stages": stages, "gap": stages[0]["gap"] if stages else None})
    return finished


def _gap(stage: Record, best: Mapping[str, float]) -> float | None:
    if not _comparable(stage):
        return None
    top = best[stage["problem_hash"]]
    relative: float = round(abs(top - stage["objective"]) / max(abs(top), 1e-12), 12)
    return relative


def _comparable(stage: Record) -> bool:
    objective = stage.get("objective")
    return bool(stage["problem_hash"] and stage["usable"] and objective is not None and math.isfinite(objective))


def _read(path: Path) -> Record:
    try:
        found: Record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read ({error})", file=path, remedy="delete it and run the plan again") from None
    return found
