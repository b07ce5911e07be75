"""Geodesic farthest points, pruned at the cover radius, against the same without pruning.

Run: python benchmarks/farthest_points.py [mesh.off] [samples]. Without a mesh, a bent ball of 10 242 vertices is used.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import trimesh
from scipy.sparse.csgraph import dijkstra

from nonrigid.geometry.arrays import IntArray
from nonrigid.geometry.clean import clean
from nonrigid.geometry.frame import canonical_priority
from nonrigid.geometry.geodesics import virtual_edge_graph
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.sampling import farthest_points


def unpruned(mesh: Mesh, count: int, start: int) -> IntArray:
    """Choose farthest points with a whole shortest-path tree a sample."""
    graph, priority = virtual_edge_graph(mesh), canonical_priority(mesh)
    samples, cover = [start], np.full(len(mesh.vertices), np.inf)
    while len(samples) < count:
        np.minimum(cover, dijkstra(graph, directed=True, indices=samples[-1:])[0], out=cover)
        tied = np.flatnonzero(cover >= cover.max() * (1 - 1e-9))
        samples.append(int(tied[priority[tied].argmax()]))
    return np.array(samples)


def main() -> None:
    """Time both, in CPU seconds, and compare their samples."""
    if len(sys.argv) > 1:
        mesh = clean(read_mesh(sys.argv[1])).mesh
    else:
        ball = trimesh.creation.icosphere(subdivisions=5)
        x, y, z = ball.vertices.T
        mesh = Mesh(np.c_[1.3 * x * (1 + 0.3 * z), y + 0.3 * z * z, 2 * z + 0.4 * y * y], ball.faces, name="bent ball")
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    begin = time.process_time()
    ours = farthest_points(mesh, count, metric="geodesic")
    middle = time.process_time()
    peer = unpruned(mesh, count, int(ours[0]))
    end = time.process_time()
    print(f"{mesh.name}: {len(mesh.vertices)} vertices, {count} samples")  # noqa: T201
    print(f"pruned    {middle - begin:8.3f} s")  # noqa: T201
    print(f"unpruned  {end - middle:8.3f} s   ratio {(end - middle) / (middle - begin):.1f}   (target >= 8)")  # noqa: T201
    print(f"same samples: {np.array_equal(ours, peer)}")  # noqa: T201


if __name__ == "__main__":
    main()
