"""Write a data set as files, in the layout of the SHREC'16 archive."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol, TypeAlias

from joblib import Parallel, delayed

from nonrigid.benchmark.datasets.posed import PosedClass
from nonrigid.benchmark.datasets.protocols import Dataset, PairSpec
from nonrigid.benchmark.formats import write_baryc, write_text
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import write_off

_Row: TypeAlias = tuple[str, int, int, str]
_MADE_BY = "made_by.json"


class PosedDataset(Dataset, Protocol):
    """A data set whose parts are made of posed classes."""

    def classes(self) -> Sequence[PosedClass]:
        """Return the classes."""
        ...


def write_dataset(dataset: PosedDataset, folder: Path, *, jobs: int = 1) -> int:
    """Write templates, parts and ground truth, and return the number of parts.

    The folder gets `null/<class>.off`; `<split>/<name>` with `.off`, `.baryc_gt` and, where the mirrored map is known,
    `.baryc_gt_sym`; and `source_poses.csv`. Each file appears whole or not at all, the mesh of a part last: parts that
    are complete are passed over, so that an interrupted run can be taken up again. Equal data sets give equal bytes.

    Parameters
    ----------
    jobs
        Number of processes.

    Raises
    ------
    InputError
        If the folder holds something else, or another data set.
    """
    folder = Path(folder).absolute()  # helper processes may live in another working directory
    _claim(folder, dataset)
    specs = list(dataset.pairs())
    for name in ("null", *{spec.split for spec in specs}):
        (folder / name).mkdir(exist_ok=True)
    parallel = Parallel(n_jobs=jobs)
    parallel(delayed(_write_template)(posed, folder) for posed in dataset.classes())
    # Parts of one pose are made one after another, so that no two processes pose and remesh the same shape.
    specs.sort(key=lambda spec: str(spec.source_pose))
    groups = [list(group) for _, group in groupby(specs, key=lambda spec: spec.source_pose)]
    written = parallel(delayed(_write_parts)(group, folder) for group in groups)
    row_of = {row[0]: row for rows in written for row in rows}
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("shape", "vertices", "faces", "source_pose"))
    table.writerows(row_of[spec.name] for spec in dataset.pairs())
    write_text(folder / "source_poses.csv", text.getvalue())
    return len(specs)


def _claim(folder: Path, dataset: PosedDataset) -> None:
    """Take a new or empty folder, or one in which the same data set was begun."""
    if folder.exists() and not folder.is_dir():
        raise InputError("this is no folder", file=folder, remedy="name a new folder")
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / _MADE_BY
    says = json.dumps({"dataset": dataset.name, "classes": [posed.key for posed in dataset.classes()]}, indent=1) + "\n"
    if not mark.exists():
        if any(folder.iterdir()):
            raise InputError(
                "the folder is not empty, and not begun by this command", file=folder, remedy="name a new folder"
            )
        write_text(mark, says)
    elif mark.read_text(encoding="utf-8") != says:
        raise InputError("the folder holds another data set", file=mark, remedy=f"name a new folder for {dataset.name}")


def _write_template(posed: PosedClass, folder: Path) -> None:
    path = folder / "null" / f"{posed.name}.off"
    if not path.exists():
        _whole(path, lambda place: write_off(posed.template(), place))


def _write_parts(specs: Sequence[PairSpec], folder: Path) -> list[_Row]:
    return [_write_part(spec, folder / spec.split / f"{spec.name}.off") for spec in specs]


def _write_part(spec: PairSpec, path: Path) -> _Row:
    if not path.exists():
        pair = spec.load()
        assert pair.truth is not None
        write_baryc(path.with_suffix(".baryc_gt"), pair.truth)
        if pair.mirrored is not None:
            write_baryc(path.with_suffix(".baryc_gt_sym"), pair.mirrored)
        _whole(path, lambda place: write_off(pair.part, place))
    with path.open(encoding="ascii") as stream:
        stream.readline()
        vertices, faces, _ = (int(word) for word in stream.readline().split())
    return (spec.name, vertices, faces, str(spec.source_pose))


def _whole(path: Path, write: Callable[[Path], None]) -> None:
    with TemporaryDirectory(dir=path.parent, prefix=".") as folder:
        place = Path(folder) / path.name
        write(place)
        place.replace(path)
