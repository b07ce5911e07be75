"""Compare this package's dense methods with pyFM and POT on the same 16 real pairs: error and time side by side.

Usage: python benchmarks/peers.py ROOT [--pairs 16] [--peers pfm pgw ...] [--out peers.jsonl] [--cold]

ROOT holds the folders null, cuts and holes of SHREC'16. Needs the extra `peers`. Every part is turned and shifted at
random; nothing is read but the meshes. Each peer has the settings that served it best:

pfm, zoomout, pgw, anchored   this package, as it comes
pyfm, pyfm-shot   pyFM's functional map of 50 eigenfunctions of the full surface, and as many of the part as its area
                  says, from wave kernels or from this package's SHOT; then its ZoomOut to 150, at that rate
pot-partial       POT's partial fused Gromov-Wasserstein of 300 and 500 samples, begun as POT begins
pot-semirelaxed   POT's semi-relaxed one, where places may be filled twice

The plans of POT are read out as those of `pgw` are: each sample goes where most of its mass went, and maps are grown
from there; samples, areas, distances and descriptors are the same too. Rows go to the file one by one, and those found
there are not run again. Seconds are those after the geometry (eigenpairs, descriptors, distances) where that is in the
cache, and pyFM's without its eigenpairs; with --cold nothing is cached and all is counted. Expect `pgw` and `anchored`
below half the mean error of pyFM and of POT.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import tomllib
import warnings
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from itertools import chain
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
import ot
from pyFM.functional import FunctionalMapping
from pyFM.mesh import TriMesh
from threadpoolctl import threadpool_limits

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.methods import make_method
from nonrigid.benchmark.protocol import random_rigid_motion, score
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.gromov_wasserstein import PartialGromovWasserstein, symmetric
from nonrigid.formulations.partial_zoomout import growth, sample_areas
from nonrigid.formulations.sampled_distances import sampled_distances
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match

OWN = ("pfm", "zoomout", "pgw", "anchored")
ALPHA = 0.97
"""POT's weight of distances against looks: 0.03 to 1, in the units of `PartialGromovWasserstein.look_weight`."""

Found = tuple[Correspondence, float]


def main() -> None:
    """Run what the file does not hold yet, then write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--pairs", type=int, default=16)
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS))
    parser.add_argument("--out", type=Path, default=Path("peers.jsonl"))
    parser.add_argument("--cold", action="store_true")
    given = parser.parse_args()
    names = _names()[: given.pairs]
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    known = {(row["pair"], row["peer"], row["cold"]): row for row in rows}
    with threadpool_limits(1), warnings.catch_warnings(), given.out.open("a") as file:
        warnings.simplefilter("ignore")
        for name in names:
            for peer in given.peers:
                if (name, peer, given.cold) not in known:
                    row = known[name, peer, given.cold] = run(given.root, name, peer, cold=given.cold)
                    file.write(json.dumps(row) + "\n")
                    file.flush()
    chosen = [[known[name, peer, given.cold] for name in names] for peer in given.peers]
    sys.stdout.write(table(chosen))


def run(root: Path, name: str, peer: str, *, cold: bool) -> dict[str, Any]:
    """Match one pair by one peer, and score every vertex."""
    data = Shrec16(root=root, names=(name,)).pairs()[0].load()
    part = random_rigid_motion(data.part)[0]
    begun = time.perf_counter()
    pair = Pair.of(part, data.full, cache=None) if cold else Pair.of(part, data.full)
    found, before = PEERS[peer](pair)
    seconds = time.perf_counter() - begun - (0.0 if cold else before)
    error = 100.0 * score(data, found.dense(len(data.part.vertices))).mean_error
    return {"pair": name, "peer": peer, "cold": cold, "error": round(error, 3), "seconds": round(seconds, 2)}


def table(rows: list[list[dict[str, Any]]]) -> str:
    """Return errors, seconds and the ratio of the mean error to that of `pgw` if it ran, else of the first peer."""
    overall = {of[0]["peer"]: mean(row["error"] for row in of) for of in rows}
    base = "pgw" if "pgw" in overall else rows[0][0]["peer"]
    lines = [f"{'':16}{'cuts':>7}{'holes':>7}{'median':>8}{'>5':>4}{'seconds':>9}{'error / ' + base:>17}"]
    for of in rows:
        by = {split: [r["error"] for r in of if r["pair"].startswith(split)] for split in ("cuts", "holes")}
        errors = by["cuts"] + by["holes"]
        means = "".join(f"{mean(e):7.2f}" if e else f"{'-':>7}" for e in by.values())
        ratio = overall[of[0]["peer"]] / overall[base]
        bad = sum(error > 5.0 for error in errors)
        lines.append(
            f"{of[0]['peer']:16}{means}{median(errors):8.2f}{bad:4}{median(r['seconds'] for r in of):9.1f}{ratio:17.2f}"
        )
    count = {split: sum(r["pair"].startswith(split) for r in rows[0]) for split in ("cuts", "holes")}
    return "\n".join([*lines, f"mean error x 100 of {count['cuts']} cuts and {count['holes']} holes"]) + "\n"


def own(word: str) -> Callable[[Pair], Found]:
    """Return a method of this package as it comes."""

    def peer(pair: Pair) -> Found:
        matched = match(pair, make_method(word), limits=Limits(seconds=120.0))
        if matched.correspondence is None:
            raise RuntimeError(f"{word}: {matched.message}")
        return matched.correspondence, 0.0

    return peer


def pyfm(descriptor: str) -> Callable[[Pair], Found]:
    """Return pyFM's functional map with its ZoomOut; its maps of points go from the second mesh to the first."""

    def peer(pair: Pair) -> Found:
        begun = time.perf_counter()
        full, part = (TriMesh(s.mesh.vertices, s.mesh.faces) for s in (pair.full, pair.part))
        full.process(200)
        part.process(200)
        before = time.perf_counter() - begun
        model = FunctionalMapping(full, part)
        if descriptor == "shot":
            model.preprocess(descr_type=None)
            looks = trusted_descriptors(pair, (0.10,), power=0.0)
            axes = np.linalg.svd(looks.full[0], full_matrices=False)[2][:60].T
            model.add_descriptors(looks.full[0] @ axes, looks.part[0] @ axes)
        else:
            model.preprocess(n_descr=100, descr_type="WKS")
        share = pair.kept_area
        model.fit(K=(50, max(10, round(50 * share))))
        step = max(1, round(10 * share))
        rate = 10 if step < 10 else 9
        refined = model.zoomout_refine(nit=10, step=(rate, step))
        images = model.get_p2p(refined)
        return Correspondence.between_vertices(pair, np.arange(len(images)), images), before

    return peer


