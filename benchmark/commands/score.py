"""`nonrigid score`: compare a correspondence with the ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import read_truth
from nonrigid.benchmark.metric import geodesic_errors
from nonrigid.benchmark.protocol import curve, score
from nonrigid.benchmark.terminal import say, show_json, show_table
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


def score_command(
    correspondence: Annotated[Path, typer.Argument(help="A .corr, .vts or .map file.", show_default=False)],
    full: Annotated[Path, typer.Option(help="The full surface.", show_default=False)],
    truth: Annotated[Path, typer.Option(help="The ground truth (.baryc_gt, .vts, .map).", show_default=False)],
    mirrored: Annotated[
        Path | None, typer.Option(help="The mirrored ground truth (.baryc_gt_sym), accepted as well.")
    ] = None,
    part: Annotated[Path | None, typer.Option(help="The part; coverage and kept area need it.")] = None,
    metric: Annotated[str, typer.Option(help="dijkstra, heat, edgeflip or exact.")] = "dijkstra",
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Score a correspondence by the protocol of the SHREC'16 partial-matching track.

    Errors are geodesic distances on the full surface in hundredths of the square root of its area.
    """
    whole = read_mesh(full)
    piece = None if part is None else read_mesh(part)
    rows = None if piece is None else len(piece.vertices)
    direct = read_truth(truth, whole, expected_rows=rows)
    swapped = None if mirrored is None else read_truth(mirrored, whole, expected_rows=len(direct))
    points = read_truth(correspondence, whole, expected_rows=len(direct))
    record = _record(correspondence.stem, whole, piece, points, direct, swapped, metric)
    if json:
        show_json(record)
        return
    shown = {key: value for key, value in record.items() if not isinstance(value, list) and value is not None}
    show_table([shown], columns={key: key.replace("_", " ") for key in shown})
    if piece is None:
        say("Coverage and kept area need the part: give --part.")
    if swapped is None:
        say("Only the direct map counts as right: give --mirrored to accept the mirrored one, as the track does.")


def _record(
    name: str,
    full: Mesh,
    part: Mesh | None,
    points: SurfacePoints,
    truth: SurfacePoints,
    mirrored: SurfacePoints | None,
    metric: str,
) -> dict[str, object]:
    kept: float | None = None
    covered: float | None = None
    if part is not None:
        result = score(
            PairData(name=name, part=part, full=full, truth=truth, mirrored=mirrored), points, geodesics=metric
        )
        errors, lenient, side = result.errors, result.mean_error_per_point, result.side
        kept, covered = result.kept_area, result.coverage
    else:
        errors, lenient, side = _errors(full, points, truth, mirrored, metric)
    return {
        "name": name,
        "metric": metric,
        "mean_error_x100": 100 * _mean(errors),
        "mean_error_per_point_x100": 100 * lenient,
        "side": side,
        "matches": len(errors),
        "unmatched": len(points) - len(errors),
        "coverage": covered,
        "kept_area": kept,
        "curve": curve(errors).tolist(),
    }


def _errors(
    full: Mesh, points: SurfacePoints, truth: SurfacePoints, mirrored: SurfacePoints | None, metric: str
) -> tuple[np.ndarray, float, str]:
    """Return the errors on the better side, the mean of the lesser error at each point, and the side."""
    rows = np.flatnonzero(points.matched)
    direct = geodesic_errors(full, points[rows], truth[rows], geodesics=metric)
    sides = [direct]
    if mirrored is not None:
        sides.append(geodesic_errors(full, points[rows], mirrored[rows], geodesics=metric))
    if np.isnan(sides).any():
        raise InputError("a matched vertex has no ground truth", remedy="leave it unmatched")
    better = int(np.argmin([_mean(errors) for errors in sides])) if len(rows) else 0
    return sides[better], _mean(np.min(sides, axis=0)), ("direct", "mirrored")[better]


def _mean(errors: np.ndarray) -> float:
    return float(errors.mean()) if len(errors) else float("nan")
