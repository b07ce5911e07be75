"""Write a data set of parts in another layout, as a folder or a zip archive."""

from __future__ import annotations

import csv
import io
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

from nonrigid.benchmark.datasets.problems import MESH_SUFFIXES
from nonrigid.benchmark.datasets.protocols import Dataset, PairData, PairSpec
from nonrigid.benchmark.formats import write_baryc, write_map, write_text, write_vts
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.writers import write_mesh

LAYOUTS = ("maps", "repacked", "shrec16")
"""Layouts of parts that can be written; `vts` and `posed` number whole shapes alike, which parts are not."""

_STAMP = (1980, 1, 1, 0, 0, 0)


def convert(
    dataset: Dataset,
    out: Path | str,
    *,
    layout: str = "shrec16",
    mesh_suffix: str = ".off",
    progress: Callable[[str], None] | None = None,
) -> list[str]:
    """Write every pair of a data set in a layout, and return what the layout has no place for.

    Meshes and, in the layout `shrec16`, ground truth are written without loss. The layouts `repacked` and `maps` name a
    vertex of the full shape: they keep the nearest corner of each true point, and `maps` has no mirrored truth.

    Parameters
    ----------
    out
        A folder that does not exist or is empty, or a new `.zip` file; it appears only when it is complete.
    layout
        One of `LAYOUTS`, see `nonrigid.benchmark.datasets.layouts`.
    mesh_suffix
        Form of the meshes, see `nonrigid.geometry.writers.write_mesh`.

    Raises
    ------
    InputError
        If `out` is there already, a pair cannot be read, or its full shape is not that of others of its class.
    UnknownNameError
        If the layout or the suffix is not one of those that can be written.
    """
    out = Path(out)
    if layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    if mesh_suffix not in MESH_SUFFIXES:
        raise UnknownNameError("suffix", mesh_suffix, MESH_SUFFIXES)
    if out.exists() and (out.is_file() or any(out.iterdir())):
        raise InputError("there is something here already", file=out, remedy="name a new folder or zip file")
    if not out.resolve().parent.is_dir():
        raise InputError(f"the folder {out.parent} does not exist", file=out, remedy="create it first")
    specs = dataset.pairs()
    with tempfile.TemporaryDirectory(dir=out.resolve().parent, prefix=f".{out.name}.") as scratch:
        folder = Path(scratch, "data")
        folder.mkdir()
        lost = _write(specs, folder, layout, mesh_suffix, progress)
        if out.suffix.lower() == ".zip":
            pack(folder, Path(scratch, "data.zip"), inside=out.stem)
            Path(scratch, "data.zip").replace(out)
        else:
            if out.is_dir():
                out.rmdir()
            shutil.move(folder, out)
    return lost


def pack(folder: Path, path: Path, *, inside: str) -> None:
    """Pack a folder into a zip archive of which the bytes depend on the files alone, under the folder `inside`."""
    with zipfile.ZipFile(path, "w", compression=zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                entry = zipfile.ZipInfo(f"{inside}/{file.relative_to(folder).as_posix()}", date_time=_STAMP)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, file.read_bytes())


def official_name(spec: PairSpec, place: int) -> str:
    """Return `<split>_<class>_shape_<n>`: the file's own where it is so named, else made of what the pair says."""
    stem = str(spec.metadata.get("stem", spec.name))
    if stem.startswith(f"{spec.split}_{spec.class_name}_shape_"):
        return stem
    return f"{spec.split}_{spec.class_name}_shape_{spec.metadata.get('number', place)}"


def _write(
    specs: Sequence[PairSpec], folder: Path, layout: str, suffix: str, progress: Callable[[str], None] | None
) -> list[str]:
    fulls: dict[str, bytes] = {}
    written: set[str] = set()
    lost: set[str] = set()
    poses: list[tuple[str, str]] = []
    for place, spec in enumerate(specs, start=1):
        if progress is not None:
            progress(spec.name)
        name = official_name(spec, place)
        if name in written:
            raise InputError(
                f"two pairs would be called {name}", remedy="convert one set at a time: sets number their shapes alike"
            )
        written.add(name)
        data = spec.load()
        content = data.full.vertices.tobytes() + data.full.faces.tobytes()
        if fulls.setdefault(spec.class_name, content) != content:
            raise InputError(
                f"the class {spec.class_name} has two full shapes", file=data.full.source, remedy="convert them apart"
            )
        lost |= _write_pair(data, spec, name, folder, layout, suffix)
        if spec.source_pose is not None:
            poses.append((name, spec.source_pose))
    if poses and layout != "maps":
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([("shape", "source_pose"), *poses])
        write_text(folder / "source_poses.csv", text.getvalue())
    elif poses:
        lost.add("source poses")
    return sorted(lost)


def _write_pair(data: PairData, spec: PairSpec, name: str, folder: Path, layout: str, suffix: str) -> set[str]:
    """Write the files of one pair, and the full shape where it is not there yet; return what has no place."""
    if layout == "maps":
        full_name, part_name = f"{spec.split}-{spec.class_name}", f"{spec.split}-{spec.class_name}{_number(name)}"
        full, part, truth = folder / "shapes" / full_name, folder / "shapes" / part_name, folder / "maps"
    elif layout == "repacked":
        full, part = folder / "null" / "off" / spec.class_name, folder / spec.split / "off" / name
        truth = folder / spec.split / "corres"
    else:
        full, part, truth = folder / "null" / spec.class_name, folder / spec.split / name, folder / spec.split
    for place in (full.parent, part.parent, truth):
        place.mkdir(parents=True, exist_ok=True)
    if not full.with_name(full.name + suffix).exists():
        write_mesh(data.full, full.with_name(full.name + suffix))
    write_mesh(data.part, part.with_name(part.name + suffix))
    if layout == "maps":
        if data.truth is None:
            raise InputError(f"{name} has no ground truth, by which this layout names its pairs", remedy="use shrec16")
        write_map(truth / f"{part.name}_{full.name}.map", data.truth, data.full)
        return {"mirrored truth"} if data.mirrored is not None else set()
    if layout == "shrec16":
        if data.truth is not None:
            write_baryc(truth / f"{name}.baryc_gt", data.truth)
        if data.mirrored is not None:
            write_baryc(truth / f"{name}.baryc_gt_sym", data.mirrored)
        return set()
    _write_rows(data, data.truth, truth / f"{name}.vts")
    _write_rows(data, data.mirrored, folder / spec.split / "corres_sym" / f"{name}.vts")
    return set()


def _write_rows(data: PairData, points: SurfacePoints | None, path: Path) -> None:
    if points is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_vts(path, points, data.full)


def _number(name: str) -> str:
    return name.rpartition("_")[2]
