"""Put the results of several machines together."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from pathlib import Path

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.store import Record, Store
from nonrigid.geometry.errors import InputError

AGREED = ("status", "problem_hash", "objective", "match_count", "mean_error")
"""What two runs of one id have to agree in; times and machines may differ."""

CLOSE = 1e-6
"""Relative difference up to which two machines' numbers agree: their libraries round differently."""


def merge_results(folders: Sequence[Path], out: Path) -> list[Record]:
    """Write the runs of several folders of results into a new one, and return them.

    Where two folders hold the same run, that of the first is taken.

    Raises
    ------
    InputError
        If a folder holds no results, `out` holds some already, the folders are of different data sets or metrics; or
        two of them hold a run of the same id with other results, or under the same label and backend runs of a pair
        with other settings: the message names the runs.
    """
    stores = [Store(folder) for folder in folders]
    indices = [store.index() for store in stores]
    target = Store(out)
    if (out / "index.json").exists():
        raise InputError("holds results already", file=out, remedy="name a new folder")
    for key in ("dataset", "data", "metric"):
        for folder, index in zip(folders, indices, strict=True):
            if index.get(key) != indices[0].get(key):
                raise InputError(
                    f"its {key} is {index.get(key)}, that of {folders[0]} {indices[0].get(key)}",
                    file=folder,
                    remedy="merge results of one data set and metric",
                )
    labels: dict[str, str] = {}
    for index in indices:
        labels |= {run: label for run, label in index["runs"].items() if run not in labels}
    holders = {run: [store for store in stores if store.has(run)] for run in labels}
    _refuse_conflicts(holders)
    _refuse_twins(labels, holders)
    target.prepare()
    with target.writing():
        for store in reversed(stores):
            _copy_all(store.environments, target.environments)
            for name in ("plan.toml", "environment.json"):
                if (store.folder / name).is_file():
                    shutil.copyfile(store.folder / name, out / name)
        for run, held in holders.items():
            if held:
                # The record last: a run counts as finished once it is there.
                for path in held[0].files(run)[::-1]:
                    if path.is_file():
                        shutil.copyfile(path, out / path.parent.name / path.name)
        if len(texts := list(dict.fromkeys(_plan(store) for store in stores))) > 1:
            for number, text in enumerate(texts, start=1):
                write_text(out / f"plan-{number}.toml", text)
    target.write_index({**indices[0], "runs": labels})
    records = target.records()
    target.write_table(records)
    return records


def _refuse_conflicts(holders: dict[str, list[Store]]) -> None:
    conflicts = []
    for run, held in holders.items():
        records = [store.read_run(run) for store in held]
        for store, record in zip(held[1:], records[1:], strict=True):
            differing = [key for key in AGREED if not _agree(records[0].get(key), record.get(key))]
            if differing:
                key = differing[0]
                words = f"{record['pair']} by {record['label']} with {record['backend']}"
                values = f"{key} is {records[0].get(key)} in {held[0].folder} and {record.get(key)} in {store.folder}"
                conflicts.append(f"{run} ({words}): {values}")
    if conflicts:
        more = f", and {len(conflicts) - 5} more" if len(conflicts) > 5 else ""
        raise InputError(
            f"{len(conflicts)} runs have different results: {'; '.join(conflicts[:5])}{more}",
            remedy="delete the wrong one of each (runs/<id>.json), or merge folders of one version of the package",
        )


def _refuse_twins(labels: dict[str, str], holders: dict[str, list[Store]]) -> None:
    """Raise `InputError` where runs with other settings, seeds apart, would stand in one row of a table."""
    seen: dict[tuple[object, ...], tuple[list[object], Store]] = {}
    for run, held in holders.items():
        if not held:
            continue
        record = held[0].read_run(run)
        key = (labels[run], *(record.get(name) for name in ("pair", "backend", "accuracy")))
        settings = [record.get(name) for name in ("method", "settings", "starts", "limits")]
        first, store = seen.setdefault(key, (settings, held[0]))
        if settings != first:
            raise InputError(
                f"{labels[run]!r} with {record['backend']} on {record['pair']} has other settings than in"
                f" {store.folder}",
                file=held[0].folder,
                remedy="give each its own label in its plan",
            )


def _agree(one: object, other: object) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=CLOSE, abs_tol=CLOSE)
    return one == other


def _plan(store: Store) -> str:
    path = store.folder / "plan.toml"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _copy_all(source: Path, target: Path) -> None:
    for path in sorted(source.glob("*.json")) if source.is_dir() else []:
        shutil.copyfile(path, target / path.name)
