"""Read a plan: which data, methods, backends and limits a benchmark combines."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from nonrigid.benchmark import datasets, plans
from nonrigid.benchmark.accuracy import with_accuracy
from nonrigid.benchmark.choices import parse_backend
from nonrigid.benchmark.datasets.protocols import Dataset, PairSpec
from nonrigid.benchmark.methods import make_method, typed_settings
from nonrigid.benchmark.vertex_pairs import check_metric
from nonrigid.formulations.formulation import Formulation
from nonrigid.geometry.errors import InputError, NonrigidError, UnknownNameError
from nonrigid.solvers.confine import can_limit_memory
from nonrigid.solvers.limits import Limits

_KEYS = (
    *("title", "backends", "starts", "seed", "motion_seed", "metric", "data", "methods"),
    *("limits", "run_seconds", "accuracy"),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Entry:
    """Hold a method of a plan under the label that stands in tables."""

    label: str
    method: str
    formulation: Formulation


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Hold what a benchmark combines: every pair with every method, every backend and every accuracy.

    Parameters
    ----------
    data_word
        Name of the data set's module, such as "shrec16".
    names, splits
        Keep these pairs only; all where empty.
    backends
        Words as `parse_backend` reads them.
    starts, seed, limits
        As in `nonrigid.solvers.match.match`, for every solve.
    accuracy
        Words of `nonrigid.benchmark.accuracy.PRESETS`, each of which sets the tolerances of `limits` for a run of its
        own; where empty, those of `limits` hold.
    run_seconds
        Wall-clock time after which a whole run is killed, whatever it is doing; None for no bound.
    motion_seed
        Seed of the rigid motion of each part before it is matched; None leaves parts where their files have them.
    metric
        Geodesics of the scores.
    text
        The plan file, kept with the results.
    """

    title: str
    data_word: str
    dataset: Dataset
    methods: tuple[Entry, ...]
    backends: tuple[str, ...]
    names: tuple[str, ...] = ()
    splits: tuple[str, ...] = ()
    starts: int = 1
    seed: int = 0
    limits: Limits = field(default_factory=Limits)
    accuracy: tuple[str, ...] = ()
    run_seconds: float | None = 3600.0
    motion_seed: int | None = 0
    metric: str = "dijkstra"
    text: str = ""

    def pairs(self) -> list[PairSpec]:
        """Return the chosen pairs in the data set's order; raise `UnknownNameError` for a name it does not have."""
        found = {spec.name: spec for spec in self.dataset.pairs()}
        for name in self.names:
            if name not in found:
                raise UnknownNameError("pair", name, found)
        for split in self.splits:
            if split not in {spec.split for spec in found.values()}:
                raise UnknownNameError("split", split, {spec.split for spec in found.values()})
        return [
            spec
            for spec in found.values()
            if (not self.names or spec.name in self.names) and (not self.splits or spec.split in self.splits)
        ]

    def variants(self) -> list[tuple[str, Limits]]:
        """Return the limits of each accuracy under the word that tells it apart in labels, empty where there is one."""
        if not self.accuracy:
            return [("", self.limits)]
        several = len(self.accuracy) > 1
        return [(word if several else "", with_accuracy(self.limits, word)) for word in self.accuracy]


def read_plan(path: Path | str, *, data: Path | None = None, templates: Path | None = None) -> Plan:
    """Read a plan from a TOML file, or the one of that name that ships with the package.

    Parameters
    ----------
    path
        A file, or the name of one that ships with the package, such as "demo".
    data
        Folder of the data set's files; else the plan's `root`, else `$NONRIGID_DATA`, else `../shared/data`.
    templates
        Folder or archive of the full shapes, for a plan that names one; else the plan's, taken from the plan's folder.

    Raises
    ------
    InputError
        Naming the file, the key and the remedy.

    Examples
    --------
    >>> read_plan("demo").data_word
    'creatures'
    """
    place = Path(path)
    if not place.is_file():
        shipped = Path(plans.__path__[0], f"{path}.toml")
        if not shipped.is_file():
            known = ", ".join(sorted(found.stem for found in shipped.parent.glob("*.toml")))
            raise InputError("there is no such plan", file=place, remedy=f"give a TOML file, or one of {known}")
        place = shipped
    try:
        text = place.read_text(encoding="utf-8")
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"is not TOML: {error}", file=place, remedy="mend the file at that place") from None
    try:
        return _plan(table, place, text, data, templates)
    except InputError as error:
        raise error.at(place) from None
    except NonrigidError as error:
        raise InputError(str(error), file=place) from None


