"""Correspondences that another program wrote, one file a pair, as a method beside ours."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from nonrigid.benchmark.formats import read_truth
from nonrigid.formulations.formulation import Correspondence, Pair, Stages
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import InputError

SUFFIXES = (".corr", ".vts", ".map")
"""Forms of a prediction: a point, a vertex numbered from 1, or one numbered from 0 a row; see `read_truth`."""


@dataclass(frozen=True, kw_only=True)
class Predictions:
    """Take the correspondences that another program wrote; nothing is solved.

    Parameters
    ----------
    folder
        Holds a file a pair, named as the part's file: `<part>.corr`, `<part>.vts` or `<part>.map`, one row a vertex of
        the part.
    contents
        Hash of these files, so that a benchmark scores them again once they change; of nothing while there are none.

    `stages` raises `InputError` where the folder holds no file for the part, or two.

    Examples
    --------
    >>> Predictions(folder="theirs").folder
    'theirs'
    """

    folder: str = "predictions"
    contents: str = field(init=False)

    method: ClassVar[str] = "predictions"

    def __post_init__(self) -> None:
        told = [part for path in _files(Path(self.folder)) for part in (path.name, path.read_bytes())]
        object.__setattr__(self, "contents", content_hash(*told))

    def stages(self, pair: Pair) -> Stages:
        """State no problem; return what the part's file says."""
        part, full = pair.part.raw, pair.full.raw  # as in their files
        files = predicted(Path(self.folder))
        if part.name not in files:
            raise InputError(
                f"holds no prediction for {part.name}",
                file=self.folder,
                remedy=f"put {part.name}.corr, .vts or .map there",
            )
        points = read_truth(files[part.name], full, expected_rows=len(part.vertices))
        matched = np.flatnonzero(points.matched)
        return Correspondence(matched, points[matched], np.ones(len(matched)))
        yield  # a generator that states no problem


def predicted(folder: Path) -> dict[str, Path]:
    """Return the files of predictions in a folder by the name of their part.

    Raises
    ------
    InputError
        If there are none, or two for one part.
    """
    files: dict[str, Path] = {}
    for path in _files(folder):
        if path.stem in files:
            raise InputError(f"{files[path.stem].name} is there as well", file=path, remedy="keep one of them")
        files[path.stem] = path
    if not files:
        raise InputError("holds no predictions", file=folder, remedy="put <part>.corr, .vts or .map files there")
    return files


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES) if folder.is_dir() else []
