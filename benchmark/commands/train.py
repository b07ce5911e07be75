"""`nonrigid train`: train a method that learns, without the poses it will be tested on."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from nonrigid.benchmark.datasets.folds import Fold, select_fold
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.held_out import example_of
from nonrigid.benchmark.methods import parse_settings, typed_settings
from nonrigid.benchmark.terminal import say, show_json, show_table
from nonrigid.formulations.forest.store import SUFFIX, save_forest
from nonrigid.formulations.forest.training import ForestSettings, train_forest
from nonrigid.geometry.errors import InputError, UnknownNameError


class Learner(StrEnum):
    """What is trained."""

    rf = "rf"


def train_command(
    learner: Annotated[Learner, typer.Argument(help="rf, the random forest.", show_default=False)],
    data: Annotated[Path, typer.Option(help="Folder of null, cuts and holes, with source_poses.csv.")],
    out: Annotated[
        Path, typer.Option(help="A .forest file for one forest; a folder for one a fold.", show_default=False)
    ],
    class_name: Annotated[
        list[str] | None, typer.Option("--class", help="A class, such as cat; may be repeated; all by default.")
    ] = None,
    folds: Annotated[
        int, typer.Option(help="Number of forests a class, each without the poses of its fold; 0 for one without any.")
    ] = 0,
    leave_out: Annotated[
        list[str] | None, typer.Option(help="A source pose to leave out, such as cat4; may be repeated.")
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A setting of the forest, as name=value; may be repeated.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the forest, and of the order in which poses become folds.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Train forests on the parts of a class, split by source pose and never by file.

    Every forest keeps the poses it was trained on; a benchmark refuses to test it on a part of one of them.
    """
    settings = ForestSettings(**typed_settings(ForestSettings, parse_settings(setting or [])))
    specs = list(Shrec16(root=data).pairs())
    classes = sorted({spec.class_name for spec in specs})
    for name in class_name or []:
        if name not in classes:
            raise UnknownNameError("class", name, classes)
    jobs = training_sets(specs, class_name or classes, folds=folds, leave_out=leave_out or [], seed=seed)
    single = out.suffix == SUFFIX
    if single and len(jobs) > 1:
        raise InputError(f"{len(jobs)} forests in one file", file=out, remedy="give a folder, or one --class alone")
    if not single:
        out.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for label, chosen in jobs.items():
        place = out if single else out / f"{label}{SUFFIX}"
        forest = train_forest(
            [example_of(spec) for spec in chosen], class_name=chosen[0].class_name, settings=settings, seed=seed
        )
        save_forest(forest, place)
        rows.append(
            {
                "forest": str(place),
                "class": forest.class_name,
                "parts": len(forest.parts),
                "poses": list(forest.poses),
                "labels": len(forest.template.labels),
                "megabytes": round(place.stat().st_size / 1e6, 1),
            }
        )
        if not json:
            say(f"{place}: {len(forest.parts)} parts of {len(forest.poses)} poses")
    if json:
        show_json(rows)
    else:
        show_table([{**row, "poses": " ".join(row["poses"])} for row in rows], title="forests")


def training_sets(
    specs: list[PairSpec], classes: list[str], *, folds: int, leave_out: list[str], seed: int
) -> dict[str, list[PairSpec]]:
    """Return the training pairs of each forest under its label: class, or class and fold.

    A fold in which the class has no pose needs no forest.

    Raises
    ------
    InputError
        If a pair's source pose is unknown, nothing is left to train on, or folds and poses are both left out.
    """
    if folds and leave_out:
        raise InputError(f"{folds} folds and {len(leave_out)} poses to leave out", remedy="give one of the two")
    if folds == 1 or folds < 0:
        raise InputError(f"{folds} folds", remedy="give 0, or at least 2")
    unknown = [spec.name for spec in specs if spec.class_name in classes and spec.source_pose is None]
    if unknown:
        raise InputError(
            f"the source pose of {len(unknown)} parts is unknown, such as {unknown[0]}",
            remedy="add source_poses.csv with the columns shape and source_pose beside the folder null",
        )
    poses = {str(spec.source_pose) for spec in specs if spec.class_name in classes}
    for pose in leave_out:
        if pose not in poses:
            raise UnknownNameError("source pose", pose, poses)
    jobs: dict[str, list[PairSpec]] = {}
    for name in classes:
        mine = [spec for spec in specs if spec.class_name == name]
        if not folds:
            jobs[name] = [spec for spec in mine if spec.source_pose not in leave_out]
        for number in range(1, folds + 1):
            tested = select_fold(specs, Fold(number=number, count=folds, seed=seed))
            held = {spec.source_pose for spec in tested if spec.class_name == name}
            if held:
                jobs[f"{name}_{number}_of_{folds}"] = [spec for spec in mine if spec.source_pose not in held]
    for label, chosen in jobs.items():
        if not chosen:
            raise InputError(f"no part is left to train {label} on", remedy="leave out fewer poses")
    return jobs
