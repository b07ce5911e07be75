"""`nonrigid cache`: look at, or empty, the store of derived geometry."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from nonrigid.benchmark.terminal import say, show_json
from nonrigid.geometry.cache import default_cache


class Action(StrEnum):
    """What to do with the cache."""

    info = "info"
    clear = "clear"


def cache_command(
    action: Annotated[Action, typer.Argument(help="info or clear.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say where derived geometry is kept and how much there is, or remove it; $NONRIGID_CACHE moves it."""
    cache = default_cache()
    before = cache.info()
    if action is Action.clear:
        cache.clear()
    after = cache.info()
    if json:
        removed = before.entries - after.entries
        show_json({"root": str(after.root), "entries": after.entries, "bytes": after.size, "removed": removed})
    elif action is Action.clear:
        say(f"{before.entries - after.entries} results removed from {after.root}")
    else:
        say(f"{after.entries} results, {after.size / 1e6:.1f} MB, in {after.root}")
