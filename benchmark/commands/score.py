"""`nonrigid score`: compare a correspondence with the ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from nonrigid.benchmark.commands.summary import show_summary
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import read_truth
from nonrigid.benchmark.metric import errors_of_both
from nonrigid.benchmark.protocol import curve, score
from nonrigid.benchmark.report.table import summary
from nonrigid.benchmark.score_predictions import score_predictions
from nonrigid.benchmark.terminal import say, show_json, show_table
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


def score_command(
    correspondence: Annotated[
        Path, typer.Argument(help="A .corr, .vts or .map file, or a folder of them, one a part.", show_default=False)
    ],
    full: Annotated[Path | None, typer.Option(help="The full surface.", show_default=False)] = None,
    truth: Annotated[
        Path | None, typer.Option(help="The ground truth (.baryc_gt, .vts, .map).", show_default=False)
    ] = None,
    mirrored: Annotated[
        Path | None, typer.Option(help="The mirrored ground truth (.baryc_gt_sym), accepted as well.")
    ] = None,
    part: Annotated[Path | None, typer.Option(help="The part; coverage and kept area need it.")] = None,
    data: Annotated[
        Path | None, typer.Option(help="For a folder: the data set, a folder or archive in any layout.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="For a folder: where results go, for `nonrigid report`; by default beside it.")
    ] = None,
    label: Annotated[str | None, typer.Option(help="For a folder: the method's name in tables.")] = None,
    metric: Annotated[str, typer.Option(help="dijkstra, heat, edgeflip or exact.")] = "dijkstra",
    jobs: Annotated[int, typer.Option(help="For a folder: processes.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Score a correspondence, or a folder of them, by the protocol of the SHREC'16 partial-matching track.

    Errors are geodesic distances on the full surface in hundredths of the square root of its area.
    """
    if correspondence.is_dir():
        _refuse(correspondence, "a folder", {"--full": full, "--truth": truth, "--mirrored": mirrored, "--part": part})
        if data is None:
            raise InputError("this is a folder", file=correspondence, remedy="give --data; or name one file")
        _score_folder(correspondence, data, out, label, metric, jobs, json)
        return
    _refuse(correspondence, "one file", {"--data": data, "--out": out, "--label": label})
    if full is None or truth is None:
        raise InputError("this is one file", file=correspondence, remedy="give --full and --truth")
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


def _refuse(given: Path, kind: str, options: Mapping[str, object]) -> None:
    """Refuse options that say nothing about this kind of input."""
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} says nothing about {kind}", file=given, remedy=f"leave {name} out")


def _score_folder(
    folder: Path, data: Path, out: Path | None, label: str | None, metric: str, jobs: int, json: bool
) -> None:
    place = folder.with_name(f"{folder.resolve().name}-scores") if out is None else out
    scored = score_predictions(folder, data, out=place, label=label or folder.resolve().name, metric=metric, jobs=jobs)
    rows = summary(scored.records)
    if json:
        show_json({"out": str(place), "scores": rows, "without_prediction": scored.missing, "unused": scored.unused})
        return
    show_summary(f"{folder} on {data}", rows)
    if scored.missing:
        say(f"{len(scored.missing)} pairs have no prediction and count nowhere, such as {scored.missing[0]}")
    if scored.unused:
        say(f"{len(scored.unused)} files fit no pair, such as {scored.unused[0]}")
    say(f"{len(scored.records)} pairs scored in {place}; `nonrigid report {place}` writes tables, figures and pages")


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
        unknown = result.unknown_count
        kept, covered = result.kept_area, result.coverage
    else:
        errors, lenient, side = _errors(full, points, truth, mirrored, metric)
        unknown = int((points.matched & ~truth.matched).sum())
    return {
        "name": name,
        "metric": metric,
        "mean_error_x100": 100 * _mean(errors),
        "mean_error_per_point_x100": 100 * lenient,
        "side": side,
        "matches": len(errors) + unknown,
        "unmatched": len(points) - len(errors) - unknown,
        "without_truth": unknown,
        "coverage": covered,
        "kept_area": kept,
        "curve": curve(errors).tolist(),
    }


def _errors(
    full: Mesh, points: SurfacePoints, truth: SurfacePoints, mirrored: SurfacePoints | None, metric: str
) -> tuple[np.ndarray, float, str]:
    """Return the errors on the better side, the mean of the lesser error at each point, and the side."""
    rows = np.flatnonzero(points.matched & truth.matched)
    if points.matched.any() and not len(rows):
        raise InputError("no matched vertex has ground truth", remedy="match vertices that have it")
    image = None if mirrored is None else mirrored[rows]
    both = errors_of_both(full, points[rows], truth[rows], image, geodesics=metric)
    sides = [errors for errors in both if errors is not None]
    if np.isnan(sides).any():
        raise InputError("a matched vertex has ground truth on one side only", remedy="complete the ground truth")
    better = int(np.argmin([_mean(errors) for errors in sides])) if len(rows) else 0
    return sides[better], _mean(np.min(sides, axis=0)), ("direct", "mirrored")[better]


def _mean(errors: np.ndarray) -> float:
    return float(errors.mean()) if len(errors) else float("nan")
