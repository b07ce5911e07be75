"""Count what a data set holds: full shapes, parts, area kept, boundaries and defects."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from nonrigid.benchmark.datasets.protocols import Dataset
from nonrigid.benchmark.datasets.statistics import part_statistics
from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh

Row = dict[str, object]


def mesh_facts(mesh: Mesh) -> Row:
    """Return counts of a mesh as stored, and what it takes to repair it.

    Non-manifold edges are those of more than two triangles; the Euler number is vertices - edges + faces; boundary
    loops are the pieces of the boundary, which meet in a vertex at most.

    Examples
    --------
    >>> facts = mesh_facts(Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]))
    >>> facts["boundary_edges"], facts["boundary_loops"], facts["euler"]
    (4, 1, 1)
    """
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    users = np.unique(sides, axis=0, return_counts=True)[1]
    try:
        repairs = "; ".join(clean(mesh).repairs)
    except InputError as error:
        repairs = error.problem
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "boundary_edges": len(mesh.boundary_edges),
        "boundary_loops": len(mesh.boundary_loops),
        "nonmanifold_edges": int((users > 2).sum()),
        "euler": len(mesh.vertices) - len(mesh.edges) + len(mesh.faces),
        "defects": repairs,
    }


def full_shape_rows(dataset: Dataset) -> list[Row]:
    """Return one row a full shape: its set, its class and `mesh_facts`."""
    rows: dict[tuple[str, str], Row] = {}
    for spec in dataset.pairs():
        key = (str(spec.metadata.get("archive", dataset.name)), spec.class_name)
        if key not in rows:
            rows[key] = {"set": key[0], "class": key[1], **mesh_facts(spec.load_full())}
    return [rows[key] for key in sorted(rows)]


def part_rows(dataset: Dataset, *, progress: Callable[[str], None] | None = None) -> list[Row]:
    """Return one row a part: set, split, class, source pose, `part_statistics` and `mesh_facts`."""
    rows = []
    for spec in dataset.pairs():
        if progress is not None:
            progress(spec.name)
        data = spec.load()
        rows.append(
            {
                "set": spec.metadata.get("archive", dataset.name),
                **part_statistics(data),
                "own_pose": spec.own_pose,
                "truth": data.truth is not None,
                "mirrored": data.mirrored is not None,
                **mesh_facts(data.part),
            }
        )
    return rows


def summary_rows(parts: Sequence[Mapping[str, object]]) -> list[Row]:
    """Return one row a split and class, and one a split, with ranges over its parts.

    `boundary_length` is a mean, in units of sqrt(area of the full shape); `edge_ratios` are the means of the 5th and
    95th percentiles of mapped by own length, over the edges of a part.
    """
    groups: dict[tuple[str, str, str], list[Mapping[str, object]]] = defaultdict(list)
    for row in parts:
        groups[str(row["set"]), str(row["split"]), str(row["class"])].append(row)
        groups[str(row["set"]), str(row["split"]), "all"].append(row)
    order = sorted(groups, key=lambda key: (key[0], key[1], key[2] == "all", key[2]))
    return [{"set": key[0], "split": key[1], "class": key[2], **_summary(groups[key])} for key in order]


def _summary(rows: Sequence[Mapping[str, object]]) -> Row:
    kept = [float(str(row["area_kept"])) for row in rows]
    truths = {(bool(row["truth"]), bool(row["mirrored"])) for row in rows}
    words = {(False, False): "none: a test set", (True, False): "direct", (True, True): "direct and mirrored"}
    return {
        "shapes": len(rows),
        "poses": len({row["source_pose"] for row in rows} - {None}) or None,
        "own_pose": sum(bool(row["own_pose"]) for row in rows),
        "vertices": _range(rows, "vertices"),
        "area_kept": f"{min(kept):.2f}-{max(kept):.2f}",
        "mean_area_kept": round(float(np.mean(kept)), 4),
        "boundary_loops": _range(rows, "boundary_loops"),
        "boundary_length": _mean(rows, "boundary_length"),
        "edge_ratios": "" if rows[0]["ratio_5"] is None else f"{_mean(rows, 'ratio_5')}-{_mean(rows, 'ratio_95')}",
        "nonmanifold_edges": sum(int(str(row["nonmanifold_edges"])) for row in rows),
        "with_defects": sum(bool(row["defects"]) for row in rows),
        "truth": " or ".join(sorted(words[pair] for pair in truths)),
    }


def _mean(rows: Sequence[Mapping[str, object]], key: str) -> float:
    values = [float(str(row[key])) for row in rows if row[key] is not None]
    return round(float(np.mean(values)), 3) if values else float("nan")


def _range(rows: Sequence[Mapping[str, object]], key: str) -> str:
    values = [int(str(row[key])) for row in rows]
    return f"{min(values)}-{max(values)}" if min(values) < max(values) else str(values[0])
