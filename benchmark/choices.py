"""Read which backend solves which stage from one word."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from nonrigid.geometry.errors import InputError
from nonrigid.solvers.backend import make_backend
from nonrigid.solvers.limits import Limits

Chain: TypeAlias = str | tuple[str, ...]


def parse_backend(word: str) -> Chain | dict[str, Chain]:
    """Return the backend, chain of backends or mapping from stage to these that a word names.

    `nlopt:LD_CCSAQ` is a backend and its algorithm; `nlopt+native` a chain, tried in order until one answers;
    `game=nlopt,local=native` gives each stage its own.

    Raises
    ------
    UnknownNameError
        If a backend or algorithm does not exist.
    InputError
        If a part of the word is empty, or only some parts name a stage.

    Examples
    --------
    >>> parse_backend("nlopt:LD_CCSAQ"), parse_backend("game=nlopt+native,local=native")
    ('nlopt:LD_CCSAQ', {'game': ('nlopt', 'native'), 'local': 'native'})
    """
    parts = word.split(",")
    if "=" not in word:
        if len(parts) > 1:
            raise InputError(
                f"backend {word!r} has a comma but no stage", remedy="write stage=backend, or a+b for a chain"
            )
        return _chain(word)
    chosen: dict[str, Chain] = {}
    for part in parts:
        stage, equals, spec = (piece.strip() for piece in part.partition("="))
        if not (stage and equals):
            raise InputError(f"{part!r} in backend {word!r} names no stage", remedy="write stage=backend,stage=backend")
        chosen[stage] = _chain(spec)
    return chosen


def backend_words(choice: Chain | Mapping[str, Chain]) -> list[str]:
    """Return every backend that a choice names, such as "nlopt:LD_CCSAQ"."""
    if isinstance(choice, Mapping):
        return [word for chain in choice.values() for word in backend_words(chain)]
    return [choice] if isinstance(choice, str) else list(choice)


def guarded(limits: Limits, choice: Chain | Mapping[str, Chain]) -> Limits:
    """Return limits that hold even where a library does not look at the clock.

    Backends other than the native one then run in a child process, killed some time after the limit; a crash of a
    native library ends that solve alone.
    """
    if limits.seconds is None or limits.hard_seconds is not None:
        return limits
    if all(word.partition(":")[0] == "native" for word in backend_words(choice)):
        return limits
    return Limits(**{**vars(limits), "hard_seconds": 1.25 * limits.seconds + 5.0})


def _chain(word: str) -> Chain:
    specs = tuple(part.strip() for part in word.split("+"))
    if not all(specs):
        raise InputError(
            f"backend {word!r} is empty in places", remedy="write for example nlopt:LD_CCSAQ or nlopt+native"
        )
    for spec in specs:
        make_backend(spec)
    return specs[0] if len(specs) == 1 else specs
