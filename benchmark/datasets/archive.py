"""Open any set of matching problems that lies in files: a folder or a zip archive, its layout found by itself."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nonrigid.benchmark.datasets.files import FileSource, bare_name, list_tree, load_mesh, local_file
from nonrigid.benchmark.datasets.folds import Fold, select_fold
from nonrigid.benchmark.datasets.layouts import survey, template_folder
from nonrigid.benchmark.datasets.problems import Problem, Survey
from nonrigid.benchmark.datasets.protocols import PairSpec, PointsSource
from nonrigid.benchmark.formats import read_vertices
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.points import SurfacePoints


@dataclass(frozen=True, kw_only=True)
class Archive:
    """List the pairs of a data set in files, in any of the layouts of `nonrigid.benchmark.datasets.layouts`.

    Archives are read where they lie, one file at a time. A set without ground truth, as the SHREC'16 test set, gives
    pairs without truth: they can be matched and submitted, not scored. Where several sets lie under one root, each
    pair's name begins with that of its set: training and test sets number their shapes alike, and are never merged.

    Parameters
    ----------
    root
        A folder or a zip archive; a folder may hold several sets, also as zip archives.
    templates
        Where the full shapes are if the set has none: the training set, or its folder `null`.
    splits
        Keep these, such as ("cuts",); all where empty.
    names
        Keep these pairs only; all of them where None.
    fold
        Such as "2/5": keep the pairs of this fold by source pose; "not 2/5" keeps those to learn from. All where empty.
        See `nonrigid.benchmark.datasets.folds`.

    Raises
    ------
    InputError
        If nothing is recognised, or a file that belongs to a listed pair is missing.
    UnknownNameError
        If a split or a pair is not there.
    """

    root: Path
    templates: Path | None = None
    splits: tuple[str, ...] = ()
    names: tuple[str, ...] | None = None
    fold: str = ""

    @property
    def name(self) -> str:
        """Name of the folder or archive, of the chosen splits and of the fold."""
        fold = [f"fold {Fold.parse(self.fold)} by source pose"] if self.fold else []
        return " ".join([bare_name(Path(self.root)), *self.splits, *fold])

    def pairs(self) -> Sequence[PairSpec]:
        """List the pairs by set, split, class and number."""
        found = self.survey()
        named = _named(found)
        for split in self.splits:
            if split not in {problem.split for problem in found.problems}:
                raise UnknownNameError("split", split, {problem.split for problem in found.problems})
        for name in self.names or ():
            if name not in named:
                raise UnknownNameError("pair", name, named)
        chosen = {
            name: problem
            for name, problem in named.items()
            if (not self.splits or problem.split in self.splits) and (self.names is None or name in self.names)
        }
        wanted = {problem.name for problem in chosen.values()}
        for fault in found.faults:
            if fault.pair is None or fault.pair in wanted:
                raise fault.error()
        specs = _specs(found, {name: chosen[name] for name in self.names or chosen})
        return select_fold(specs, Fold.parse(self.fold)) if self.fold else specs

    def complete_pairs(self, found: Survey) -> Sequence[PairSpec]:
        """List the pairs of a survey that lack no file, whatever else is wrong with the set."""
        faulty = {fault.pair for fault in found.faults}
        return _specs(found, {name: problem for name, problem in _named(found).items() if problem.name not in faulty})

    def survey(self) -> Survey:
        """Find what there is, with every fault; raise `InputError` only if nothing is recognised."""
        tree = list_tree(self.root)
        given = None if self.templates is None else template_folder(list_tree(self.templates))
        found = survey(tree, templates=given)
        if not found.problems:
            raise InputError(
                f"{len(tree.files)} files, but no layout of matching problems",
                file=self.root,
                remedy="name the folder that holds null and cuts, off and corres, shapes and maps, or class0, class1",
            )
        return found


def open_dataset(root: Path | str, *, templates: Path | str | None = None) -> Archive:
    """Open a folder or zip archive of matching problems, whatever its layout.

    Parameters
    ----------
    root, templates
        See `Archive`.

    Raises
    ------
    InputError
        If there is nothing at `root`.

    Examples
    --------
    >>> open_dataset("nowhere").pairs()
    Traceback (most recent call last):
        ...
    nonrigid.geometry.errors.InputError: nowhere: there is no such folder or archive; check the path
    """
    return Archive(root=Path(root), templates=None if templates is None else Path(templates))


@dataclass(frozen=True)
class SameNumbers:
    """Make the ground truth of two meshes whose vertices of the same number correspond."""

    part: FileSource
    full: FileSource

    def __call__(self) -> SurfacePoints:
        """Return one point of the full shape a vertex of the part."""
        part, full = load_mesh(self.part), load_mesh(self.full)
        if len(part.vertices) != len(full.vertices):
            raise InputError(
                f"{len(part.vertices)} vertices, but {self.full} has {len(full.vertices)}: they are not numbered alike",
                file=self.part,
                remedy="keep poses of one triangulation in a class, or give ground truth",
            )
        return SurfacePoints.at_vertices(full, np.arange(len(part.vertices)))


@dataclass(frozen=True)
class CommonRows:
    """Make the ground truth of two meshes from two lists of vertices, of which the same rows correspond.

    Vertices of the part that are in no row have no truth. Where one is in several rows, the first counts.
    """

    part: FileSource
    full: FileSource
    rows: FileSource
    other: FileSource

    def __call__(self) -> SurfacePoints:
        """Return one point of the full shape a vertex of the part; unmatched where there is no truth."""
        part, full = load_mesh(self.part), load_mesh(self.full)
        with local_file(self.rows) as path:
            mine = read_vertices(path, part)
        with local_file(self.other) as path:
            theirs = read_vertices(path, full, expected_rows=len(mine))
        truth = np.full(len(part.vertices), -1, dtype=np.int64)
        truth[mine[::-1]] = theirs[::-1]
        return SurfacePoints.at_vertices(full, truth)


def _named(found: Survey) -> Mapping[str, Problem]:
    """Give every problem a name of its own: with that of its set where there are several sets."""
    several = len({problem.archive for problem in found.problems}) > 1
    names = [f"{problem.archive}-{problem.name}" if several else problem.name for problem in found.problems]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(
            f"two pairs have the name {twice[0]}",
            remedy="open one set at a time: training and test sets number alike and are not one set",
        )
    return dict(zip(names, found.problems, strict=True))


def _specs(found: Survey, chosen: Mapping[str, Problem]) -> list[PairSpec]:
    poses = {archive: _source_poses(source) for archive, source in found.poses.items()}
    return [_spec(name, problem, poses.get(problem.archive, {})) for name, problem in chosen.items()]


def _spec(name: str, problem: Problem, poses: Mapping[str, str]) -> PairSpec:
    assert problem.part is not None
    assert problem.full is not None
    truth: PointsSource | None = problem.truth
    if problem.numbering == "same":
        truth = SameNumbers(problem.part, problem.full)
    elif problem.numbering == "common":
        assert problem.truth is not None
        assert problem.other is not None
        truth = CommonRows(problem.part, problem.full, problem.truth, problem.other)
    pose = problem.name if problem.numbering != "rows" else poses.get(problem.name)
    # By custom pose 0 of a class is the one its full shape has.
    own = None if pose is None else pose == f"{problem.class_name}0"
    return PairSpec(
        name=name,
        split=problem.split,
        class_name=problem.class_name,
        part=problem.part,
        full=problem.full,
        truth=truth,
        mirrored=problem.mirrored,
        source_pose=pose,
        own_pose=own,
        metadata={"archive": problem.archive, "layout": problem.layout, "number": problem.number, "stem": problem.name},
    )


def _source_poses(source: FileSource) -> dict[str, str]:
    with local_file(source) as path, path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for number, row in enumerate(rows, start=2):
        if not row.get("shape") or not row.get("source_pose"):
            raise InputError(
                "shape or source_pose is empty",
                file=source,
                row=number,
                remedy="head the columns shape and source_pose",
            )
    return {row["shape"]: row["source_pose"] for row in rows}
