"""Measure parts and their ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


def part_statistics(data: PairData) -> dict[str, object]:
    """Return a row about a pair.

    Returns
    -------
    `vertices`, `faces` of the part; `area_kept`, a fraction; `boundary_length`, in units of sqrt(area of the full
    shape); `boundary_loops`, connected groups of boundary edges; `mean_edge`, in the same unit; `ratio_5`, `ratio_50`
    and `ratio_95`, percentiles of the length of an edge's image under the truth divided by the edge's own; all None
    where there is no truth. Beside them `name`, `split`, `class` and `source_pose`.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> corner = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]])
    >>> row = part_statistics(PairData(name="corner", part=corner, full=square, truth=None))
    >>> row["area_kept"], row["boundary_loops"], row["ratio_50"]
    (0.5, 1, None)
    """
    unit = np.sqrt(data.full.area)
    part = data.part
    ratios = (None, None, None) if data.truth is None else edge_ratios(part, data.truth, data.full)
    return {
        "name": data.name,
        "split": data.metadata.get("split"),
        "class": data.metadata.get("class_name"),
        "source_pose": data.metadata.get("source_pose"),
        "vertices": len(part.vertices),
        "faces": len(part.faces),
        "area_kept": data.kept_area,
        "boundary_length": float(_lengths(part, part.boundary_edges).sum() / unit),
        "boundary_loops": len(part.boundary_loops),
        "mean_edge": float(_lengths(part, part.edges).mean() / unit),
        "ratio_5": ratios[0],
        "ratio_50": ratios[1],
        "ratio_95": ratios[2],
    }


def edge_ratios(mesh: Mesh, points: SurfacePoints, full: Mesh) -> tuple[float, float, float]:
    """Return the 5th, 50th and 95th percentile of image length over length, over the edges of `mesh`.

    Edges without length, or with an unmatched end, do not count.
    """
    i, j = mesh.edges.T
    place = points.positions(full)
    length, image = _lengths(mesh, mesh.edges), np.linalg.norm(place[i] - place[j], axis=1)
    counted = (length > 0) & np.isfinite(image)
    low, middle, high = np.percentile(image[counted] / length[counted], [5, 50, 95])
    return float(low), float(middle), float(high)


def summary(rows: Iterable[Mapping[str, object]]) -> dict[str, object]:
    """Return how many rows there are, and the mean, least and greatest of their numbers."""
    rows = list(rows)
    result: dict[str, object] = {"shapes": len(rows)}
    for key in rows[0] if rows else ():
        values = [float(row[key]) for row in rows if isinstance(row[key], int | float)]  # type: ignore[arg-type]
        if values:
            result[key] = (float(np.mean(values)), min(values), max(values))
    return result


def _lengths(mesh: Mesh, edges: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1))
