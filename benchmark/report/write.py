"""Write a report: one page that needs nothing else but its figures, and the tables as CSV and Markdown."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.report.figures import draw_figures
from nonrigid.benchmark.report.table import COLUMNS, EXPLAINED, WIDE, by_method, notes, pair_rows, summary
from nonrigid.benchmark.store import Record
from nonrigid.benchmark.terminal import cell


def write_report(folder: Path, index: Mapping[str, object], records: Sequence[Record]) -> Path:
    """Write `folder`/report and return its page; opening it makes no request to anywhere."""
    out = folder / "report"
    out.mkdir(parents=True, exist_ok=True)
    rows, runs = summary(records), pair_rows(records)
    write_text(out / "solvers.csv", as_csv(rows))
    write_text(out / "solvers.md", as_markdown(rows, COLUMNS))
    write_text(out / "runs.csv", as_csv(runs))
    figures = draw_figures(out, records)
    pages = Environment(
        loader=PackageLoader("nonrigid.benchmark.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["cell"] = cell
    page = pages.get_template("page.html").render(
        index=index,
        tables=by_method(rows, WIDE),
        headings=COLUMNS,
        explained=EXPLAINED,
        best=_best(rows),
        figures=figures,
        runs=runs,
        notes=notes(index, records),
        environment=_environment(folder),
    )
    write_text(out / "index.html", page)
    return out / "index.html"


def as_csv(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows as CSV, numbers in full."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def as_markdown(rows: Sequence[Mapping[str, object]], columns: Mapping[str, str]) -> str:
    """Return rows as a table in Markdown.

    Examples
    --------
    >>> print(as_markdown([{"a": 1, "b": None}], {"a": "A", "b": "B"}))
    | A | B |
    | --- | --- |
    | 1 |  |
    <BLANKLINE>
    """
    lines = [list(columns.values()), ["---"] * len(columns)]
    lines += [[cell(row.get(key)).replace("|", "\\|") for key in columns] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


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
