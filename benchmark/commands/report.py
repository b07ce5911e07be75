"""`nonrigid report`: tables, figures and a page made from results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.report.table import notes, summary
from nonrigid.benchmark.report.write import write_report
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.terminal import say, show_json


def report_command(
    folder: Annotated[Path, typer.Argument(help="Results of `nonrigid bench`.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print solver against accuracy, and write DIR/report: index.html, CSV, Markdown, PNG and SVG."""
    store = Store(folder)
    index, records = store.index(), store.records()
    page = write_report(folder, index, records)
    rows = summary(records)
    if json:
        show_json({"title": index["title"], "page": str(page), "rows": rows, "notes": notes(index, records)})
        return
    show_summary(index["title"], rows)
    for note in notes(index, records):
        say(note)
    say(f"Report: {page.resolve()}")