def dataset_class(word: str) -> Any:
    """Return the data set that the module of this name offers: the dataclass in it with `pairs`.

    Raises `UnknownNameError` naming those that exist.
    """
    known = {}
    for module in pkgutil.iter_modules(datasets.__path__):
        loaded = importlib.import_module(f"{datasets.__name__}.{module.name}")
        for kind in vars(loaded).values():
            own = inspect.isclass(kind) and kind.__module__ == loaded.__name__ and not kind.__name__.startswith("_")
            if own and hasattr(kind, "__dataclass_fields__") and hasattr(kind, "pairs"):
                known[module.name] = kind
    if word not in known:
        raise UnknownNameError("data set", word, known)
    return known[word]


def _plan(table: Mapping[str, Any], place: Path, text: str, data: Path | None, templates: Path | None) -> Plan:
    _only(table, _KEYS, "the plan")
    chosen = dict(_get(table, "data", dict))
    word = _get(chosen, "dataset", str, where="[data]")
    names = tuple(_strings(chosen.pop("names", []), "[data] names"))
    splits = tuple(_strings(chosen.pop("splits", []), "[data] splits"))
    chosen.pop("dataset")
    entries = _methods(_get(table, "methods", list))
    backends = tuple(_strings(_get(table, "backends", list), "backends"))
    if not backends or len(set(backends)) < len(backends):
        raise InputError(f"backends has {len(backends)} entries, perhaps twice the same", remedy="name each once")
    for backend in backends:
        parse_backend(backend)
    metric = str(table.get("metric", "dijkstra"))
    check_metric(metric)
    starts = _whole(table, "starts", 1)
    if starts < 1:
        raise InputError(f"starts is {starts}", remedy="ask for at least one start")
    motion = table.get("motion_seed", 0)
    limits, accuracy = _limits(table.get("limits", {})), _accuracy(table)
    return Plan(
        title=str(table.get("title", place.stem)),
        data_word=word,
        dataset=_dataset(word, chosen, splits, place, data, templates),
        names=names,
        splits=splits,
        methods=entries,
        backends=backends,
        starts=starts,
        seed=_seed(table, "seed"),
        motion_seed=None if motion is False else _seed(table, "motion_seed"),
        metric=metric,
        limits=limits,
        accuracy=accuracy,
        run_seconds=_run_seconds(table.get("run_seconds", 3600.0)),
        text=text,
    )


def _dataset(
    word: str,
    settings: dict[str, Any],
    splits: tuple[str, ...],
    place: Path,
    data: Path | None,
    templates: Path | None,
) -> Dataset:
    kind = dataset_class(word)
    known = {item.name for item in fields(kind)}
    _only(settings, sorted(known - {"names", "splits"}), f"[data] of {word}")
    if "root" in known:
        root = data or _root(settings.get("root"), place)
        settings["root"] = root.absolute()  # processes that live in another working directory read it too
    elif data is not None:
        raise InputError(f"the data set {word} reads no files", remedy="leave out --data")
    if "templates" in known and "templates" in settings:
        settings["templates"] = (templates or place.parent / str(settings["templates"])).absolute()
    if splits and "splits" in known:
        settings["splits"] = splits
    plain = {name: value for name, value in settings.items() if name not in ("root", "templates", "splits")}
    settings |= typed_settings(kind, plain, owner=f"[data] of {word}")
    try:
        made: Dataset = kind(**settings)
    except TypeError as error:
        raise InputError(f"[data] of {word}: {error}", remedy=f"the settings are {sorted(known)}") from None
    return made


