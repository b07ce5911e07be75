"""`nonrigid merge`: put results of several machines together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.merge import merge_results
from nonrigid.benchmark.report.table import summary
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.terminal import say, show_json


def merge_command(
    folders: Annotated[list[Path], typer.Argument(help="Results of `nonrigid bench`.", show_default=False)],
    out: Annotated[Path, typer.Option(help="A new folder.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Put the runs of several folders into one; runs of the same id with different results are named and refused."""
    records = merge_results(folders, out)
    rows = summary(records)
    if json:
        show_json(rows)
        return
    show_summary(Store(out).index()["title"], rows)
    say(f"{len(records)} runs in {out}")
