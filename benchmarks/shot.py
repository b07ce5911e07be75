"""SHOT of all points at once, against a plain Python loop over points and neighbours.

Run: python benchmarks/shot.py [mesh.off]. Without a mesh, a bumpy ball of 10 242 vertices is used. The loop is timed on
40 points spread over the surface and extrapolated to all of them. It has no rule for a frame with as many neighbours on
either side, so a row or two may differ.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.clean import clean
from nonrigid.geometry.descriptors.shot import shot
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.sampling import farthest_points

BINS = 11


def shot_by_loop(mesh: Mesh, tree: cKDTree, vertex: int, radius: float) -> FloatArray:
    """Return the row of one vertex: the frame by numpy, the histogram one neighbour at a time."""
    near = np.array([q for q in tree.query_ball_point(mesh.vertices[vertex], radius) if q != vertex])
    offsets = mesh.vertices[near] - mesh.vertices[vertex]
    distances = np.linalg.norm(offsets, axis=1)
    weights = radius - distances
    axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)[1]
    x, z = axes[:, 2], axes[:, 0]
    x = x if np.sign(offsets @ x).sum() >= 0 else -x
    z = z if mesh.vertex_normals[vertex] @ z >= 0 else -z
    local = offsets @ np.stack([x, np.cross(z, x), z], axis=1)
    cosines = np.clip((1 + mesh.vertex_normals[near] @ z) / 2 * (BINS - 1), 0, BINS - 1)
    histogram = np.zeros((8, 2, 2, BINS))
    for k, q in enumerate(near):
        azimuth = (np.arctan2(local[k, 1], local[k, 0]) + np.pi) * 4 / np.pi - 0.5
        elevation = np.arccos(local[k, 2] / distances[k]) * 2 / np.pi - 0.5
        shell = distances[k] * 2 / radius - 0.5
        sector, low = int(np.floor(azimuth)), min(int(cosines[k]), BINS - 2)
        for i in (0, 1):
            at_azimuth = mesh.vertex_areas[q] * (1 - abs(azimuth - sector - i))
            for j in (0, 1):
                at_elevation = at_azimuth * max(0.0, 1 - abs(elevation - j))
                for r in (0, 1):
                    at_shell = at_elevation * max(0.0, 1 - abs(shell - r))
                    histogram[(sector + i) % 8, j, r, low] += at_shell * (low + 1 - cosines[k])
                    histogram[(sector + i) % 8, j, r, low + 1] += at_shell * (cosines[k] - low)
    return np.asarray(histogram.ravel() / np.linalg.norm(histogram))


def bumpy_ball() -> Mesh:
    """Return a closed surface without symmetry."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    x, y, z = ball.vertices.T
    wave = 0.12 * np.sin(5 * x + 2 * y) + 0.1 * np.cos(4 * z - 3 * y * x)
    return Mesh(np.c_[1.2 * x, y + 0.2 * x * z, 1.5 * z] * (1 + wave)[:, None], ball.faces, name="bumpy ball")


def main() -> None:
    """Time both, in CPU seconds, and compare their rows."""
    mesh = clean(read_mesh(sys.argv[1])).mesh if len(sys.argv) > 1 else bumpy_ball()
    n = len(mesh.vertices)
    tree, sample = cKDTree(mesh.vertices), farthest_points(mesh, 40)
    print(f"{mesh.name}: {n} vertices; radius in sqrt(area); loop extrapolated from {len(sample)} points")  # noqa: T201
    print("radius   neighbours   all at once [s]   us/pair   loop [s]   ratio (target >= 20)   equal to 1e-12")  # noqa: T201
    for share in (0.05, 0.10):
        radius = share * np.sqrt(mesh.area)
        pairs = int(tree.query_ball_point(mesh.vertices, radius, return_length=True).sum()) - n
        begin = time.process_time()
        rows = shot(mesh, radius, cosine_bins=BINS)
        ours = time.process_time() - begin
        begin = time.process_time()
        looped = np.array([shot_by_loop(mesh, tree, int(vertex), radius) for vertex in sample])
        peer = (time.process_time() - begin) * n / len(sample)
        equal = int((np.abs(looped - rows[sample]).max(axis=1) < 1e-12).sum())
        print(  # noqa: T201
            f"{share:6.2f}   {pairs / n:10.0f}   {ours:15.2f}   {ours / pairs * 1e6:7.2f}   {peer:8.1f}   "
            f"{peer / ours:21.0f}   {equal:8d} of {len(sample)}"
        )


if __name__ == "__main__":
    main()
