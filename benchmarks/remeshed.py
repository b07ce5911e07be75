"""Accuracy on SHREC'16 once the part and the full surface share no triangulation: both remeshed, truth carried over.

Usage: python benchmarks/remeshed.py ROOT [--out remeshed.jsonl] [--pairs 131] [--names NAME ...]
       [--methods anchored gt] [--vertices 7000] [--originals]

ROOT holds the folders null, cuts and holes. Parts and templates of that data descend from one triangulation of each
class, so that vertices coincide and descriptors agree exactly on many. Here each vertex of either slides towards a
random triangle beside it and edges are collapsed by quadric error, with different random numbers: the template to
--vertices (or 70 percent, if that is less: the wolf has 4,344), the part in the same proportion.

Truth of a vertex of the remeshed part: the closest point of the original part, the truths of its triangle's corners
weighted alike, from there the closest point of the remeshed template. Its error is measured by a round trip, without
any method: original vertices of the part, of which the truth is known, go to the closest point of the remeshed part,
and the truth carried there is compared with their own. Original vertices whose closest point is farther than half a
mean edge (the remeshed boundary lies a little further in) are left out of it.

Pairs are taken in an order drawn once (seed 0), so that the first n are a sample. Errors are geodesic, in hundredths of
sqrt(full area), per shape the better of the direct and the mirrored truth, after a random rigid motion of the part.
With --originals the same pairs are matched as they are too. Rows go to the file one by one, and those found there are
not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from nonrigid.benchmark.datasets.posed import remeshed, seed_of
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.methods import make_method
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points
from nonrigid.geometry.surface import Surface
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match

SECONDS = 120.0
LARGEST_SHARE = 0.7
"""Vertices left of a template that has few to begin with."""
Row = dict[str, Any]


def carried(points: SurfacePoints, original: Mesh, truth: SurfacePoints, full: Mesh, onto: Mesh) -> SurfacePoints:
    """Return the points of `onto` that points of a part correspond to; unmatched where a corner's truth is unknown.

    Parameters
    ----------
    points
        (p,) points of `original`.
    truth
        (n,) the point of `full` that each vertex of `original` corresponds to.
    """
    corners = original.faces[points.faces]
    places = np.einsum("pc,pcx->px", points.barycentric, truth.positions(full)[corners])
    known = np.isfinite(places).all(axis=1)
    faces, weights = np.full(len(points), -1, dtype=np.int64), np.zeros((len(points), 3))
    found = closest_points(onto, places[known])
    faces[known], weights[known] = found.faces, found.barycentric
    return SurfacePoints(faces, weights)


def remeshed_pair(raw: PairData, vertices: int) -> tuple[PairData, FloatArray]:
    """Return the pair on its new meshes, and the errors of the carried truth on a round trip, in sqrt(full area)."""
    data = _repaired(raw)
    assert data.truth is not None
    target = min(vertices, round(LARGEST_SHARE * len(data.full.vertices)))
    rate = target / len(data.full.vertices)
    full = remeshed(data.full, target, seed_of("remeshed full", data.full.name, vertices))
    part = remeshed(data.part, round(rate * len(data.part.vertices)), seed_of("remeshed part", data.name, vertices))
    back = closest_points(data.part, part.vertices)
    truth = carried(back, data.part, data.truth, data.full, full)
    mirrored = None if data.mirrored is None else carried(back, data.part, data.mirrored, data.full, full)
    new = PairData(name=data.name, part=part, full=full, truth=truth, mirrored=mirrored)
    there = closest_points(part, data.part.vertices)
    edges = data.part.vertices[data.part.faces[:, [0, 1]]]
    edge = float(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).mean())
    near = np.linalg.norm(there.positions(part) - data.part.vertices, axis=1) < 0.5 * edge
    again = carried(there, part, truth, full, data.full).positions(data.full)
    apart = np.linalg.norm(again - data.truth.positions(data.full), axis=1)[near] / np.sqrt(data.full.area)
    return new, apart[np.isfinite(apart)]


def _repaired(data: PairData) -> PairData:
    """Return the pair on its repaired surfaces: collapses need ones without two fans of triangles at one vertex."""
    part, full = (Surface(mesh, cache=None).clean_view for mesh in (data.part, data.full))
    truth, mirrored = (
        None if of is None else full.from_raw(of[part.raw_of_vertex]) for of in (data.truth, data.mirrored)
    )
    return PairData(name=data.name, part=part.mesh, full=full.mesh, truth=truth, mirrored=mirrored)


def run(root: Path, name: str, method: str, vertices: int | None) -> Row:
    """Match one pair by one method, remeshed or as it is, and score every matched vertex."""
    data = Shrec16(root=root, names=(name,)).pairs()[0].load()
    row: Row = {"pair": name, "method": method, "vertices": vertices}
    if vertices is not None:
        data, apart = remeshed_pair(data, vertices)
        row |= {"truth_mean": round(100.0 * apart.mean(), 4), "truth_99": round(100.0 * np.quantile(apart, 0.99), 4)}
    part = random_rigid_motion(data.part)[0]
    begun = time.process_time()
    matched = match(Pair.of(part, data.full), make_method(method), limits=Limits(seconds=SECONDS))
    row |= {
        "seconds": round(time.process_time() - begun, 2),
        "part_vertices": len(part.vertices),
        "full_vertices": len(data.full.vertices),
        "error": None,
    }
    if matched.correspondence is None:
        return row | {"message": matched.message}
    result = score(data, matched.correspondence.dense(len(part.vertices)))
    return row | {
        "error": round(100.0 * result.mean_error, 4),
        "error_per_point": round(100.0 * result.mean_error_per_point, 4),
        "coverage": round(result.coverage, 4),
        "matches": result.match_count,
    }


def table(rows: list[Row]) -> str:
    """Return the errors by method, meshes and split."""
    lines = ["| method | meshes | parts | n | failed | mean | median | largest | above 5 | CPU s | truth |"]
    lines.append("|" + " --- |" * 11)
    for method, vertices in dict.fromkeys((row["method"], row["vertices"]) for row in rows):
        for split in ("cuts", "holes"):
            mine = [
                r for r in rows if (r["method"], r["vertices"]) == (method, vertices) and r["pair"].startswith(split)
            ]
            errors = [row["error"] for row in mine if row["error"] is not None]
            if not errors:
                continue
            truth = f"{mean(r['truth_mean'] for r in mine):.3f}" if vertices is not None else "-"
            lines.append(
                f"| {method} | {'as they are' if vertices is None else vertices} | {split} | {len(mine)} "
                f"| {len(mine) - len(errors)} | {mean(errors):.2f} | {median(errors):.2f} | {max(errors):.2f} "
                f"| {sum(error > 5.0 for error in errors)} | {median(r['seconds'] for r in mine):.1f} | {truth} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what the file does not hold yet, then write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--out", type=Path, default=Path("remeshed.jsonl"))
    parser.add_argument("--pairs", type=int, default=131)
    parser.add_argument("--names", nargs="+")
    parser.add_argument("--methods", nargs="+", default=["anchored", "gt"])
    parser.add_argument("--vertices", type=int, default=7000)
    parser.add_argument("--originals", action="store_true")
    given = parser.parse_args()
    every = sorted(spec.name for spec in Shrec16(root=given.root).pairs())
    names = given.names or [every[k] for k in np.random.default_rng(0).permutation(len(every))[: given.pairs]]
    known = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    rows = {(row["pair"], row["method"], row["vertices"]): row for row in known}
    wanted = [
        (name, method, vertices)
        for name in names
        for method in given.methods
        for vertices in ((given.vertices, None) if given.originals else (given.vertices,))
    ]
    with threadpool_limits(1), given.out.open("a") as file:
        for name, method, vertices in wanted:
            if (name, method, vertices) not in rows:
                row = rows[name, method, vertices] = run(given.root, name, method, vertices)
                file.write(json.dumps(row) + "\n")
                file.flush()
    sys.stdout.write(table([rows[key] for key in wanted]))


if __name__ == "__main__":
    main()
