"""How near distances on a part come to those before the cut: along the part, and by bridges over what was cut out.

Usage: python benchmarks/bridged_distances.py ROOT NAME [NAME ...]

ROOT holds the folders null, cuts and holes. For all pairs of 200 samples of a part, the distance between them is
compared with that between their true images on the full surface. Columns: share of the area that is kept; then, each
along the part and by bridges, the share of the pairs that differ by less than 0.03, the same of the pairs farther apart
than 0.4 on the full surface, and the mean difference, in sqrt(full area). The ratio is that of the mean differences.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.formulations.formulation import Pair

SAMPLES, CLOSE, FAR = 200, 0.03, 0.4


def main() -> None:
    """Measure every named part, and print a row each."""
    sys.stdout.write(
        "| part | kept | near: along | bridged | far: along | bridged | difference: along | bridged | ratio |\n"
    )
    for spec in Shrec16(root=Path(sys.argv[1]), names=tuple(sys.argv[2:])).pairs():
        data = spec.load()
        assert data.truth is not None
        pair = Pair.of(data.part, data.full)
        nearest = pair.full.clean_view.from_raw(data.truth).nearest_corner(pair.full.mesh)
        images = nearest[pair.part.clean_view.raw_of_vertex]
        samples = pair.part.samples(min(SAMPLES, len(pair.part.mesh.vertices)))
        one, other = np.triu_indices(len(samples), 1)
        truth = pair.full.distances_between(images[samples], keep=False)[one, other]
        off = [np.abs(pair.part.distances_between(samples, way)[one, other] - truth) for way in ("dijkstra", "bridged")]
        cells = [f"{(off[way][chosen] < CLOSE).mean():.2f}" for chosen in (truth >= 0, truth > FAR) for way in (0, 1)]
        cells += [f"{differences.mean():.3f}" for differences in off]
        row = [f"`{spec.name}`", f"{pair.kept_area:.2f}", *cells, f"{off[1].mean() / off[0].mean():.2f}"]
        sys.stdout.write("| " + " | ".join(row) + " |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
