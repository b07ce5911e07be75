"""Keep the runs of a benchmark in a folder: one file a run, written whole or not at all, and one table of all."""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.schema import SCHEMA_VERSION, check_schema, migrated
from nonrigid.benchmark.terminal import json_text
from nonrigid.geometry.errors import InputError, NonrigidError

Record = dict[str, Any]


class StorageError(NonrigidError, OSError):
    """Report that results cannot be written: the disk or a quota is full, or the folder is not writable."""


class Store:
    """Read and write the results of one plan in a folder.

    Parameters
    ----------
    folder
        Holds `plan.toml`, `environment.json`, `index.json` (what the plan asks for); for each run `runs/<id>.json`,
        `matches/<id>.corr`, `matches/<id>.npz` and `logs/<id>.log`; `environments/<word>.json` for each machine; and,
        once complete, `runs.parquet`, `traces.parquet` and `environment.parquet`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs = folder / "runs"
        self.matches = folder / "matches"
        self.logs = folder / "logs"
        self.environments = folder / "environments"

    def prepare(self) -> None:
        """Make the folders; raise `InputError` where a file stands in the way."""
        for place in (self.runs, self.matches, self.logs, self.environments):
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

    def log_file(self, run: str) -> Path:
        """Return where everything is kept that a run and the libraries in it printed."""
        return self.logs / f"{run}.log"

    def files(self, run: str) -> list[Path]:
        """Return where everything of a run is kept, its record first; not all need exist."""
        return [self.runs / f"{run}.json", self.match_file(run), self.points_file(run), self.log_file(run)]

    def has(self, run: str) -> bool:
        """Tell whether a run is finished."""
        return (self.runs / f"{run}.json").is_file()

    def finished(self, wanted: Iterable[str]) -> set[str]:
        """Return which of these runs are finished."""
        return set(wanted) & {path.name.removesuffix(".json") for path in _listed(self.runs)}

    def drop(self, runs: Iterable[str]) -> None:
        """Remove what there is of these runs, so that they are to be done."""
        for run in runs:
            for path in self.files(run):
                path.unlink(missing_ok=True)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Turn what a full disk or a lost folder raises into a `StorageError` that says what to do."""
        try:
            yield
        except OSError as error:
            raise StorageError(
                f"{self.folder}: results cannot be written ({error.strerror or error}); make room and repeat the "
                f"command: the {len(_listed(self.runs))} finished runs are kept"
            ) from None

    def write_run(self, record: Record) -> None:
        """Write one run; raise `StorageError` where that fails."""
        with self.writing():
            write_text(self.runs / f"{record['id']}.json", json_text({"schema": SCHEMA_VERSION, **record}) + "\n")

    def read_run(self, run: str) -> Record:
        """Return one finished run, as this version would have written it; `InputError` names a file that is broken."""
        path = self.runs / f"{run}.json"
        try:
            return migrated(_read(path))
        except InputError as error:
            raise error.at(path) from None

    def write_environment(self, word: str, environment: Mapping[str, Any]) -> None:
        """Write what a machine is, under the word that its runs name it by."""
        path = self.environments / f"{word}.json"
        if not path.is_file():
            with self.writing():
                write_text(path, json_text(environment) + "\n")

    def write_index(self, index: Record) -> None:
        """Write what the plan asks for."""
        with self.writing():
            write_text(self.folder / "index.json", json_text({"schema": SCHEMA_VERSION, **index}) + "\n")

    def index(self) -> Record:
        """Return what the plan asks for; raise `InputError` where there are no results."""
        path = self.folder / "index.json"
        if not path.is_file():
            raise InputError(
                "holds no results", file=self.folder, remedy="run `nonrigid bench PLAN --out` with it first"
            )
        found = _read(path)
        strange = InputError("is no index of results", file=path, remedy="repeat `nonrigid bench PLAN --out` with it")
        if not isinstance(found, dict):
            raise strange
        try:
            check_schema(found.get("schema"))
        except InputError as error:
            raise error.at(path) from None
        if not isinstance(found.get("runs"), dict):
            raise strange
        return found

    def records(self) -> list[Record]:
        """Return the finished runs of the plan, in its order, with the gap of each to the best known objective."""
        labels: dict[str, str] = self.index()["runs"]
        done = self.finished(labels)
        return with_gaps([{**self.read_run(run), "label": label} for run, label in labels.items() if run in done])

    def write_table(self, records: list[Record]) -> Path:
        """Write the parquet tables, each whole or not at all, and return the path of runs.parquet."""
        from nonrigid.benchmark.tables import write_tables  # pyarrow makes every fork of a run dearer

        environments = {path.stem: _read(path) for path in _listed(self.environments)}
        with self.writing():
            return write_tables(self.folder, records, environments)


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


def _listed(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    with os.scandir(folder) as found:
        return [Path(item.path) for item in found if item.name.endswith(".json") and not item.name.startswith(".")]


def _read(path: Path) -> Record:
    try:
        found: Record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read ({error})", file=path, remedy="delete it and run the plan again") from None
    return found
