"""Write a page a pair: both surfaces with the matches of every run, the runs' routes, words, traces and maps."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from nonrigid.benchmark.datasets.files import load_mesh
from nonrigid.benchmark.datasets.protocols import MeshSource, PairData, PairSpec
from nonrigid.benchmark.formats import read_corr, write_text
from nonrigid.benchmark.matched_points import MatchedPoints, matched_points, read_points
from nonrigid.benchmark.protocol import score
from nonrigid.benchmark.report.pack import (
    first_view,
    pack_colours,
    pack_matches,
    pack_matrix,
    pack_surface,
    pack_truth,
)
from nonrigid.benchmark.report.pages.templates import fill, script
from nonrigid.benchmark.report.table import pair_rows
from nonrigid.benchmark.store import Record, Store
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import NonrigidError
from nonrigid.geometry.mesh import Mesh

COLUMNS = {
    "method": "method",
    "backend": "backend",
    "status": "status",
    "mean_error_x100": "error x100",
    "side": "side",
    "matches": "matches",
    "coverage": "coverage",
    "objective": "objective",
    "gap": "gap to best",
    "stationarity": "stationarity",
    "build_seconds": "build s",
    "solve_seconds": "solve s",
}
WORDS = ("method", "backend", "status", "side")
_STAGE = (
    *("problem", "problem_hash", "variables", "sense", "solver", "route", "claim", "status", "message", "raw_status"),
    *("objective", "gap", "violation", "stationarity", "bound", "certificate"),
    *("evaluations", "build_seconds", "solve_seconds"),
)


TRACE_POINTS = 50
"""Points of a trace that a page shows; the tables of the results hold all that were kept."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PairTask:
    """Hold what a pair's page is made of; `spec` is None where the data set cannot be read, and `problem` says why."""

    name: str
    records: tuple[Record, ...]
    spec: PairSpec | None
    problem: str
    folder: Path


def slug(name: str) -> str:
    """Return a file name for a pair: its own where that is one, else with a hash, so that no two are the same.

    Examples
    --------
    >>> slug("cuts_cat_shape_1"), slug("a/b")
    ('cuts_cat_shape_1', 'a_b-c14cddc0')
    """
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    return plain if plain == name else f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def write_pair(task: PairTask) -> None:
    """Write the page of a pair and its data; a pair without meshes gets a page that says why."""
    data: PairData | None = None
    problem = task.problem
    if task.spec is not None:
        try:
            data = replace(task.spec, full=partial(_shared, task.spec.full)).load()
        except NonrigidError as failure:
            problem = str(failure)
    out = task.folder / "report"
    full = None if data is None else write_full(out / "data", data.full)
    store = Store(task.folder)
    blocks: dict[str, Any] = {}
    runs = [_run(record, store, data, blocks) for record in task.records]
    pair: dict[str, Any] = {"name": task.name, "runs": runs, "points": blocks, "full": full}
    if data is not None:
        pair |= surfaces_of(data)
    write_text(out / "data" / f"{slug(task.name)}.js", script(pair=pair))
    rows = [{"id": record["id"], **row} for record, row in zip(task.records, pair_rows(task.records), strict=True)]
    page = fill(
        "pair.html",
        name=task.name,
        slug=slug(task.name),
        full=full,
        facts=_facts(task.records[0], data),
        problem=problem,
        columns=COLUMNS,
        words=WORDS,
        runs=rows,
        inline=None,
    )
    write_text(out / "pairs" / f"{slug(task.name)}.html", page)


def surfaces_of(data: PairData) -> dict[str, Any]:
    """Return a pair's part and ground truth, packed."""
    return {
        "part": pack_surface(data.part),
        "truth": None if data.truth is None else pack_truth(data.truth),
        "mirrored": None if data.mirrored is None else pack_truth(data.mirrored),
    }


def write_full(folder: Path, full: Mesh) -> str:
    """Write a full surface once for all pairs that share it, and return its name."""
    name = content_hash(full.vertices, full.faces)[:12]
    path = folder / f"full-{name}.js"
    if not path.is_file():
        write_text(path, full_script(name, full))
    return name


def full_script(name: str, full: Mesh) -> str:
    """Return the script that hands a full surface, its colours and its first view to the page."""
    return script(
        surfaces={name: {**pack_surface(full), "colours": pack_colours(full)}}, turns={name: first_view(full)}
    )


def _run(record: Record, store: Store, data: PairData | None, blocks: dict[str, Any]) -> dict[str, Any]:
    """Return a run for the page, and add its matches to `blocks`: equal answers of several solvers stand there once."""
    run: dict[str, Any] = {key: record.get(key) for key in ("id", "label", "backend", "status", "message", "side")}
    if store.log_file(record["id"]).is_file():
        run["log"] = f"../../{store.log_file(record['id']).relative_to(store.folder).as_posix()}"
    run["stages"] = [
        {**{key: stage.get(key) for key in _STAGE}, "trace": _thinned(stage["trace"])} for stage in record["stages"]
    ]
    found = None if data is None else _matches(record, store, data)
    if found is not None:
        block = pack_matches(found)
        key = hashlib.sha256(json.dumps(block).encode()).hexdigest()[:12]
        blocks[key] = block
        run["points"] = key
        if found.functional_map is not None:
            run["map"] = pack_matrix(found.functional_map)
    return run


def _matches(record: Record, store: Store, data: PairData) -> MatchedPoints | None:
    stored = store.points_file(record["id"])
    if stored.is_file():
        return read_points(stored)
    written = store.match_file(record["id"])
    if not written.is_file():
        return None
    # Results of before errors were kept: the same score is taken again.
    points = read_corr(written, full=data.full, expected_rows=len(data.part.vertices))
    return matched_points(points, None if data.truth is None else score(data, points, geodesics=record["metric"]))


def _thinned(trace: Sequence[Sequence[float | None]]) -> list[Sequence[float | None]]:
    """Return seconds, evaluations and objectives of at most `TRACE_POINTS` points: a plot shows no more."""
    step = max(1, -(-len(trace) // TRACE_POINTS))
    return [point[:3] for point in trace[::step]]


@lru_cache(maxsize=2)
def _shared(source: MeshSource) -> Mesh:
    """Read a full surface; many pairs in a row have the same."""
    return source() if callable(source) else load_mesh(source)


def _facts(record: Mapping[str, Any], data: PairData | None) -> list[str]:
    facts = [f"{record['split']}, class {record['class_name']}"]
    if data is not None:
        facts += [
            f"{len(data.part.vertices)} of the part's vertices against {len(data.full.vertices)} of the full surface",
            f"{100 * data.kept_area:.0f} % of the area kept",
        ]
        facts += [f"cut from pose {pose}"] if (pose := data.metadata.get("source_pose")) else []
    if record.get("motion_seed") is not None:
        facts.append("the part was moved rigidly at random before it was matched, and is shown as in its file")
    return facts