def pot(solve: Callable[..., FloatArray], *, capacity: bool) -> Callable[[Pair], Found]:
    """Return a transport of POT between samples, grown to all vertices."""

    def peer(pair: Pair) -> Found:
        settings = PartialGromovWasserstein()
        descriptors = trusted_descriptors(pair, settings.radii, power=settings.trust_power)
        samples = sampled_distances(pair, descriptors, part_samples=300, placed_samples=300, full_samples=500)
        mass, room = sample_areas(pair.part, samples.points), sample_areas(pair.full, samples.grid)
        distances = symmetric(samples.between), symmetric(samples.on_full)
        weights = (mass / mass.sum(), *((room / mass.sum(),) if capacity else ()))
        plan = solve(samples.unlike, *distances, *weights, alpha=ALPHA)
        method = Grown(settings, descriptors, samples.points, samples.grid[plan.argmax(axis=1)])
        found = match(pair, method).correspondence
        if found is None:
            raise RuntimeError("the maps could not be grown")
        return found, 0.0

    return peer


class Grown:
    """Grow maps from given matches, as a formulation."""

    def __init__(self, *given: Any) -> None:
        self.settings, self.descriptors, self.part, self.full = given

    def stages(self, pair: Pair) -> Any:
        """State the maps."""
        return growth(self.settings, pair, self.descriptors, self.part, self.full)


def _names() -> list[str]:
    """Return the 16 pairs of the plan gt16, a cut and a holed shape in turn."""
    plan = tomllib.loads((files("nonrigid.benchmark.plans") / "gt16.toml").read_text(encoding="utf-8"))
    names: list[str] = plan["data"]["names"]
    cuts, holes = ([name for name in names if name.startswith(split)] for split in ("cuts", "holes"))
    return list(chain.from_iterable(zip(cuts, holes, strict=True)))


PEERS: dict[str, Callable[[Pair], Found]] = {
    **{word: own(word) for word in OWN},
    "pyfm": pyfm("wks"),
    "pyfm-shot": pyfm("shot"),
    # Its bound on steps is also that of the network simplex in each, which would stop early at its default.
    "pot-partial": pot(partial(ot.gromov.partial_fused_gromov_wasserstein, numItermax=10**6), capacity=True),
    "pot-semirelaxed": pot(ot.gromov.semirelaxed_fused_gromov_wasserstein, capacity=False),
}
"""Every peer takes a pair, and returns its answer and the seconds that it spent on geometry known in advance."""


if __name__ == "__main__":
    main()
