"""Where matching breaks: error against noise, mesh resolution, kept area and stretch, on creatures with exact truth.

Usage: python benchmarks/robustness.py [--out robustness.jsonl] [--figure robustness.png] [--quick]
       [--methods anchored gt] [--panels noise vertices kept stretch] [--creatures 8] [--seeds 0] [--base 10000]

One thing varies at a time about a base case: 10,000 vertices, half of the area kept by a plane cut, no noise, no
stretch. For each creature and seed one of its eight poses and one direction of the plane are drawn; all values of a
panel share them.

noise      the part's vertices move along their normals by Gaussian offsets; sigma in percent of sqrt(full area), where
           the mean edge at 10,000 vertices is about 1 percent
vertices   of the template and of the pose that the part is cut from, remeshed independently of each other
kept       area that the plane keeps, in percent of the full one; the largest piece if there are several
stretch    smooth anisotropic stretch of the part: along each of three random orthogonal directions lengths change by
           up to so many percent, up and down, with a period of sqrt(full area)

Every part is turned and shifted at random. Errors are geodesic, in hundredths of sqrt(full area), per shape the better
of the direct and the mirrored truth, over at most 2,000 random matches of each part; `gt` is sparse: its error is that
of its matches, its coverage is listed. A pair that is refused or left without a match is counted as failed. Rows go to
the file one by one, and those found there are not run again. --quick takes two creatures of 2,500 vertices and three
values a panel.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from nonrigid.benchmark.datasets.creatures import Creature, Creatures
from nonrigid.benchmark.datasets.cuts import cut_by_plane
from nonrigid.benchmark.datasets.posed import PosedShape, seed_of
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.methods import make_method
from nonrigid.benchmark.protocol import COVERAGE_RADIUS, coverage, random_rigid_motion, score
from nonrigid.benchmark.report.sketch import FAINT
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import NonrigidError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match

VALUES: dict[str, tuple[float, ...]] = {
    "noise": (0.0, 0.1, 0.2, 0.5, 1.0),
    "vertices": (2500, 5000, 10000, 20000, 40000),
    "kept": (10, 20, 30, 50, 70, 90),
    "stretch": (0, 5, 10, 20),
}
QUICK: dict[str, tuple[float, ...]] = {
    "noise": (0.0, 0.5, 2.0),
    "vertices": (1250, 2500, 5000),
    "kept": (20, 50, 90),
    "stretch": (0, 10, 20),
}
AXES = {
    "noise": "noise along normals, sigma in % of sqrt(area)",
    "vertices": "vertices of each complete shape",
    "kept": "kept area (%)",
    "stretch": "stretch up to (%)",
}
TICKS = (0.5, 1, 2, 5, 10, 20, 50)
COLOURS = {"anchored": "#c0392b", "gt": "#2c6fbb"}
SECONDS = 120.0
SCORED = 2000
"""Largest number of matches of a part that are scored, drawn at random: distances on 40,000 vertices take long."""
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Case:
    """Hold the condition under which a creature is matched, in the units of the panels."""

    creature: str
    seed: int
    vertices: int
    kept: float = 50.0
    noise: float = 0.0
    stretch: float = 0.0

    def at(self, panel: str, value: float) -> Case:
        """Return the case with one thing changed."""
        changes: dict[str, Any] = {panel: int(value) if panel == "vertices" else float(value)}
        return replace(self, **changes)

    @property
    def key(self) -> str:
        """Text that differs whenever the part does."""
        return f"{self.creature} {self.seed} {self.vertices} {self.kept:g} {self.noise:g} {self.stretch:g}"

    def data(self) -> PairData:
        """Build the pair."""
        creature = next(one for one in Creatures(vertices=self.vertices).classes() if one.name == self.creature)
        template, pose = creature.template(), self._pose(creature)
        keep = self._cut(pose, template)
        part = restrict(pose.mesh, keep)
        rng = np.random.default_rng(seed_of("robustness", self.creature, self.seed))
        unit = float(np.sqrt(template.area))
        places = stretched(part.mesh.vertices, unit, self.stretch / 100.0, rng)
        mesh = Mesh(places, part.mesh.faces, name=self.key)
        offsets = rng.standard_normal(len(places)) * self.noise / 100.0 * unit
        return PairData(
            name=self.key,
            part=Mesh(places + offsets[:, None] * mesh.vertex_normals, mesh.faces, name=self.key),
            full=template,
            truth=pose.truth[part.vertex_of_part],
            mirrored=None if pose.mirrored is None else pose.mirrored[part.vertex_of_part],
        )

    def _pose(self, creature: Creature) -> PosedShape:
        names = creature.pose_names
        return creature.posed(names[seed_of("pose", self.creature, self.seed) % len(names)])

    def _cut(self, pose: PosedShape, template: Mesh) -> Any:
        """Return the faces on one side of the plane of the drawn direction that keeps the wanted share of the area."""
        normal = np.random.default_rng(seed_of("plane", self.creature, self.seed)).normal(size=3)
        normal /= np.linalg.norm(normal)
        heights = pose.truth.positions(template) @ normal
        areas, wanted = pose.mesh.face_areas, self.kept / 100.0 * pose.mesh.area
        low, high = float(heights.min()), float(np.quantile(heights, 0.999))
        for _ in range(20):
            middle = 0.5 * (low + high)
            keep = cut_by_plane(pose.mesh, pose.truth, template, point=middle * normal, normal=normal)
            low, high = (middle, high) if areas[keep].sum() > wanted else (low, middle)
        return cut_by_plane(pose.mesh, pose.truth, template, point=low * normal, normal=normal)


def stretched(places: FloatArray, unit: float, share: float, rng: np.random.Generator) -> FloatArray:
    """Return places moved so that lengths along three directions change by up to a share, smoothly.

    x -> x + sum_k share L / (2 pi) sin(2 pi x'd_k / L + phase_k) d_k with L the unit: the factor along d_k is
    1 + share cos(.).

    Parameters
    ----------
    places
        (n, 3).
    """
    turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    phase = rng.uniform(0.0, 2.0 * np.pi, size=3)
    along = places @ turn
    moved = along + share * unit / (2.0 * np.pi) * np.sin(2.0 * np.pi * along / unit + phase)
    return np.asarray(moved @ turn.T)


def run(case: Case, method: str) -> Row:
    """Match one case by one method, and score it; a failure is a row with its reason."""
    data = case.data()
    part = random_rigid_motion(data.part)[0]
    begun = time.process_time()
    row: Row = {**vars(case), "method": method, "part_vertices": len(part.vertices)}
    row |= {"kept_area": round(100.0 * data.kept_area, 2), "error": None, "coverage": 0.0, "matches": 0}
    try:
        matched = match(Pair.of(part, data.full), make_method(method), limits=Limits(seconds=SECONDS))
    except NonrigidError as failure:
        return row | {"message": str(failure)}
    row |= {"seconds": round(time.process_time() - begun, 2), "status": matched.status.value}
    if matched.correspondence is None:
        return row | {"message": matched.message}
    found = matched.correspondence
    if not len(found):
        return row | {"message": "no match"}
    radius = COVERAGE_RADIUS * float(np.sqrt(data.full.area))
    row |= {"coverage": round(coverage(part, found.part_vertices, radius), 4), "matches": len(found)}
    points = found.dense(len(part.vertices))
    drawn = np.random.default_rng(0).permutation(found.part_vertices)[:SCORED]
    faces = np.full(len(points), -1, dtype=np.int64)
    faces[drawn] = points.faces[drawn]
    result = score(data, SurfacePoints(faces, points.barycentric))
    per_point = round(100.0 * result.mean_error_per_point, 4)
    return row | {"error": round(100.0 * result.mean_error, 4), "error_per_point": per_point}


def cases(options: argparse.Namespace) -> Iterator[tuple[str, float, Case]]:
    """Yield each panel, value and case; the base case stands in every panel."""
    names = [one.name for one in Creatures(vertices=options.base).classes()][: options.creatures]
    for seed in options.seeds:
        for name in names:
            base = Case(creature=name, seed=seed, vertices=options.base)
            for panel in options.panels:
                for value in options.values[panel]:
                    yield panel, value, base.at(panel, value)


def table(rows: dict[tuple[Case, str], Row], options: argparse.Namespace) -> str:
    """Return, a line a value, the errors of each method over all creatures and seeds."""
    heads = ("panel", "value", "method", "n", "failed", "mean", "median", "above 5", "coverage", "CPU s")
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for panel, value, method, found in grouped(rows, options):
        errors = [row["error"] for row in found if row["error"] is not None]
        seconds = [row["seconds"] for row in found if "seconds" in row]
        cells = [panel, f"{value:g}", method, str(len(found)), str(len(found) - len(errors))]
        cells += [f"{mean(errors):.2f}", f"{median(errors):.2f}"] if errors else ["-", "-"]
        cells += [str(sum(error > 5.0 for error in errors)), f"{mean(row['coverage'] for row in found):.2f}"]
        cells.append(f"{median(seconds):.1f}" if seconds else "-")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def grouped(
    rows: dict[tuple[Case, str], Row], options: argparse.Namespace
) -> Iterator[tuple[str, float, str, list[Row]]]:
    """Yield the rows of each panel, value and method."""
    for panel in options.panels:
        for value in options.values[panel]:
            for method in options.methods:
                chosen = [case for at, point, case in cases(options) if (at, point) == (panel, value)]
                yield panel, value, method, [rows[case, method] for case in chosen]


def draw(rows: dict[tuple[Case, str], Row], options: argparse.Namespace, path: Path) -> None:
    """Draw a panel a thing varied: the median as a line, each creature as a dot, a cross on top where some failed."""
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    found = list(grouped(rows, options))
    for axes, panel in zip(figure.subplots(2, 2, sharey=True).ravel(), options.panels, strict=False):
        for method in options.methods:
            mine = [(value, of) for at, value, word, of in found if (at, word) == (panel, method)]
            known = [(value, [row["error"] for row in of if row["error"] is not None]) for value, of in mine]
            known = [(value, errors) for value, errors in known if errors]
            colour = COLOURS.get(method, "#555555")
            axes.plot(
                [value for value, _ in known], [median(e) for _, e in known], "o-", color=colour, label=method, ms=4
            )
            for value, errors in known:
                axes.plot([value] * len(errors), errors, ".", color=colour, alpha=0.35, ms=5, mew=0)
            lost = [value for value, of in mine if any(row["error"] is None for row in of)]
            if lost:
                axes.plot(lost, [0.96] * len(lost), "x", color=colour, transform=axes.get_xaxis_transform())
        axes.axhline(5.0, color="#888888", lw=0.8, ls=":")
        axes.set(xlabel=AXES[panel], ylabel="mean error x100", yscale="log")
        axes.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        if panel == "vertices":
            axes.set_xscale("log")
            axes.set_xticks(options.values[panel], [f"{value:g}" for value in options.values[panel]])
        axes.minorticks_off()
        axes.grid(color=FAINT, linewidth=0.6)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run what the file does not hold yet, then write the table and the figure."""
    options = _options()
    known = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    names = ("creature", "seed", "vertices", "kept", "noise", "stretch")
    rows = {(Case(**{name: row[name] for name in names}), row["method"]): row for row in known}
    with threadpool_limits(1), options.out.open("a") as file:
        for _, _, case in cases(options):
            for method in options.methods:
                if (case, method) not in rows:
                    row = rows[case, method] = run(case, method)
                    file.write(json.dumps(row) + "\n")
                    file.flush()
    sys.stdout.write(table(rows, options))
    if options.figure is not None:
        draw(rows, options, options.figure)


def _options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("robustness.jsonl"))
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--methods", nargs="+", default=["anchored", "gt"])
    parser.add_argument("--panels", nargs="+", choices=VALUES, default=list(VALUES))
    parser.add_argument("--creatures", type=int)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--base", type=int)
    options = parser.parse_args(arguments)
    options.values = QUICK if options.quick else VALUES
    options.creatures = options.creatures or (2 if options.quick else 8)
    options.base = options.base or (2500 if options.quick else 10_000)
    return options


if __name__ == "__main__":
    main()
