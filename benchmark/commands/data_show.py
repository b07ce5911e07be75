"""`nonrigid data show`: a contact sheet of a data set."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.archive import open_dataset
from nonrigid.benchmark.terminal import say, show_json


class Axis(StrEnum):
    """Which axis of the meshes points up."""

    x = "x"
    y = "y"
    z = "z"


def show_command(
    root: Annotated[Path, typer.Argument(help="A folder or zip archive, in any layout.", show_default=False)],
    out: Annotated[Path, typer.Option(help="The PNG file to write.")] = Path("contact_sheet.png"),
    templates: Annotated[Path | None, typer.Option(help="Where the full shapes are, for a set without.")] = None,
    split: Annotated[list[str] | None, typer.Option(help="Show these splits only; may be repeated.")] = None,
    up: Annotated[Axis, typer.Option(help="Which axis of the meshes points up.")] = Axis.z,
    azimuth: Annotated[float, typer.Option(help="Degrees that the eye goes round that axis.")] = 30.0,
    size: Annotated[int, typer.Option(help="Pixels of one picture.")] = 160,
    per_class: Annotated[int, typer.Option(help="Parts of one class and split at most.")] = 12,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Draw every full shape and its parts; colours follow the ground truth from the full shape to the part."""
    # Drawing takes a second to load, which other commands need not wait for.
    from nonrigid.benchmark.contact_sheet import contact_sheet
    from nonrigid.benchmark.render import View, save_png

    dataset = open_dataset(root, templates=templates)
    view = View(up=up.value, azimuth=azimuth)
    image, shown = contact_sheet(dataset, splits=tuple(split or ()), view=view, size=size, per_class=per_class)
    save_png(image, out)
    if json:
        show_json({"out": str(out), "shown": shown, "width": image.shape[1], "height": image.shape[0]})
    else:
        say(f"{shown} shapes drawn; written to {out}")
