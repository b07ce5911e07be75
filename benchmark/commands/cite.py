"""`nonrigid cite`: BibTeX of what was used."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nonrigid.benchmark.citations import citations, words_used
from nonrigid.benchmark.store import Store
from nonrigid.benchmark.terminal import say


def cite_command(
    folder: Annotated[Path | None, typer.Argument(help="Results of `nonrigid bench`; everything by default.")] = None,
) -> None:
    """Print BibTeX of the formulations, solvers and data that a benchmark used."""
    if folder is None:
        say(citations())
        return
    store = Store(folder)
    say(citations(words_used(store.index()["dataset"], store.records())))
