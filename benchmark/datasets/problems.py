"""Hold matching problems as files, and what is wrong with them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from nonrigid.benchmark.datasets.files import FileSource, Tree
from nonrigid.geometry.errors import InputError

MESH_SUFFIXES = (".off", ".ply", ".obj", ".vert", ".mat")
"""Where a shape is there in several forms, the first of these is read."""

Folder: TypeAlias = Mapping[str, Mapping[str, FileSource]]
"""Files of one folder: by name up to the first dot, then by suffix (all that follows the name)."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Hold the files of one matching problem as a layout found them.

    Parameters
    ----------
    name, split, class_name, number
        As the files are named; `number` is that of the part in its class.
    archive
        Name of the folder or zip that holds the set: the same file name means different shapes in another set.
    layout
        The word of the layout.
    part, full, truth, mirrored
        Files; None for a file that is missing, or that this layout never has.
    numbering
        How the truth is to be read: "rows" (one row a vertex of the part), "common" (rows of `truth` and of `other`
        correspond), or "same" (vertices of the same number do).
    other
        The full shape's rows where the numbering is "common".
    """

    name: str
    split: str
    class_name: str
    number: int
    archive: str
    layout: str
    part: FileSource | None
    full: FileSource | None
    truth: FileSource | None = None
    mirrored: FileSource | None = None
    numbering: str = "rows"
    other: FileSource | None = None


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Say what is wrong with one file of a set, and what to do."""

    place: str
    problem: str
    remedy: str
    pair: str | None = None
    row: int | None = None

    def error(self) -> InputError:
        """Return the fault as an error to raise."""
        return InputError(self.problem, file=self.place, row=self.row, remedy=self.remedy)


@dataclass(kw_only=True)
class Survey:
    """Collect what the layouts find under one root; `templates` are the full shapes of each archive, by class."""

    problems: list[Problem] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    templates: dict[str, dict[str, FileSource]] = field(default_factory=dict)
    poses: dict[str, FileSource] = field(default_factory=dict)


def keep_complete(
    problems: list[Problem], found: Survey, tree: Tree, place: str, has_templates: bool, *, always: bool = False
) -> None:
    """Keep the problems whose files are there; the others become faults. Only a whole split may lack its truth."""
    for split in dict.fromkeys(problem.split for problem in problems):
        members = [problem for problem in problems if problem.split == split]
        required = {role: always or any(getattr(p, role) for p in members) for role in ("truth", "mirrored")}
        required["mirrored"] = required["mirrored"] and not always
        required["truth"] = required["truth"] or required["mirrored"]
        for problem in members:
            lost = [role for role in ("part", "full") if getattr(problem, role) is None]
            lost += [role for role, needed in required.items() if needed and getattr(problem, role) is None]
            found.faults += [_loss(tree, place, problem, role, has_templates) for role in lost]
            found.problems.append(problem)


def _loss(tree: Tree, place: str, problem: Problem, role: str, has_templates: bool) -> Fault:
    where = str(tree.place_of(_expected(place, problem, role)))
    if role == "full" and not has_templates:
        return Fault(
            pair=problem.name,
            place=where,
            problem="the full shapes are in no folder `null` of this set",
            remedy="give `templates`, the training set that holds them, since test sets come without",
        )
    said = {
        "part": ("the mesh of this shape is missing, other files of it are there", "add the mesh or remove the rest"),
        "full": (f"there is no full shape of the class {problem.class_name!r}", "add it to the full shapes"),
        "truth": ("the ground truth is missing, that of others is there", "add it, or remove that of all: a test set"),
        "mirrored": ("the mirrored ground truth is missing, that of others is there", "add it, or remove that of all"),
    }[role]
    return Fault(pair=problem.name, place=where, problem=said[0], remedy=said[1])


def _expected(place: str, problem: Problem, role: str) -> str:
    """Return where a file of a problem would lie, by the customs of its layout; `place` is the folder of its part."""
    home = place.rpartition("/")[0]
    if problem.layout == "shrec16":
        stem = f"{place}/{problem.name}"
        full = f"{home}/null/{problem.class_name}.off"
        found = {"full": full, "truth": f"{stem}.baryc_gt", "mirrored": f"{stem}.baryc_gt_sym"}
    elif problem.layout == "repacked":
        base = home.rpartition("/")[0]
        found = {
            "full": f"{base}/null/off/{problem.class_name}.off",
            "mirrored": f"{home}/corres_sym/{problem.name}.vts",
        }
    else:
        found = {}
    other = {"part": f"{place}/{problem.name}.off", "full": place, "truth": f"{home}/corres/{problem.name}.vts"}
    return (other | found)[role].lstrip("/")


def folders_of(tree: Tree) -> dict[str, dict[str, dict[str, FileSource]]]:
    """Sort the files of a tree into folders."""
    found: dict[str, dict[str, dict[str, FileSource]]] = defaultdict(lambda: defaultdict(dict))
    for name, source in tree.files.items():
        place, _, file = name.rpartition("/")
        stem, dot, suffix = file.partition(".")
        found[place][stem][(dot + suffix).lower()] = source
    return found


def meshes_of(folder: Folder) -> dict[str, FileSource]:
    """Return the meshes of a folder by name, sorted."""
    found = {stem: mesh_of(files) for stem, files in folder.items()}
    return {stem: source for stem, source in sorted(found.items()) if source is not None}


def mesh_of(files: Mapping[str, FileSource]) -> FileSource | None:
    """Return the mesh among the files of one name; None where there is none."""
    return first_of(files, MESH_SUFFIXES)


def first_of(files: Mapping[str, FileSource], suffixes: tuple[str, ...]) -> FileSource | None:
    """Return the file with the first of these suffixes that is there; None where there is none."""
    return next((files[suffix] for suffix in suffixes if suffix in files), None)
