"""`nonrigid data check`: what is wrong with a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.archive import open_dataset
from nonrigid.benchmark.datasets.checks import check_archive
from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.errors import InputError


def check_command(
    root: Annotated[Path, typer.Argument(help="A folder or zip archive, in any layout.", show_default=False)],
    templates: Annotated[Path | None, typer.Option(help="Where the full shapes are, for a set without.")] = None,
    against: Annotated[Path | None, typer.Option(help="Another set, searched for the same shapes.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Read every file of the data set at ROOT and name each fault and each leak; exit with 1 if there is a fault."""
    other = None if against is None else open_dataset(against, templates=templates)
    findings = check_archive(open_dataset(root, templates=templates), against=other)
    faults = [finding for finding in findings if finding.kind == "fault"]
    leaks = [finding for finding in findings if finding.kind == "leak"]
    if json:
        show_json([vars(finding) for finding in findings])
    else:
        for finding in (*faults, *leaks):
            error = InputError(finding.problem, file=finding.place, row=finding.row, remedy=finding.remedy)
            say(f"{finding.kind}: {error}")
        say(f"{len(faults)} faults, {len(leaks)} leaks in {root}")
    if faults:
        raise typer.Exit(1)
