"""The results of a benchmark as parquet: one table of runs, one of traces, one of environments, with their schema."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from nonrigid.benchmark.schema import ADDED, SCHEMA_VERSION, check_schema
from nonrigid.geometry.errors import InputError

_TEXT, _REAL, _WHOLE = pa.string(), pa.float64(), pa.int64()
_MARK = b"nonrigid_schema"

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
    "accuracy": _TEXT,
    "accepted": pa.bool_(),
    **dict.fromkeys(("total_seconds", "peak_memory"), _REAL),
    "environment": _TEXT,
}
"""Columns of runs.parquet. Errors are fractions of sqrt(full area); objective and gap are the first problem's;
peak_memory is in gigabytes."""

TRACES: Mapping[str, pa.DataType] = {
    "id": _TEXT,
    "stage": _WHOLE,
    "problem": _TEXT,
    **dict.fromkeys(("seconds", "evaluations", "objective", "violation"), _REAL),
}
"""Columns of traces.parquet: a row a point that a solver of a run passed, stages counted from 0."""

ENVIRONMENTS: Mapping[str, pa.DataType] = dict.fromkeys(("environment", "name", "value"), _TEXT)
"""Columns of environment.parquet: a row a fact of a machine that runs were made on, such as packages.numpy."""


def read_table(path: Path) -> pa.Table:
    """Read a table of runs that this or an older version wrote, with the columns of this one.

    Raises
    ------
    InputError
        If there is no such table, it is not one of ours, or a newer version wrote it.
    """
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"cannot be read as parquet ({error})", file=path, remedy="run the plan again") from None
    words = (table.schema.metadata or {}).get(_MARK, b"none").decode()
    try:
        version = check_schema(int(words) if words.isdigit() else words)
    except InputError as error:
        raise error.at(path) from None
    for step in range(version + 1, SCHEMA_VERSION + 1):
        for name in ADDED[step]:
            table = table.append_column(name, pa.nulls(len(table), COLUMNS[name]))
    return table.replace_schema_metadata({_MARK: str(SCHEMA_VERSION).encode()})


def write_tables(folder: Path, records: Sequence[Mapping[str, Any]], environments: Mapping[str, Any]) -> Path:
    """Write runs.parquet, traces.parquet and environment.parquet, each whole or not at all; return the first.

    Parameters
    ----------
    environments
        Word in the column `environment` -> what `nonrigid.benchmark.environment.environment` returned.
    """
    rows = [{**record, "stages": json.dumps(record.get("stages", []))} for record in records]
    _write(folder / "environment.parquet", ENVIRONMENTS, list(_facts(environments)))
    _write(folder / "traces.parquet", TRACES, list(_traces(records)))
    return _write(folder / "runs.parquet", COLUMNS, rows)


def _traces(records: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for record in records:
        for number, stage in enumerate(record.get("stages", [])):
            for seconds, evaluations, objective, violation in stage["trace"]:
                yield {
                    "id": record["id"],
                    "stage": number,
                    "problem": stage["problem"],
                    "seconds": seconds,
                    "evaluations": evaluations,
                    "objective": objective,
                    "violation": violation,
                }


def _facts(environments: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    def walk(name: str, value: Any) -> Iterator[tuple[str, str]]:
        if isinstance(value, Mapping):
            for key, inner in value.items():
                yield from walk(f"{name}.{key}" if name else str(key), inner)
        elif isinstance(value, list):
            for number, inner in enumerate(value):
                yield from walk(f"{name}.{number}", inner)
        else:
            yield name, "" if value is None else str(value)

    for word, facts in environments.items():
        for name, value in walk("", facts):
            yield {"environment": word, "name": name, "value": value}


def _write(path: Path, columns: Mapping[str, pa.DataType], rows: Sequence[Mapping[str, Any]]) -> Path:
    arrays = {
        name: pa.array([row.get(name) for row in rows], type=kind, from_pandas=True) for name, kind in columns.items()
    }
    table = pa.table(arrays).replace_schema_metadata({_MARK: str(SCHEMA_VERSION).encode()})
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        pq.write_table(table, temporary)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path
