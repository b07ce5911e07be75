"""A surface for benchmarks that needs no file: a sphere with bumps, without symmetry."""

from __future__ import annotations

import sys

import numpy as np
import trimesh

from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh


def bumpy_sphere(subdivisions: int = 5) -> Mesh:
    """Return an icosphere (10,242 vertices at 5 subdivisions) with radius 1 + three products of sines."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    radius = 1.0 + 0.2 * np.sin(3 * x + 1) * np.sin(4 * y) + 0.15 * np.sin(5 * z + 2 * x) + 0.1 * np.sin(7 * y + 3 * z)
    return Mesh(ball.vertices * radius[:, None], ball.faces, name="bumpy sphere")


def mesh_from_arguments() -> Mesh:
    """Return the mesh that the first command-line argument names, or else a bumpy sphere."""
    return read_mesh(sys.argv[1]) if len(sys.argv) > 1 else bumpy_sphere()
