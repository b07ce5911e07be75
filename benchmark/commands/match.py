"""`nonrigid match`: find where a part lies on a full surface."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.choices import guarded, parse_backend
from nonrigid.benchmark.formats import write_corr
from nonrigid.benchmark.methods import make_method, parse_settings
from nonrigid.benchmark.terminal import say, show_json, show_table
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import Match, match
from nonrigid.solvers.solution import Solution


def match_command(
    part: Annotated[Path, typer.Argument(help="The partial surface: OFF, OBJ or PLY.", show_default=False)],
    full: Annotated[Path, typer.Argument(help="The full surface, in the same unit of length.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Where the correspondence goes (.corr).", show_default=False)],
    method: Annotated[str, typer.Option(help="The formulation, such as gt.")] = "gt",
    backend: Annotated[
        str, typer.Option(help="backend[:algorithm]; a+b for a chain; stage=a,stage=b for a backend a stage.")
    ] = "native",
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A setting of the method, as name=value; may be repeated.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 0,
    starts: Annotated[int, typer.Option(help="Number of starts of each solve.")] = 1,
    time_limit: Annotated[float, typer.Option(help="Seconds that each solve may take.")] = 600.0,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Match PART to FULL and write one row a vertex of the part: triangle b1 b2 b3, or -1 0 0 0.

    Exits with 0 for a match, 1 where a solve was refused or failed, 2 for bad input.
    """
    if out.suffix != ".corr" or not out.parent.is_dir():
        wrong = f"the folder {out.parent} does not exist" if out.suffix == ".corr" else f"the suffix {out.suffix!r}"
        raise InputError(wrong, file=out, remedy="name a .corr file in a folder that exists")
    formulation = make_method(method, parse_settings(setting or []))
    choice = parse_backend(backend)
    limits = guarded(Limits(seconds=time_limit), choice)
    piece = read_mesh(part)
    pair = Pair.of(piece, read_mesh(full))
    found = match(pair, formulation, choice, starts=starts, seed=seed, limits=limits)
    matched = 0
    if found.correspondence is not None:
        matched = len(found.correspondence)
        write_corr(out, found.correspondence.dense(len(piece.vertices)))
    repairs = {file.name: list(s.clean_view.repairs) for file, s in ((part, pair.part), (full, pair.full))}
    if json:
        show_json({**_record(found, matched, out), "repairs": repairs})
    else:
        for name, done in repairs.items():
            if done:
                say(f"{name}, as it was matched: {'; '.join(done)}")
        show_table([stage_row(solution) for solution in found.solutions], title=f"{method}: {part.name} on {full.name}")
    if found.correspondence is None:
        typer.echo(f"nonrigid: {found.message}".replace("\n", " "), err=True)
        raise typer.Exit(1)
    if not json:
        say(f"{matched} of {len(piece.vertices)} vertices matched; written to {out}")


def stage_row(solution: Solution) -> dict[str, object]:
    """Return what one solve did, as a row of a table."""
    return {
        "problem": solution.problem,
        "variables": sum(value.size for value in solution.values.values()),
        "solver": solution.spec,
        "route": " > ".join(solution.route),
        "status": solution.status.value,
        "objective": solution.objective,
        "stationarity": solution.stationarity,
        "evaluations": solution.evaluations,
        "build_seconds": solution.build_seconds,
        "solve_seconds": solution.solve_seconds,
    }


def _record(found: Match, matched: int, out: Path) -> dict[str, object]:
    return {
        "status": found.status.value,
        "message": found.message,
        "matches": matched,
        "out": str(out) if matched else None,
        "formulation_seconds": found.formulation_seconds,
        "build_seconds": found.build_seconds,
        "solve_seconds": found.solve_seconds,
        "stages": [{**stage_row(solution), "message": solution.message} for solution in found.solutions],
    }
