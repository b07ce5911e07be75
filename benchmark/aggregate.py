"""Average scores over shapes, all together and by the missing area."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from nonrigid.benchmark.protocol import THRESHOLDS, Score
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary:
    """Hold means over shapes; points were averaged in each shape first, so that every shape counts the same.

    Parameters
    ----------
    label
        Which shapes, such as "missing area at most 50 %".
    metric
        How distances were measured.
    shape_count
        Shapes with at least one match; they alone enter the errors, the coverage counts all.
    empty_count
        Shapes without any match.
    mean_error, mean_error_per_point
        Means of the primary and secondary errors, fractions of sqrt(full area); NaN where `shape_count` is 0.
    match_count
        Mean number of matches a shape, empty ones included.
    coverage
        Mean covered fraction, empty shapes included.
    curve
        (51,) mean curve.
    """

    label: str
    metric: str
    shape_count: int
    empty_count: int
    mean_error: float
    mean_error_per_point: float
    match_count: float
    coverage: float
    curve: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class ScoredRow:
    """Hold the scores of one finished run; see `nonrigid.benchmark.protocol.Score`."""

    metric: str
    mean_error: float
    mean_error_per_point: float
    match_count: int
    coverage: float
    curve: FloatArray
    kept_area: float


Scored: TypeAlias = Score | ScoredRow


def scored_rows(records: Sequence[Mapping[str, Any]]) -> list[ScoredRow]:
    """Return the scores of those runs that have some; runs without a correspondence have none."""
    nothing = float("nan")
    return [
        ScoredRow(
            metric=record["metric"],
            mean_error=nothing if record["mean_error"] is None else record["mean_error"],
            mean_error_per_point=nothing if record["mean_error"] is None else record["mean_error_per_point"],
            match_count=record["match_count"],
            coverage=record["coverage"],
            curve=np.array(record["curve"], dtype=np.float64),
            kept_area=record["kept_area"],
        )
        for record in records
        if record.get("match_count") is not None and record.get("curve") is not None
    ]


def summarize(scores: Sequence[Scored], *, label: str = "all shapes") -> Summary:
    """Average the scores of several shapes.

    Raises
    ------
    InputError
        If there are no scores, or they were measured in different metrics.
    """
    metrics = sorted({score.metric for score in scores})
    if len(metrics) != 1:
        raise InputError(
            f"{len(scores)} scores with {len(metrics)} metrics ({', '.join(metrics)})",
            remedy="average scores of one metric only",
        )
    matched = [score for score in scores if score.match_count]
    return Summary(
        label=label,
        metric=metrics[0],
        shape_count=len(matched),
        empty_count=len(scores) - len(matched),
        mean_error=_mean([score.mean_error for score in matched]),
        mean_error_per_point=_mean([score.mean_error_per_point for score in matched]),
        match_count=_mean([score.match_count for score in scores]),
        coverage=_mean([score.coverage for score in scores]),
        curve=np.mean([score.curve for score in matched], axis=0) if matched else np.full(len(THRESHOLDS), np.nan),
    )


def by_partiality(scores: Sequence[Scored], *, cumulative: bool) -> list[Summary]:
    """Average by missing area in steps of 10 %.

    Cumulative bins hold the shapes whose missing area is at most 10, 20, ... 100 %, as the track's page defines;
    disjoint ones those above the last step and up to this one. Empty bins are left out.
    """
    summaries = []
    for step in range(1, 11):
        low, high = 0.1 * (step - 1), 0.1 * step
        chosen = [
            score
            for score in scores
            if _missing(score) <= high + 1e-9 and (cumulative or step == 1 or _missing(score) > low + 1e-9)
        ]
        if chosen:
            limits = f"at most {10 * step} %" if cumulative else f"{10 * (step - 1)} to {10 * step} %"
            summaries.append(summarize(chosen, label=f"missing area {limits}"))
    return summaries


def _missing(score: Scored) -> float:
    return float(np.clip(1.0 - score.kept_area, 0.0, 1.0))


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
