"""`nonrigid data info`: what a data set holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.archive import open_dataset
from nonrigid.benchmark.datasets.inventory import full_shape_rows, part_rows, summary_rows
from nonrigid.benchmark.terminal import say, show_json, show_table


def info_command(
    root: Annotated[Path, typer.Argument(help="A folder or zip archive, in any layout.", show_default=False)],
    templates: Annotated[Path | None, typer.Option(help="Where the full shapes are, for a set without.")] = None,
    parts: Annotated[bool, typer.Option("--parts", help="A row a part, not only ranges.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Tell classes, shapes, vertices, area kept, boundaries and defects of the data set at ROOT."""
    dataset = open_dataset(root, templates=templates)
    fulls, members = full_shape_rows(dataset), part_rows(dataset)
    rows = summary_rows(members)
    if json:
        show_json({"name": dataset.name, "full_shapes": fulls, "splits": rows, "parts": members})
        return
    several = len({row["set"] for row in fulls}) > 1
    hidden = () if several else ("set",)
    show_table([_without(row, hidden) for row in fulls], title=f"{dataset.name}: full shapes")
    show_table([_without(row, hidden) for row in rows], title=f"{dataset.name}: parts")
    if parts:
        show_table([_without(row, (*hidden, "truth", "mirrored")) for row in members], title="each part")
    say(f"{len(members)} parts of {len(fulls)} full shapes; defects are repaired in a view, never in the files")


def _without(row: dict[str, object], keys: tuple[str, ...]) -> dict[str, object]:
    return {key: value for key, value in row.items() if key not in keys}
