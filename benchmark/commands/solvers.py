"""`nonrigid solvers`: the matrix of problems and backends."""

from __future__ import annotations

from typing import Annotated

import typer

from nonrigid.benchmark.matrix import solver_matrix
from nonrigid.benchmark.methods import parse_settings
from nonrigid.benchmark.terminal import show_json, show_table


def solvers_command(
    problem: Annotated[str | None, typer.Option(help="A method, such as gt; all of them by default.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A setting of the method, as name=value; may be repeated.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List which algorithm of which backend takes the problems of a method: native, via which bridges, or refused."""
    rows = solver_matrix(None if problem is None else [problem], parse_settings(setting or []))
    if json:
        show_json(rows)
        return
    groups: dict[tuple[object, ...], list[dict[str, object]]] = {}
    for row in rows:
        groups.setdefault((row["method"], row["problem"], row["variables"], row["small_variables"]), []).append(row)
    for (method, stage, size, small), members in groups.items():
        columns = {"backend": "backend", "algorithm": "algorithm", "answer": f"n = {size}"}
        if small is not None:
            columns["small_answer"] = f"n = {small}"
        shown = [{**row, "small_answer": _briefly(row)} for row in members]
        show_table(shown, title=f"{method}, problem {stage!r}", columns=columns)


def _briefly(row: dict[str, object]) -> object:
    return "the same" if row["small_answer"] == row["answer"] else row["small_answer"]
