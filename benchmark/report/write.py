"""Write a report: an overview, a page a pair, figures and tables, which need nothing else to be read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config

from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.plan import read_plan
from nonrigid.benchmark.report.export import as_csv, as_latex, as_markdown
from nonrigid.benchmark.report.figures.curves import error_curves
from nonrigid.benchmark.report.figures.gap import gap_against_error
from nonrigid.benchmark.report.figures.paired import paired_differences
from nonrigid.benchmark.report.figures.partiality import error_by_missing_area
from nonrigid.benchmark.report.figures.profiles import solver_profiles
from nonrigid.benchmark.report.figures.time_error import error_against_time
from nonrigid.benchmark.report.pages.templates import fill, script, write_assets
from nonrigid.benchmark.report.pairs import PairTask, slug, write_pair
from nonrigid.benchmark.report.series import Series, all_series
from nonrigid.benchmark.report.sketch import Sketch, save_sketch
from nonrigid.benchmark.report.table import COLUMNS, EXPLAINED, WIDE, by_method, notes, pair_rows, summary
from nonrigid.benchmark.store import Record, Store
from nonrigid.geometry.errors import NonrigidError, UnknownNameError

FIGURES: tuple[Callable[[Sequence[Series]], list[Sketch]], ...] = (
    error_curves,
    error_by_missing_area,
    error_against_time,
    solver_profiles,
    gap_against_error,
    paired_differences,
)
"""What draws figures; each returns none where the results have nothing to show."""

_KINDS = dict.fromkeys(("method", "backend", "split", "status"), "choice") | {"pair": "link", "message": "clip"}


def write_report(
    folder: Path,
    index: Mapping[str, Any],
    records: Sequence[Record],
    *,
    data: Path | None = None,
    jobs: int = 1,
) -> Path:
    """Write `folder`/report and return its overview; opening it makes no request to anywhere.

    Parameters
    ----------
    folder
        Results; see `nonrigid.benchmark.store.Store`.
    index, records
        What the plan asks for, and the finished runs.
    data
        Folder of the data set's files, as in `read_plan`.
    jobs
        Processes that write the pages of pairs.
    """
    folder = folder.absolute()  # helper processes may live in another working directory
    out = folder / "report"
    for place in (out, out / "pairs", out / "data", out / "assets"):
        place.mkdir(parents=True, exist_ok=True)
    rows, runs = summary(records), pair_rows(records)
    write_text(out / "solvers.csv", as_csv(rows))
    write_text(out / "solvers.md", as_markdown(rows, COLUMNS))
    write_text(out / "solvers.tex", as_latex(rows, COLUMNS))
    write_text(out / "runs.csv", as_csv(runs))
    write_text(out / "runs.tex", as_latex(runs, {key: key.replace("_", " ") for key in (runs[0] if runs else {})}))
    write_assets(out / "assets")
    sketches = draw_figures(out, records)
    problems = _write_pairs(folder, records, data, jobs)
    write_text(out / "data" / "runs.js", _runs_script(records, runs))
    page = fill(
        "index.html",
        index=index,
        command=f"nonrigid report {folder.resolve().name}",
        tables=by_method(rows, WIDE),
        headings=COLUMNS,
        explained=EXPLAINED,
        best=_best(rows),
        figures=sketches,
        run_count=len(runs),
        notes=[*notes(index, records), *problems],
        environment=_environment(folder),
    )
    write_text(out / "index.html", page)
    return out / "index.html"


def draw_figures(out: Path, records: Sequence[Record], only: str | None = None) -> list[Sketch]:
    """Draw the figures for which there are data into `out`, or one of them.

    Raises
    ------
    UnknownNameError
        If the results give no figure of that name.
    """
    series = all_series(records)
    sketches = [sketch for make in FIGURES for sketch in make(series)]
    if only is not None:
        if only not in {sketch.name for sketch in sketches}:
            raise UnknownNameError("figure", only, [sketch.name for sketch in sketches])
        sketches = [sketch for sketch in sketches if sketch.name == only]
    for sketch in sketches:
        save_sketch(out, sketch)
    return sketches


def pair_specs(folder: Path, data: Path | None = None) -> tuple[dict[str, PairSpec], str]:
    """Return the pairs of a folder's plan by name, and why they cannot be shown where their files are not found."""
    try:
        templates = Store(folder).index().get("templates") if (folder / "index.json").is_file() else None
        plan = read_plan(folder / "plan.toml", data=data, templates=None if templates is None else Path(templates))
        return {spec.name: spec for spec in plan.pairs()}, ""
    except NonrigidError as failure:
        return {}, f"The surfaces cannot be shown: {failure}. Give their folder: nonrigid report DIR --data FOLDER."


def _write_pairs(folder: Path, records: Sequence[Record], data: Path | None, jobs: int) -> list[str]:
    """Write the pages of all pairs, and return what to know about them."""
    specs, problem = pair_specs(folder, data)
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["pair"], []).append(record)
    tasks = []
    for name, members in groups.items():
        spec = specs.get(name)
        lost = problem or ("" if spec else f"The data set has no pair {name} any more.")
        tasks.append(PairTask(name=name, records=tuple(members), spec=spec, problem=lost, folder=folder))
    # Full surfaces may differ from those of an earlier report of this folder.
    for old in (folder / "report" / "data").glob("full-*.js"):
        old.unlink()
    with parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        Parallel(batch_size=1)(delayed(write_pair)(task) for task in tasks)
    return [problem] if problem and tasks else []


def _runs_script(records: Sequence[Record], runs: Sequence[Mapping[str, object]]) -> str:
    keys = [key for key in (runs[0] if runs else {}) if key != "formulation_seconds"]
    kinds = {key: _KINDS.get(key) or ("number" if _numeric(runs, key) else "text") for key in keys}
    columns = [{"heading": key.replace("_", " "), "kind": kinds[key]} for key in keys]
    table = {
        "columns": columns,
        "rows": [[_short(row[key]) for key in keys] for row in runs],
        "pages": {record["pair"]: f"pairs/{slug(record['pair'])}.html" for record in records},
    }
    return script(tables={"runs": table})


def _numeric(rows: Sequence[Mapping[str, object]], key: str) -> bool:
    return any(isinstance(row[key], int | float) for row in rows)


def _short(value: object) -> object:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _best(rows: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """Return the smallest error and solve time over all pairs, to be set in bold."""
    whole = [row for row in rows if row["split"] == "all"]
    found: dict[str, object] = {}
    for key in ("mean_error_x100", "mean_error_per_point_x100", "solve_seconds"):
        values = [value for row in whole if isinstance(value := row[key], float)]
        found[key] = min(values, default=None)
    return found


def _environment(folder: Path) -> dict[str, object]:
    path = folder / "environment.json"
    found: dict[str, object] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found
