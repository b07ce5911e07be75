"""Turn runs into the table of solver against accuracy."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from nonrigid.benchmark.statistics.averages import shifted_geometric_mean
from nonrigid.benchmark.store import Record

COLUMNS: Mapping[str, str] = {
    "method": "method",
    "backend": "backend",
    "split": "split",
    "pairs": "pairs",
    "objective": "objective",
    "gap": "gap to best",
    "stationarity": "stationarity",
    "mean_error_x100": "error x100",
    "mean_error_per_point_x100": "error x100 per point",
    "matches": "matches",
    "coverage": "coverage",
    "build_seconds": "build s",
    "solve_seconds": "solve s",
    "typical_seconds": "typical s",
    "status": "status",
}
"""Keys of a summary row and their headings."""

WIDE = tuple(key for key in COLUMNS if key not in ("method", "split"))
"""Keys of a table of one method over all pairs."""

BRIEF = tuple(key for key in WIDE if key not in ("mean_error_per_point_x100", "coverage", "typical_seconds"))
"""Those that fit a terminal."""

EXPLAINED: Mapping[str, str] = {
    "pairs": "pairs with a match, of all pairs",
    "objective": "mean objective of the first problem of the method",
    "gap": "mean relative gap of that objective to the best that any backend reached on the same problem",
    "stationarity": "largest first-order residual of the first problem, measured by the package",
    "mean_error_x100": "geodesic error in hundredths of sqrt(full area): mean over the matched points of a shape, "
    "direct or mirrored map, whichever is better for the shape, then over shapes",
    "mean_error_per_point_x100": "the same with the better of the two maps taken at each point",
    "matches": "mean number of matches a shape; none counts as 0",
    "coverage": "mean share of the part's area within 0.1 sqrt(full area) of a match",
    "build_seconds": "mean time to hand all problems of a pair to the backend",
    "solve_seconds": "mean time that the backend took for all problems of a pair",
    "typical_seconds": "shifted geometric mean (shift 1 s) of building and solving over all pairs; one without a match "
    "is an infinite cost",
    "status": "weakest status of a run's solves, and in how many runs; error: the method or the data failed, not the "
    "solver",
}


def summary(records: Sequence[Record], *, by_split: bool = True) -> list[dict[str, object]]:
    """Return a row for each method and backend over all pairs, and one for each split where there are several.

    Means of times, objectives and gaps are over the runs that have them; a method's rows stand by rising error.
    """
    rows = []
    for label in dict.fromkeys(record["label"] for record in records):
        mine = [record for record in records if record["label"] == label]
        whole = [
            _row(label, backend, "all", [record for record in mine if record["backend"] == backend])
            for backend in dict.fromkeys(record["backend"] for record in mine)
        ]
        for row in sorted(whole, key=_rank):
            rows.append(row)
            splits = list(dict.fromkeys(record["split"] for record in mine))
            if by_split and len(splits) > 1:
                rows += [
                    _row(
                        label,
                        row["backend"],
                        split,
                        [r for r in mine if r["backend"] == row["backend"] and r["split"] == split],
                    )
                    for split in splits
                ]
    return rows


def by_method(
    rows: Sequence[Mapping[str, object]], keys: Sequence[str]
) -> dict[str, tuple[list[dict[str, object]], dict[str, str]]]:
    """Return for each method a table of these keys, a row a backend, and its columns: errors by split beside all."""
    tables = {}
    for label in dict.fromkeys(str(row["method"]) for row in rows):
        mine = [row for row in rows if row["method"] == label]
        splits = [split for split in dict.fromkeys(str(row["split"]) for row in mine) if split != "all"]
        error = {(row["backend"], row["split"]): row["mean_error_x100"] for row in mine}
        columns: dict[str, str] = {}
        for key in keys:
            columns[key] = COLUMNS[key]
            if key == "mean_error_x100":
                columns |= {f"error {split}": split for split in splits}
        tables[label] = (
            [
                {**row, **{f"error {split}": error[row["backend"], split] for split in splits}}
                for row in mine
                if row["split"] == "all"
            ],
            columns,
        )
    return tables


def pair_rows(records: Sequence[Record]) -> list[dict[str, object]]:
    """Return a row a run: the table by pairs."""
    return [
        {
            "pair": record["pair"],
            "method": record["label"],
            "backend": record["backend"],
            "solver": record.get("solver"),
            "variables": record.get("variables"),
            "status": record["status"],
            "objective": record.get("objective"),
            "gap": record.get("gap"),
            "stationarity": record.get("stationarity"),
            "mean_error_x100": _hundredfold(record.get("mean_error")),
            "mean_error_per_point_x100": _hundredfold(record.get("mean_error_per_point")),
            "side": record.get("side"),
            "matches": record.get("match_count"),
            "coverage": record.get("coverage"),
            "kept_area": record.get("kept_area"),
            "build_seconds": record.get("build_seconds"),
            "solve_seconds": record.get("solve_seconds"),
            "formulation_seconds": record.get("formulation_seconds"),
            "message": record["message"],
        }
        for record in records
    ]


def refusals(records: Sequence[Record]) -> list[dict[str, object]]:
    """Return why runs have no match: a row for each backend and reason, with the runs it concerns."""
    lost = [record for record in records if record.get("match_count") is None]
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for record in lost:
        reason = "".join("#" if letter.isdigit() else letter for letter in record["message"])
        groups.setdefault((record["label"], record["backend"], reason), []).append(record)
    return [
        {
            "method": label,
            "backend": backend,
            "status": members[0]["status"],
            "runs": len(members),
            "reason": members[0]["message"],
            "pair": members[0]["pair"],
        }
        for (label, backend, _), members in groups.items()
    ]


def notes(index: Mapping[str, object], records: Sequence[Record]) -> list[str]:
    """Return what a reader must know before believing the table; empty where there is nothing."""
    found = []
    wanted = index["runs"]
    assert isinstance(wanted, dict)
    if missing := len(wanted) - len(records):
        found.append(f"{missing} of {len(wanted)} runs are not finished; repeat `nonrigid bench` to finish them.")
    if (sources := len({record["source"] for record in records})) > 1:
        found.append(f"The runs were made by {sources} states of the code; `nonrigid bench --fresh` repeats them all.")
    for row in refusals(records):
        found.append(refusal_words(row))
    return found


def refusal_words(row: Mapping[str, object]) -> str:
    """Return a row of `refusals` as a sentence."""
    return f"{row['backend']}: {row['runs']} without a match ({row['status']}), such as {row['pair']}: {row['reason']}"


def _row(label: str, backend: object, split: str, records: Sequence[Record]) -> dict[str, object]:
    matched = [record for record in records if record.get("match_count")]
    solved = [record for record in records if record["status"] != "refused"]
    statuses = Counter(record["status"] for record in records)
    return {
        "method": label,
        "backend": backend,
        "split": split,
        "pairs": f"{len(matched)}/{len(records)}",
        "objective": _mean(records, "objective"),
        "gap": _mean(records, "gap"),
        "stationarity": max(_values(records, "stationarity"), default=None),
        "mean_error_x100": _hundredfold(_mean(matched, "mean_error")),
        "mean_error_per_point_x100": _hundredfold(_mean(matched, "mean_error_per_point")),
        "matches": round(sum(record.get("match_count") or 0 for record in records) / max(len(records), 1), 1),
        "coverage": _mean(records, "coverage"),
        "build_seconds": _mean(solved, "build_seconds"),
        "solve_seconds": _mean(solved, "solve_seconds"),
        "typical_seconds": shifted_geometric_mean([_cost(record) for record in records]) if records else None,
        "status": ", ".join(f"{count} {status}" for status, count in statuses.most_common()),
    }


def _cost(record: Record) -> float:
    """Return the seconds of a run; inf for a failure."""
    return float(record["build_seconds"] + record["solve_seconds"]) if record.get("match_count") else math.inf


def _rank(row: Mapping[str, object]) -> tuple[float, float]:
    error, seconds = row["mean_error_x100"], row["solve_seconds"]
    return (
        error if isinstance(error, float) else math.inf,
        seconds if isinstance(seconds, float) else math.inf,
    )


def _values(records: Sequence[Record], key: str) -> list[float]:
    return [record[key] for record in records if record.get(key) is not None and math.isfinite(record[key])]


def _mean(records: Sequence[Record], key: str) -> float | None:
    values = _values(records, key)
    return float(np.mean(values)) if values else None


def _hundredfold(value: float | None) -> float | None:
    return None if value is None else 100.0 * value
