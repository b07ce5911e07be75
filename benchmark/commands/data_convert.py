"""`nonrigid data convert`: write a data set in another layout."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.archive import open_dataset
from nonrigid.benchmark.datasets.convert import LAYOUTS, convert
from nonrigid.benchmark.terminal import say, show_json


def convert_command(
    source: Annotated[Path, typer.Argument(help="A folder or zip archive, in any layout.", show_default=False)],
    target: Annotated[Path, typer.Argument(help="A new folder, or a new .zip file.", show_default=False)],
    layout: Annotated[str, typer.Option(help=f"One of {', '.join(LAYOUTS)}.")] = "shrec16",
    mesh: Annotated[str, typer.Option(help="Form of the meshes: .off, .obj, .ply, .vert or .mat.")] = ".off",
    templates: Annotated[Path | None, typer.Option(help="Where the full shapes are, for a set without.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Write the parts of SOURCE, their full shapes and their ground truth to TARGET in a layout."""
    dataset = open_dataset(source, templates=templates)
    count = len(dataset.pairs())
    lost = convert(dataset, target, layout=layout, mesh_suffix=mesh)
    if json:
        show_json({"pairs": count, "out": str(target), "layout": layout, "lost": lost})
        return
    say(f"{count} pairs written to {target}" + (f"; this layout has no place for: {', '.join(lost)}" if lost else ""))
