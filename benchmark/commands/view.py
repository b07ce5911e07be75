"""`nonrigid view`: look at one match."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import read_truth
from nonrigid.benchmark.terminal import say
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh


def view_command(
    part: Annotated[Path, typer.Argument(help="The partial surface: OFF, OBJ or PLY.", show_default=False)],
    full: Annotated[Path, typer.Argument(help="The full surface.", show_default=False)],
    correspondence: Annotated[Path, typer.Argument(help="A .corr, .vts or .map file.", show_default=False)],
    truth: Annotated[
        Path | None, typer.Option(help="The ground truth (.baryc_gt, .vts, .map).", show_default=False)
    ] = None,
    mirrored: Annotated[
        Path | None, typer.Option(help="The mirrored ground truth (.baryc_gt_sym).", show_default=False)
    ] = None,
    metric: Annotated[str, typer.Option(help="dijkstra, heat, edgeflip or exact.")] = "dijkstra",
    out: Annotated[
        Path | None, typer.Option(help="The page (.html) or picture (.png); by default beside the correspondence.")
    ] = None,
    open_page: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """Write a page, one file, that shows both surfaces in 3D with the match between them, or a picture of it."""
    # Drawing takes a second to load, which other commands need not wait for.
    from nonrigid.benchmark.report.single import match_score, write_match_page, write_match_picture

    place = out or correspondence.with_suffix(".html")
    if place.suffix not in (".html", ".png"):
        raise InputError(f"the suffix {place.suffix!r}", file=place, remedy="name a .html or .png file")
    if not place.parent.is_dir():
        raise InputError(f"the folder {place.parent} does not exist", file=place, remedy="create it first")
    if mirrored is not None and truth is None:
        raise InputError("--mirrored without --truth", remedy="give the direct ground truth as well")
    piece, whole = read_mesh(part), read_mesh(full)
    rows = len(piece.vertices)
    pair = PairData(
        name=f"{part.stem} on {full.stem}",
        part=piece,
        full=whole,
        truth=None if truth is None else read_truth(truth, whole, expected_rows=rows),
        mirrored=None if mirrored is None else read_truth(mirrored, whole, expected_rows=rows),
    )
    points = read_truth(correspondence, whole, expected_rows=rows)
    if place.suffix == ".png":
        write_match_picture(place, pair, points)
    else:
        write_match_page(place, pair, points, match_score(pair, points, metric=metric))
    say(f"View: {place.resolve()}")
    if open_page and not webbrowser.open(place.resolve().as_uri()):
        raise InputError("there is no browser to open", file=place, remedy="open the file by hand")
