from __future__ import annotations

import numpy as np
import pytest
import trimesh

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import closest_points, decimate


def test_two_balls_that_touch_are_not_decimated() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices, faces, count = np.asarray(ball.vertices), np.asarray(ball.faces), len(ball.vertices)
    assert len(decimate(Mesh(vertices, faces), 100).vertices) == 100
    others = faces + count - 1
    others[faces == 0] = 0
    touching = Mesh(np.vstack([vertices, vertices[1:] + 2.0 * vertices[0]]), np.vstack([faces, others]), name="balls")
    with pytest.raises(InputError, match="balls is not manifold: 1 vertices"):
        decimate(touching, 100)


def strip(length: int) -> Mesh:
    vertices = [(x, y, 0.01 * (x % 3)) for x in range(length) for y in (0, 1)]
    faces = [f for k in range(0, 2 * length - 2, 2) for f in ((k, k + 2, k + 1), (k + 1, k + 2, k + 3))]
    return Mesh(vertices, faces, name="strip")


def test_boundary_edges_do_not_take_more_vertices_than_asked() -> None:
    assert len(decimate(strip(100), 100).vertices) == pytest.approx(100, rel=0.1)
    loose = Mesh(np.vstack([strip(100).vertices, np.full((50, 3), 9.0)]), strip(100).faces)
    assert len(decimate(loose, 100).vertices) == pytest.approx(100, rel=0.1)


def test_places_that_are_not_finite_have_no_closest_point() -> None:
    found = closest_points(strip(3), np.array([[1.0, 0.5, 0.0], [np.nan, 0.0, 0.0], [0.0, np.inf, 0.0]]))
    assert found.matched.tolist() == [True, False, False]
    assert not closest_points(strip(3), np.full((2, 3), np.nan)).matched.any()
