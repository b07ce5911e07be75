"""`nonrigid data submit`: pack correspondences as the SHREC'16 track takes them."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.convert import pack
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.errors import InputError


def submit_command(
    results: Annotated[Path, typer.Argument(help="Results of `nonrigid bench`.", show_default=False)],
    out: Annotated[Path, typer.Option(help="The zip file to write.", show_default=False)],
    label: Annotated[str | None, typer.Option(help="The method's label, where there are several.")] = None,
    backend: Annotated[str | None, typer.Option(help="The backend, where there are several.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Pack one `<shape>.corr` a pair into a zip archive, for a set whose ground truth others keep.

    Exits with 1 where pairs have no correspondence; the archive then holds the others.
    """
    store = Store(results)
    chosen = [
        record
        for record in store.records()
        if label in (None, record["label"]) and backend in (None, record["backend"])
    ]
    kinds = sorted({f"{record['label']} with {record['backend']}" for record in chosen})
    if len(kinds) != 1:
        raise InputError(
            f"{len(kinds)} ways of matching: {', '.join(kinds)}", file=results, remedy="choose by --label and --backend"
        )
    if out.suffix.lower() != ".zip" or not out.resolve().parent.is_dir():
        raise InputError("the archive cannot be written there", file=out, remedy="name a .zip in a folder that exists")
    lost = []
    with tempfile.TemporaryDirectory(dir=out.resolve().parent, prefix=f".{out.name}.") as scratch:
        folder = Path(scratch, "files")
        folder.mkdir()
        for record in chosen:
            made = store.match_file(record["id"])
            if made.is_file():
                shutil.copyfile(made, folder / f"{record['pair']}.corr")
            else:
                lost.append(record["pair"])
        pack(folder, Path(scratch, "out.zip"), inside=out.stem)
        Path(scratch, "out.zip").replace(out)
    if json:
        show_json({"out": str(out), "kind": kinds[0], "packed": len(chosen) - len(lost), "lost": lost})
    else:
        say(f"{len(chosen) - len(lost)} correspondences of {kinds[0]} packed into {out}")
    if lost:
        typer.echo(f"nonrigid: no correspondence for {', '.join(lost)}", err=True)
        raise typer.Exit(1)
