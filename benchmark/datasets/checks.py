"""Look for what is wrong with a data set in files, and for what leaks in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.archive import Archive
from nonrigid.benchmark.datasets.copies import Signature, find_copies, in_own_pose, signature
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.formulations.formulation import LARGEST_PART, SMALLEST_PART
from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.points import SurfacePoints

STRETCH = 4.0
"""An edge of the part counts as torn where the truth makes it this many times as long."""

TORN_SHARE = 0.05
"""Ground truth that tears a larger share of the edges is refused."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Say what a check found: a "fault" that must be mended, or a "leak" or "note" that a reader of results must know.

    Parameters
    ----------
    kind
        "fault", "leak" or "note".
    place
        The file, archive or pair.
    row
        The 1-based row in it, where there is one.
    """

    kind: str
    place: str
    problem: str
    remedy: str = ""
    row: int | None = None


def check_archive(
    archive: Archive, *, against: Archive | None = None, progress: Callable[[str], None] | None = None
) -> list[Finding]:
    """Read every file of a data set and return what is wrong with it; nothing is passed over because of another fault.

    Faults: files that a pair lacks; files that cannot be read, with their row; meshes that cannot be repaired; parts
    larger than the full shape, or hardly there; ground truth that tears the surface, as that of another shape does, or
    one whose triangles are numbered from 0. Leaks: parts in the full shape's own pose and frame; shapes that are there
    twice, or also in `against`.

    Parameters
    ----------
    against
        Another set, such as the training set where `archive` is the test set.
    progress
        Called with the name of each pair before it is read.
    """
    try:
        found = archive.survey()
        listed = archive.complete_pairs(found)
    except InputError as error:
        return [_from_error("fault", str(archive.root), error)]
    findings = [
        Finding(kind="fault", place=fault.place, problem=fault.problem, remedy=fault.remedy, row=fault.row)
        for fault in found.faults
    ]
    signatures: list[tuple[str, Signature]] = []
    seen: set[str] = set()
    for spec in listed:
        if progress is not None:
            progress(spec.name)
        try:
            data = spec.load()
        except InputError as error:
            findings.append(_from_error("fault", spec.name, error))
            continue
        signatures.append((f"{spec.metadata['archive']}/{spec.metadata['stem']}", signature(data.part)))
        findings += check_pair(data, with_full=data.full.source not in seen)
        seen.add(data.full.source)
    findings += [_copy(*both) for both in find_copies(signatures)]
    if against is not None:
        theirs = _signatures(against)
        findings += [_copy(*both) for both in find_copies(signatures, theirs)]
    return findings


def check_pair(data: PairData, *, with_full: bool = True) -> list[Finding]:
    """Return what is wrong with one pair that could be read; see `check_archive`.

    `with_full=False` leaves out the full shape, where it has been checked with another pair.
    """
    findings = []
    place = data.part.source
    for mesh in (data.part, data.full)[: 2 if with_full else 1]:
        try:
            clean(mesh)
        except InputError as error:
            findings.append(_from_error("fault", mesh.source, error))
    if not SMALLEST_PART <= data.kept_area <= LARGEST_PART and data.metadata.get("split") != "full":
        findings.append(
            Finding(
                kind="fault",
                place=place,
                problem=f"the part has {data.kept_area:.3g} times the area of the full shape",
                remedy="use one unit of length, and the full shape of its class",
            )
        )
    for role, points in (("ground truth", data.truth), ("mirrored ground truth", data.mirrored)):
        if points is not None:
            findings += _check_truth(data, role, points)
    if in_own_pose(data.part, data.full):
        findings.append(
            Finding(
                kind="leak",
                place=place,
                problem="the part lies in the full shape's own pose and frame: the nearest point in space solves it",
                remedy="keep the random rigid motion that plans give to every part (motion_seed)",
            )
        )
    return findings


def torn_share(data: PairData, points: SurfacePoints) -> float:
    """Return the share of the part's edges that are more than `STRETCH` times as long between their mapped ends.

    Measured on the real parts at hand: at most 0.004 for their truth, 0.015 for the nearest vertices of it, at least
    0.12 with triangles counted from 0, and 0.9 for the truth of another shape.
    """
    i, j = data.part.edges.T
    known = points.matched[i] & points.matched[j]
    if not known.any():
        return 0.0
    place = points.positions(data.full)
    i, j = i[known], j[known]
    length = np.linalg.norm(data.part.vertices[i] - data.part.vertices[j], axis=1)
    return float((np.linalg.norm(place[i] - place[j], axis=1) > STRETCH * length).mean())


def _check_truth(data: PairData, role: str, points: SurfacePoints) -> Iterator[Finding]:
    share = torn_share(data, points)
    if share <= TORN_SHARE:
        return
    count = len(data.full.faces)
    # Numbers that all lie in range may still count from 0: then the next triangles make a map that does not tear.
    shifted = SurfacePoints(np.where(points.matched, (points.faces + 1) % count, -1), points.barycentric)
    zero = torn_share(data, shifted) <= TORN_SHARE
    yield Finding(
        kind="fault",
        place=data.part.source,
        problem=f"the {role} tears {share:.0%} of the edges"
        + (": its triangles are counted from 0" if zero else ", as that of another shape does"),
        remedy="add 1 to every triangle" if zero else "use the files of this part; training and test sets number alike",
    )


def _signatures(archive: Archive) -> list[tuple[str, Signature]]:
    return [
        (f"{spec.metadata['archive']}/{spec.metadata['stem']}", signature(spec.load_part())) for spec in archive.pairs()
    ]


def _from_error(kind: str, place: str, error: InputError) -> Finding:
    return Finding(
        kind=kind, place=str(error.file or place), problem=error.problem, remedy=error.remedy or "", row=error.row
    )


def _copy(known: str, label: str) -> Finding:
    return Finding(
        kind="leak",
        place=label,
        problem=f"the same shape as {known}, up to a rigid motion and a jitter",
        remedy="do not learn from one and test on the other",
    )
