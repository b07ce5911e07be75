"""Read the SHREC'16 partial-matching data from the folders null/, cuts/ and holes/."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.errors import InputError, UnknownNameError

SPLITS = ("cuts", "holes")
_SHAPE = re.compile(r"(?P<split>cuts|holes)_(?P<class_name>.+)_shape_(?P<number>\d+)")


@dataclass(frozen=True, kw_only=True)
class Shrec16:
    """List the pairs of the SHREC'16 track "Partial Matching of Deformable Shapes".

    The folder holds `null/<class>.off` and, for each split, `<split>/<split>_<class>_shape_<n>` with the suffixes
    `.off`, `.baryc_gt` and `.baryc_gt_sym`. An optional table `source_poses.csv` (columns `shape`, `source_pose`) tells
    the TOSCA pose each part was cut from; pose 0 of a class is the full shape's own.

    Parameters
    ----------
    root
        That folder, or the one in which it is called `shrec16`.
    splits
        Any of "cuts" and "holes".
    names
        Keep these shapes only, such as "cuts_cat_shape_12"; all of them where None.

    Raises
    ------
    UnknownNameError
        If a split or a shape is not there.
    InputError
        If the folder, or a file that belongs to a listed pair, is missing.

    Source: Cosmo, Rodola, Bronstein, Torsello, Cremers, Sahillioglu, "SHREC'16: Partial Matching of Deformable Shapes",
    Eurographics Workshop on 3D Object Retrieval 2016.
    """

    root: Path
    splits: tuple[str, ...] = SPLITS
    names: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the data set and its splits."""
        return "shrec16 " + "+".join(self.splits)

    def pairs(self) -> Sequence[PairSpec]:
        """List the pairs by split, class and number, after checking that no file of a pair is missing."""
        for split in self.splits:
            if split not in SPLITS:
                raise UnknownNameError("split", split, SPLITS)
        root = self._folder()
        poses = _source_poses(root / "source_poses.csv")
        found = {spec.name: spec for split in self.splits for spec in _split_pairs(root, split, poses)}
        if self.names is None:
            chosen = list(found.values())
        else:
            for name in self.names:
                if name not in found:
                    raise UnknownNameError("shape", name, found)
            chosen = [found[name] for name in self.names]
        for spec in chosen:
            _check_files(spec)
        return chosen

    def _folder(self) -> Path:
        root = Path(self.root)
        for place in (root, root / "shrec16"):
            if (place / "null").is_dir():
                return place
        raise InputError(
            "neither this folder nor shrec16 in it holds a folder null",
            file=root,
            remedy="name the folder with null, cuts and holes",
        )


def _split_pairs(root: Path, split: str, poses: dict[str, str]) -> list[PairSpec]:
    folder = root / split
    if not folder.is_dir():
        raise InputError(f"there is no folder of the split {split!r}", file=folder, remedy="drop this split or add it")
    # A shape is listed when any of its files is there, so that a lost mesh is reported and not passed over.
    stems = {path.name.split(".")[0] for path in folder.iterdir()}
    matches = [match for match in map(_SHAPE.fullmatch, stems) if match and match["split"] == split]
    matches.sort(key=lambda match: (match["class_name"], int(match["number"])))
    return [
        PairSpec(
            name=match[0],
            split=split,
            class_name=match["class_name"],
            part=folder / f"{match[0]}.off",
            full=root / "null" / f"{match['class_name']}.off",
            truth=folder / f"{match[0]}.baryc_gt",
            mirrored=folder / f"{match[0]}.baryc_gt_sym",
            source_pose=poses.get(match[0]),
            own_pose=poses[match[0]] == match["class_name"] + "0" if match[0] in poses else None,
        )
        for match in matches
    ]


def _check_files(spec: PairSpec) -> None:
    files = (spec.part, spec.full, spec.truth, spec.mirrored)
    lost = [str(path) for path in files if isinstance(path, Path) and not path.is_file()]
    if lost:
        raise InputError(
            f"pair {spec.name} lacks {', '.join(lost)}", remedy="add what is missing or choose other names"
        )


def _source_poses(path: Path) -> dict[str, str]:
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for number, row in enumerate(rows, start=2):
        if not row.get("shape") or not row.get("source_pose"):
            raise InputError(
                "shape or source_pose is empty", file=path, row=number, remedy="head the columns shape and source_pose"
            )
    return {row["shape"]: row["source_pose"] for row in rows}