def _root(given: object, place: Path) -> Path:
    if given is not None:
        return place.parent / str(given)
    return Path(os.environ.get("NONRIGID_DATA", Path("..", "shared", "data")))


def _methods(tables: Sequence[object]) -> tuple[Entry, ...]:
    entries = []
    for number, table in enumerate(tables, start=1):
        where = f"[[methods]] number {number}"
        if not isinstance(table, dict):
            raise InputError(f"{where} is {table!r}", remedy='write [[methods]] and under it method = "gt"')
        _only(table, ("method", "label", "settings"), where)
        word = _get(table, "method", str, where=where)
        settings = table.get("settings", {})
        if not isinstance(settings, dict):
            raise InputError(f"settings of {where} is {settings!r}", remedy="write settings = { name = value }")
        label = str(table.get("label", word))
        entries.append(Entry(label=label, method=word, formulation=make_method(word, settings)))
    labels = [entry.label for entry in entries]
    if not labels or len(set(labels)) < len(labels):
        raise InputError(f"the methods are {labels}", remedy="name at least one, and give each its own label")
    return tuple(entries)


def _limits(table: object) -> Limits:
    if not isinstance(table, dict):
        raise InputError(f"limits is {table!r}", remedy="write [limits] and under it seconds = 60")
    _only(table, [item.name for item in fields(Limits)], "[limits]")
    for key, value in table.items():
        if key == "verbose":
            if not isinstance(value, bool):
                raise InputError(f"[limits] verbose is {value!r}", remedy="write true or false")
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"[limits] {key} is {value!r}", remedy="give a number")
    limits = Limits(**table)
    if limits.memory_gb is not None and not can_limit_memory():
        raise InputError("this system cannot limit memory", remedy="leave [limits] memory_gb out, or run on Linux")
    return limits


def _accuracy(table: Mapping[str, Any]) -> tuple[str, ...]:
    given = table.get("accuracy", [])
    words = tuple(_strings([given] if isinstance(given, str) else given, "accuracy"))
    if len(set(words)) < len(words):
        raise InputError(f"accuracy is {list(words)}", remedy="name each once")
    for word in words:
        with_accuracy(Limits(), word)
    stated = sorted({"tolerance", "feasibility"} & set(table.get("limits", {})))
    if words and stated:
        raise InputError(
            f"both accuracy = {list(words)} and [limits] {stated[0]} are given",
            remedy="leave one of them out: an accuracy sets both tolerances",
        )
    return words


def _run_seconds(given: object) -> float | None:
    if given is False:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float) or not given > 0:
        raise InputError(f"run_seconds is {given!r}", remedy="give a positive number of seconds, or false for no bound")
    return float(given)


def _only(table: Mapping[str, object], known: Sequence[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise UnknownNameError(f"key of {where}", key, known)


def _get(table: Mapping[str, Any], key: str, kind: type, where: str = "the plan") -> Any:
    word = {"dict": "a table", "list": "a list", "str": "a text"}[kind.__name__]
    if key not in table:
        raise InputError(f"{where} has no {key}", remedy=f"add {key}, {word}")
    if not isinstance(table[key], kind):
        raise InputError(f"{key} of {where} is {table[key]!r}", remedy=f"make it {word}")
    return table[key]


def _whole(table: Mapping[str, object], key: str, default: int) -> int:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{key} is {value!r}", remedy="give a whole number")
    return value


def _seed(table: Mapping[str, object], key: str) -> int:
    value = _whole(table, key, 0)
    if value < 0:
        raise InputError(f"{key} is {value}", remedy="give a number of at least 0")
    return value


def _strings(values: object, where: str) -> list[str]:
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise InputError(f"{where} is {values!r}", remedy='give a list of texts, such as ["native"]')
    return values
