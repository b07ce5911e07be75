"""`nonrigid bench`: run a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.plan import read_plan
from nonrigid.benchmark.report.table import summary
from nonrigid.benchmark.runner import run_plan
from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.errors import InputError


def bench_command(
    plan: Annotated[str, typer.Argument(help="A TOML file, or demo or gt16.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the results.", show_default=False)],
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the data set's files; else $NONRIGID_DATA, else ../shared/data.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Repeat finished runs.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Run every pair with every method and every backend of PLAN; finished runs are kept and not repeated."""
    if jobs < 1:
        raise InputError(f"--jobs is {jobs}", remedy="give at least 1")
    read = read_plan(plan, data=data)
    records = run_plan(read, out, jobs=jobs, fresh=fresh, quiet=quiet)
    rows = summary(records)
    if json:
        show_json(rows)
        return
    show_summary(read.title, rows)
    say(f"{len(records)} runs in {out}; `nonrigid report {out}` writes tables and figures")
