"""Keep a forest in one file, and find the forest for a surface among several."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from nonrigid.formulations.forest.forest import Forest
from nonrigid.formulations.forest.heat_tests import HeatTests
from nonrigid.formulations.forest.template import Template
from nonrigid.formulations.forest.tree import Tree
from nonrigid.geometry.errors import InputError

FORMAT = "nonrigid forest"
VERSION = 1
"""Version of the files: raise it whenever their content changes."""

SUFFIX = ".forest"

_RETRAIN = "train it again with `nonrigid train rf`"


def save_forest(forest: Forest, path: Path | str) -> None:
    """Write a forest to a file, whole or not at all; the arrays are compressed, nothing in it is executable.

    Raises
    ------
    InputError
        If the suffix is not `.forest`, or the folder does not exist.
    """
    place = Path(path)
    if place.suffix != SUFFIX or not place.parent.is_dir():
        wrong = f"the suffix {place.suffix!r}" if place.suffix != SUFFIX else f"the folder {place.parent} is missing"
        raise InputError(wrong, file=place, remedy=f"name a {SUFFIX} file in a folder that exists")
    handle, temporary = tempfile.mkstemp(dir=place.parent, prefix=place.stem, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, **_arrays(forest))
        Path(temporary).replace(place)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def load_forest(path: Path | str) -> Forest:
    """Read a forest.

    Raises
    ------
    InputError
        If there is no such file, it is damaged or no forest, or another version of the package wrote it.
    """
    place = Path(path)
    header = read_header(place)
    return _forest(header, _read(place, None))


def read_header(path: Path | str) -> dict[str, Any]:
    """Return what a forest's file says of itself, without reading the trees: class_name, poses, parts and others.

    Raises `InputError` as `load_forest` does.
    """
    place = Path(path)
    text = str(_read(place, "header")["header"])
    try:
        header = json.loads(text)
    except json.JSONDecodeError:
        header = None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError("this is no forest", file=place, remedy=_RETRAIN)
    if header.get("version") != VERSION:
        problem = f"the forest has format version {header.get('version')}, this package reads version {VERSION}"
        raise InputError(problem, file=place, remedy=_RETRAIN)
    return header


def _read(place: Path, name: str | None) -> dict[str, Any]:
    """Return one array of the file, or all of them."""
    if not place.is_file():
        raise InputError("there is no such forest", file=place, remedy="train one with `nonrigid train rf`")
    try:
        with np.load(place, allow_pickle=False) as stored:
            return {key: stored[key] for key in (stored.files if name is None else [name])}
    except (OSError, ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"this is no forest, or a damaged one ({error})", file=place, remedy=_RETRAIN) from None


def forest_digest(path: Path | str) -> str:
    """Return a hash of a forest's file, 16 digits, so that a result can name the forest it came from."""
    place = Path(path)
    if not place.is_file():
        raise InputError("there is no such forest", file=place, remedy="train one with `nonrigid train rf`")
    return hashlib.sha256(place.read_bytes()).hexdigest()[:16]


def forest_files(path: Path | str) -> list[Path]:
    """Return the forests that a path names: itself, or all files in it if it is a folder."""
    place = Path(path)
    return sorted(place.glob(f"*{SUFFIX}")) if place.is_dir() else [place]


def _arrays(forest: Forest) -> dict[str, Any]:
    template = forest.template
    header = {
        "format": FORMAT,
        "version": VERSION,
        "name": template.name,
        "digest": template.digest,
        "trees": len(forest.trees),
        "eigenfunctions": forest.eigenfunctions,
        "class_name": forest.class_name,
        "poses": forest.poses,
        "parts": forest.parts,
        "training": forest.training,
    }
    arrays: dict[str, Any] = {
        "header": np.array(json.dumps(header)),
        "vertices": template.vertices,
        "labels": template.labels.astype(np.int32),
        "cell": template.cell.astype(np.int32),
    }
    for number, tree in enumerate(forest.trees):
        arrays |= {
            f"{number} cutoffs": tree.tests.cutoffs,
            f"{number} times": tree.tests.times,
            f"{number} test": tree.test.astype(np.int32),
            f"{number} threshold": tree.threshold,
            f"{number} left": tree.left.astype(np.int32),
            f"{number} right": tree.right.astype(np.int32),
            f"{number} votes": tree.votes.data,
            f"{number} columns": tree.votes.indices.astype(np.int32),
            f"{number} rows": tree.votes.indptr.astype(np.int64),
        }
    return arrays


def _forest(header: dict[str, Any], arrays: dict[str, Any]) -> Forest:
    template = Template(
        name=header["name"],
        digest=header["digest"],
        vertices=arrays["vertices"],
        labels=arrays["labels"].astype(np.int64),
        cell=arrays["cell"].astype(np.int64),
    )
    return Forest(
        template=template,
        trees=tuple(_tree(arrays, number, len(template.labels)) for number in range(header["trees"])),
        eigenfunctions=header["eigenfunctions"],
        class_name=header["class_name"],
        poses=tuple(header["poses"]),
        parts=tuple(header["parts"]),
        training=header["training"],
    )


def _tree(arrays: dict[str, Any], number: int, labels: int) -> Tree:
    def whole(name: str) -> Any:
        return arrays[f"{number} {name}"].astype(np.int64)

    votes = (arrays[f"{number} votes"], arrays[f"{number} columns"], arrays[f"{number} rows"])
    return Tree(
        tests=HeatTests(arrays[f"{number} cutoffs"], arrays[f"{number} times"]),
        test=whole("test"),
        threshold=arrays[f"{number} threshold"],
        left=whole("left"),
        right=whole("right"),
        votes=csr_array(votes, shape=(len(votes[2]) - 1, labels)),
    )
