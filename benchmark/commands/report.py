"""`nonrigid report`: tables, figures and pages made from results."""

from __future__ import annotations

import os
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.report.table import notes, summary
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.errors import InputError


def report_command(
    folder: Annotated[Path, typer.Argument(help="Results of `nonrigid bench`.", show_default=False)],
    open_page: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
    figure: Annotated[
        str | None, typer.Option(help="Draw this figure only, such as curves, into DIR/report.", show_default=False)
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the data set's files; else $NONRIGID_DATA, else ../shared/data.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes; by default one a core.", show_default=False)] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print solver against accuracy, and write DIR/report: an overview, a page a pair, figures and tables."""
    # Drawing takes a second to load, which other commands need not wait for.
    from nonrigid.benchmark.report.write import draw_figures, pair_specs, write_report

    processes = (os.cpu_count() or 1) if jobs is None else jobs
    if processes < 1:
        raise InputError(f"--jobs is {jobs}", remedy="give at least 1")
    store = Store(folder)
    index, records = store.index(), store.records()
    root = index.get("root")
    if data is None and root is not None and Path(root).exists():
        data = Path(root)
    if figure is not None:
        out = folder / "report"
        out.mkdir(exist_ok=True)
        draw_figures(out, records, only=figure)
        say(f"Figure: {(out / figure).resolve()}.pdf, .png, .csv, .tex, -light.svg, -dark.svg")
        return
    page = write_report(folder, index, records, data=data, jobs=processes)
    rows = summary(records)
    known = [*notes(index, records), *filter(None, [pair_specs(folder, data)[1]])]
    if json:
        show_json({"title": index["title"], "page": str(page), "rows": rows, "notes": known})
    else:
        show_summary(index["title"], rows)
        for note in known:
            say(note)
        say(f"Report: {page.resolve()}")
    if open_page and not webbrowser.open(page.resolve().as_uri()):
        raise InputError("there is no browser to open", file=page, remedy="open the file by hand")
