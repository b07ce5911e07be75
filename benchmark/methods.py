"""Find the formulations by name, and make one from settings written as text."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib.metadata import entry_points
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from nonrigid import formulations
from nonrigid.benchmark.predictions import Predictions
from nonrigid.formulations.formulation import Formulation
from nonrigid.geometry.errors import InputError, UnknownNameError

ENTRY_POINTS = "nonrigid.formulations"


@cache
def methods() -> dict[str, type]:
    """Return the formulations by their `method` word: built in, or entry points of `nonrigid.formulations`.

    Examples
    --------
    >>> methods()["gt"].__name__
    'GameTheoretic'
    """
    found: dict[str, type] = {}
    for module in pkgutil.iter_modules(formulations.__path__):
        if module.ispkg:
            continue
        loaded = importlib.import_module(f"{formulations.__name__}.{module.name}")
        for kind in vars(loaded).values():
            # A protocol or a class imported from another module carries no method of its own.
            if inspect.isclass(kind) and kind.__module__ == loaded.__name__ and isinstance(_word(kind), str):
                found[_word(kind)] = kind
    for entry in entry_points(group=ENTRY_POINTS):
        found[entry.name] = entry.load()
    return dict(sorted(found.items()))


def make_method(name: str, settings: Mapping[str, object] | None = None) -> Formulation:
    """Return the formulation of that name with these settings; text is read as the type of the field.

    Besides those of `methods`, `predictions` reads what another program wrote.

    Raises
    ------
    UnknownNameError
        If there is no such method or setting; the message names those that exist.
    InputError
        If a value does not fit the field.

    Examples
    --------
    >>> make_method("gt", {"kernel_width": "0.02"}).kernel_width
    0.02
    """
    known = {**methods(), Predictions.method: Predictions}
    if name not in known:
        raise UnknownNameError("method", name, known)
    kind = known[name]
    made: Formulation = kind(**typed_settings(kind, settings or {}, owner=name))
    return made


def typed_settings(kind: type, settings: Mapping[str, object], *, owner: str | None = None) -> dict[str, Any]:
    """Return settings of a dataclass, each value read as the type of its field.

    Parameters
    ----------
    owner
        How messages call the dataclass; its name by default.

    Raises
    ------
    UnknownNameError
        If the dataclass has no such field.
    InputError
        If a value does not fit the field.

    Examples
    --------
    >>> typed_settings(methods()["gt"], {"kernel_width": "0.02"})
    {'kernel_width': 0.02}
    """
    types = get_type_hints(kind)
    known = [field.name for field in fields(kind) if field.init]
    chosen = {}
    for key, value in settings.items():
        if key not in known:
            raise UnknownNameError(f"setting of {owner or kind.__name__}", key, known)
        chosen[key] = _typed(f"{owner or kind.__name__}.{key}", value, types[key])
    return chosen


def parse_settings(words: Sequence[str]) -> dict[str, str]:
    """Split words such as `kernel_width=0.03`; raise `InputError` where there is no equals sign."""
    pairs = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not (key.strip() and equals):
            raise InputError(f"--set {word!r} is not name=value", remedy="write for example --set kernel_width=0.03")
        pairs[key.strip()] = value.strip()
    return pairs


def _word(kind: type) -> Any:
    return vars(kind).get("method")


def _typed(place: str, value: object, kind: Any) -> object:
    """Read a value, of text or of a plan file, as the type that a field is annotated with."""
    origin, members = get_origin(kind), get_args(kind)
    if origin is Literal:
        for member in members:
            if str(value) == str(member):
                return member
        raise UnknownNameError(f"value of {place}", str(value), members)
    if origin in (Union, UnionType):
        if value is None or (isinstance(value, str) and value.lower() == "none" and NoneType in members):
            return None
        return _typed(place, value, next(member for member in members if member is not NoneType))
    if origin is tuple:
        parts = value.replace(",", " ").split() if isinstance(value, str) else value
        if not isinstance(parts, list | tuple):
            raise InputError(f"{place} is {value!r}", remedy="give several numbers, such as 0.04,0.1")
        kinds = [members[0]] * len(parts) if members[-1] is Ellipsis else list(members)
        if len(kinds) != len(parts):
            raise InputError(f"{place} has {len(parts)} values", remedy=f"give {len(kinds)}")
        return tuple(_typed(place, part, inner) for part, inner in zip(parts, kinds, strict=True))
    return _scalar(place, value, kind)


def _scalar(place: str, value: object, kind: Any) -> object:
    if kind is bool:
        words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        if isinstance(value, bool) or str(value).lower() in words:
            return value if isinstance(value, bool) else words[str(value).lower()]
        raise InputError(f"{place} is {value!r}", remedy="write true or false")
    if kind in (int, float):
        try:
            if isinstance(value, bool) or (kind is int and isinstance(value, float) and value != int(value)):
                raise ValueError
            return kind(value)
        except (TypeError, ValueError, OverflowError):
            remedy = "give a whole number" if kind is int else "give a number"
            raise InputError(f"{place} is {value!r}", remedy=remedy) from None
    if kind is str and isinstance(value, str):
        return value
    raise InputError(f"{place} cannot be read from {value!r}", remedy="set it in Python")
