"""Certified distances: the formula, pair by pair, and what it promises."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from nonrigid.geometry.certificates import certified_pairs
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics import make_geodesics
from nonrigid.geometry.mesh import Mesh

BALL = trimesh.creation.icosphere(subdivisions=3)
WHOLE = Mesh(BALL.vertices, BALL.faces)


def holed(height: float) -> tuple[Mesh, np.ndarray]:
    """Return the sphere below a height, and the whole sphere's number of each of its vertices."""
    faces = WHOLE.faces[(WHOLE.vertices[WHOLE.faces][:, :, 2] < height).all(axis=1)]
    kept, numbers = np.unique(faces, return_inverse=True)
    return Mesh(WHOLE.vertices[kept], numbers.reshape(-1, 3)), kept


def test_the_chord_test_is_the_minimum_over_all_pairs_of_boundary_vertices() -> None:
    part, _ = holed(0.3)
    sources = np.arange(0, len(part.vertices), 17)
    d = make_geodesics(part, "dijkstra").distances(sources)
    boundary = part.boundary_vertices
    chords = np.linalg.norm(part.vertices[boundary][:, None] - part.vertices[boundary], axis=2)
    expected = np.empty((len(sources), len(sources)), dtype=bool)
    for i in range(len(sources)):
        for j in range(len(sources)):
            bound = (d[i, boundary][:, None] + chords + d[j, boundary]).min()
            expected[i, j] = d[i, sources[j]] <= bound * (1 + 1e-9)
    found = certified_pairs(part, d, sources)
    np.testing.assert_array_equal(found, expected | np.eye(len(sources), dtype=bool))
    np.testing.assert_array_equal(certified_pairs(part, d[:, sources], sources), found)
    assert 0.2 < found.mean() < 0.98


def test_a_certified_distance_is_the_distance_on_the_whole() -> None:
    part, kept = holed(0.3)
    sources = np.arange(0, len(part.vertices), 7)
    on_part = make_geodesics(part, "exact").distances(sources)
    on_whole = make_geodesics(WHOLE, "exact").distances(kept[sources])[:, kept[sources]]
    longest = np.linalg.norm(np.subtract(*part.vertices[part.boundary_edges.T]), axis=1).max()
    certified = certified_pairs(part, on_part, sources, margin=2 * longest)
    stretched = on_part[:, sources] > on_whole * (1 + 1e-9)
    assert stretched.any()
    assert not (certified & stretched).any()
    assert certified.mean() > 0.15


def test_without_boundary_every_pair_is_certified() -> None:
    sources = np.array([0, 5, 99])
    d = make_geodesics(WHOLE, "dijkstra").distances(sources)
    assert certified_pairs(WHOLE, d, sources).all()
    assert certified_pairs(WHOLE, d[:, sources], sources).all()


def test_a_wrong_shape_is_refused_with_the_right_ones() -> None:
    with pytest.raises(InputError, match=r"\(2, 5\).*\(2, 642\) or \(2, 2\)"):
        certified_pairs(WHOLE, np.zeros((2, 5)), [0, 1])
