"""Time nearest neighbours in a spectral embedding against scipy's search tree, when the functional map is noisy.

Rows of 100 eigenfunctions are compared with themselves after a map C = I + noise. Usage:
python benchmarks/nearest_neighbours.py [mesh]. Expect a ratio of at least 10 at 20 % noise, and the same answers.
"""

from __future__ import annotations

import sys
from time import process_time

import numpy as np
from bumpy_sphere import mesh_from_arguments
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from nonrigid.geometry.clean import clean
from nonrigid.geometry.maps import nearest_rows
from nonrigid.geometry.operators import laplacian
from nonrigid.geometry.spectrum import spectrum

DIMENSION = 100


def main() -> None:
    """Write a table of CPU seconds, one round for the tree and the best of three for the products."""
    mesh = clean(mesh_from_arguments()).mesh
    targets = spectrum(laplacian(mesh), DIMENSION).eigenfunctions
    noise = np.random.default_rng(0).standard_normal((DIMENSION, DIMENSION))
    write = sys.stdout.write
    write(f"{mesh.name}: {len(targets)} queries, {len(targets)} targets, {DIMENSION} dimensions, CPU seconds\n")
    write(f"{'noise':<8}{'cKDTree':>8}{'float32':>9}{'ratio':>7}{'float64':>9}{'ratio':>7}{'same answers':>15}\n")
    for share in (0.0, 0.05, 0.2):
        queries = targets @ (np.eye(DIMENSION) + share * noise)
        start = process_time()
        _, expected = cKDTree(targets).query(queries)
        tree = process_time() - start
        seconds, same = {}, True
        for dtype in (np.float32, np.float64):
            times = []
            for _ in range(3):
                start = process_time()
                found, _ = nearest_rows(queries, targets, dtype=dtype)
                times.append(process_time() - start)
            seconds[dtype] = min(times)
            same &= bool((found == expected).all())
        single, double = seconds[np.float32], seconds[np.float64]
        ratios = f"{single:9.2f}{tree / single:7.1f}{double:9.2f}{tree / double:7.1f}"
        write(f"{share:<8.0%}{tree:8.2f}{ratios}{'yes' if same else 'no':>15}\n")


if __name__ == "__main__":
    with threadpool_limits(1):  # CPU seconds of waiting threads would count
        main()
