"""Score a folder of another program's predictions as a benchmark, with a table, a report and records like ours."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from nonrigid.benchmark.datasets.archive import open_dataset
from nonrigid.benchmark.plan import read_plan
from nonrigid.benchmark.predictions import predicted
from nonrigid.benchmark.runner import run_plan
from nonrigid.benchmark.store import Record
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Scored:
    """Hold the scores of a folder of predictions, and what was left out.

    Parameters
    ----------
    records
        One a pair with a prediction; see `nonrigid.benchmark.run.do_run`.
    missing
        Names of the pairs without one.
    unused
        Names of the parts that have a prediction but are in no pair.
    """

    records: list[Record]
    missing: list[str]
    unused: list[str]


def score_predictions(
    folder: Path, data: Path, *, out: Path, label: str, metric: str = "dijkstra", jobs: int = 1
) -> Scored:
    """Score the predictions in a folder on the pairs of a data set in files that have one.

    Parameters
    ----------
    folder
        See `nonrigid.benchmark.predictions.Predictions`.
    data
        A folder or archive in any layout.
    out
        Folder of the results, which holds a plan, as that of any benchmark; predictions that have not changed since are
        not scored again.
    label
        Name of the other program in tables and figures.

    Raises
    ------
    InputError
        If there are no predictions, or none is of a part of the data set.
    """
    files = predicted(folder)
    pairs = {spec.name: str(spec.metadata.get("stem", spec.name)) for spec in open_dataset(data).pairs()}
    names = [name for name, stem in pairs.items() if stem in files]
    if not names:
        raise InputError(
            f"none of the {len(files)} files is named as one of the {len(pairs)} parts in {data}",
            file=folder,
            remedy=f"name them as the parts, such as {next(iter(pairs.values()))}.corr",
        )
    with TemporaryDirectory() as place:
        plan = Path(place, "predictions.toml")
        plan.write_text(_plan_text(data.resolve(), names, folder.resolve(), label, metric), encoding="utf-8")
        records = run_plan(read_plan(plan), out, jobs=jobs, quiet=True)
    known = set(pairs.values())
    return Scored(
        records=records,
        missing=[name for name in pairs if name not in names],
        unused=[stem for stem in files if stem not in known],
    )


def _plan_text(data: Path, names: list[str], folder: Path, label: str, metric: str) -> str:
    """Return the plan as TOML; predictions are of the parts as they lie, so nothing moves them."""
    lines = [
        f"title = {_text(f'Predictions of {label}')}",
        'backends = ["native"]',
        f"metric = {_text(metric)}",
        "motion_seed = false",
        "",
        "[data]",
        'dataset = "archive"',
        f"root = {_text(str(data))}",
        f"names = [{', '.join(_text(name) for name in names)}]",
        "",
        "[[methods]]",
        'method = "predictions"',
        f"label = {_text(label)}",
        f"settings = {{ folder = {_text(str(folder))} }}",
    ]
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)  # a text of JSON is one of TOML
