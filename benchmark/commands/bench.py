"""`nonrigid bench`: run a plan."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.estimate import Estimate, estimate
from nonrigid.benchmark.executors import make_executor
from nonrigid.benchmark.plan import Plan, read_plan
from nonrigid.benchmark.report.table import refusal_words, refusals, summary
from nonrigid.benchmark.runner import run_plan
from nonrigid.benchmark.terminal import say, show_json, show_table
from nonrigid.geometry.errors import InputError


class Kind(StrEnum):
    """Who does the runs."""

    joblib = "joblib"
    dask = "dask"
    inprocess = "inprocess"


def bench_command(
    plan: Annotated[str, typer.Argument(help="A TOML file, or a shipped plan, such as demo.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the results.", show_default=False)],
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    executor: Annotated[Kind, typer.Option(help="Who does the runs.")] = Kind.joblib,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler; by default --executor dask starts one here.")
    ] = None,
    share: Annotated[str, typer.Option(help="k/n: the k-th of n shares of the pairs; see `nonrigid merge`.")] = "1/1",
    data: Annotated[
        Path | None, typer.Option(help="Folder of the data set's files; else $NONRIGID_DATA, else ../shared/data.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what it takes, and run nothing.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Repeat finished runs.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Run every pair with every method and every backend of PLAN; finished runs are kept and not repeated."""
    doers = make_executor(executor.value, workers=jobs, scheduler=scheduler)
    parts = _share(share)
    read = read_plan(plan, data=data)
    if dry_run:
        _show_estimate(read, estimate(read, out, workers=jobs, share=parts, fresh=fresh), jobs, json)
        return
    records = run_plan(read, out, executor=doers, share=parts, fresh=fresh, quiet=quiet)
    rows = summary(records)
    if json:
        show_json(rows)
        return
    show_summary(f"{read.title}, on {read.dataset.name}", rows)
    for row in refusals(records):
        say(refusal_words(row))
    say(f"{len(records)} runs in {out}; `nonrigid report {out}` writes tables and figures")


def _show_estimate(plan: Plan, found: Estimate, jobs: int, json: bool) -> None:
    if json:
        show_json(vars(found))
        return
    show_table(found.rows, title=plan.title, columns={key: key for key in found.rows[0]} | {"seconds": "seconds a run"})
    left, who = found.runs - found.finished, "1 process" if jobs == 1 else f"{jobs} processes"
    say(
        f"{found.runs} runs, {found.finished} finished; the other {left} take about {found.hours:.2g} h with {who} "
        f"and {found.gigabytes:.2g} GB of disk; derived geometry is cached elsewhere (`nonrigid cache info`)"
    )


def _share(word: str) -> tuple[int, int]:
    number, slash, count = word.partition("/")
    if not (slash and number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count)):
        raise InputError(f"--share is {word!r}", remedy="write for example 1/2 on one machine and 2/2 on another")
    return int(number), int(count)
