from __future__ import annotations

import numpy as np
import pytest
import trimesh

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import decimate


def test_two_balls_that_touch_are_not_decimated() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices, faces, count = np.asarray(ball.vertices), np.asarray(ball.faces), len(ball.vertices)
    assert len(decimate(Mesh(vertices, faces), 100).vertices) == 100
    others = faces + count - 1
    others[faces == 0] = 0
    touching = Mesh(np.vstack([vertices, vertices[1:] + 2.0 * vertices[0]]), np.vstack([faces, others]), name="balls")
    with pytest.raises(InputError, match="balls is not manifold: 1 vertices"):
        decimate(touching, 100)
