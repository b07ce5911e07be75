"""`nonrigid data make`: write a data set of our own as files."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.datasets.recipe import Recipe
from nonrigid.benchmark.datasets.writing import write_dataset
from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.errors import InputError


class Kind(StrEnum):
    """What to make."""

    creatures = "creatures"
    recipe = "recipe"


def make_command(
    kind: Annotated[Kind, typer.Argument(help="creatures, or recipe for meshes of your own.", show_default=False)],
    out: Annotated[Path, typer.Option(help="The folder to write; a run that was interrupted is taken up again.")],
    source: Annotated[
        Path | None, typer.Option("--from", help="For recipe: the folder of dense meshes such as cat0.off, cat1.off.")
    ] = None,
    vertices: Annotated[int, typer.Option(help="Vertices of each complete shape.")] = 10_000,
    seed: Annotated[int, typer.Option(help="For planes, borders of holes and the numbering.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Number of processes.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Write cuts and holes with ground truth in the layout of SHREC'16, of built-in creatures or of posed meshes."""
    if kind is Kind.creatures:
        if source is not None:
            raise InputError("creatures are built in and read no files", file=source, remedy="leave out --from")
        made: Creatures | Recipe = Creatures(vertices=vertices, seed=seed)
    elif source is None:
        raise InputError("the recipe needs meshes", remedy="name their folder by --from")
    else:
        made = Recipe(root=source.absolute(), vertices=vertices, seed=seed)
    count = write_dataset(made, out, jobs=jobs)
    if json:
        show_json({"dataset": made.name, "folder": str(out), "parts": count})
    else:
        say(f"{count} parts of {made.name} are in {out}")
