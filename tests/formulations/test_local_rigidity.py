"""Images that move as their neighbours do: rigid motions stay, outliers go, and no frame, order or scale matters."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nonrigid.formulations.local_rigidity import locally_rigid
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.mesh import Mesh


def body() -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = made.vertices.T
    return Mesh(
        made.vertices * (1 + 0.3 * np.sin(3 * x + 1) * np.cos(2 * y) + 0.2 * np.sin(4 * z + x))[:, None], made.faces
    )


BODY = body()
ALL = np.arange(len(BODY.vertices))


def moved(images: FloatArray, mesh: Mesh = BODY, scale: float = 1.0) -> FloatArray:
    return locally_rigid(
        mesh.vertices, mesh.vertex_normals, images, among=ALL, reach=0.3 * scale, tolerance=0.03 * scale
    )


@pytest.mark.parametrize("reflected", [False, True])
def test_a_rigid_motion_is_returned_as_it_is(reflected: bool) -> None:
    turn = Rotation.random(rng=3).as_matrix() * (-1.0 if reflected else 1.0)
    images = BODY.vertices @ turn.T + [4.0, -2.0, 1.0]
    assert np.abs(moved(images) - images).max() < 1e-12


def test_noise_shrinks_and_outliers_go_back_to_their_place() -> None:
    rng = np.random.default_rng(0)
    noisy = BODY.vertices + 0.02 * rng.standard_normal(BODY.vertices.shape)
    assert np.linalg.norm(moved(noisy) - BODY.vertices, axis=1).mean() < 0.5 * 0.02
    lost = rng.choice(ALL, 30, replace=False)
    wrong = BODY.vertices.copy()
    wrong[lost] += 1.5
    assert np.abs(moved(wrong) - BODY.vertices).max() < 0.01


def test_the_other_side_of_a_thin_plate_does_not_count() -> None:
    plate = trimesh.creation.box((1.0, 1.0, 0.01)).subdivide_loop(0)
    for _ in range(4):
        plate = plate.subdivide()
    mesh = Mesh(plate.vertices, plate.faces)
    inner = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.3)
    top = mesh.vertices[:, 2] > 0.0
    images = mesh.vertices + np.where(top, 1.0, -1.0)[:, None] * [0.2, 0.0, 0.0]
    found = locally_rigid(
        mesh.vertices, mesh.vertex_normals, images, among=np.arange(len(images)), reach=0.1, tolerance=10.0
    )
    assert len(inner) > 20
    assert np.abs(found - images)[inner].max() < 1e-6


@given(seed=st.integers(0, 1000), scale=st.floats(0.01, 100.0))
@settings(max_examples=10, deadline=None)
def test_frames_scale_and_order_change_nothing(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    images = BODY.vertices + 0.05 * rng.standard_normal(BODY.vertices.shape)
    expected = moved(images)
    one, other = (Rotation.random(rng=rng).as_matrix() for _ in range(2))
    mesh = Mesh(scale * BODY.vertices @ one.T + rng.standard_normal(3), BODY.faces)
    shift = rng.standard_normal(3)
    turned = moved(scale * images @ other.T + shift, mesh, scale)
    assert np.abs((turned - shift) @ other / scale - expected).max() < 1e-6
    order = rng.permutation(len(ALL))
    mixed = locally_rigid(
        BODY.vertices[order], BODY.vertex_normals[order], images[order], among=ALL, reach=0.3, tolerance=0.03
    )
    assert np.abs(mixed - expected[order]).max() < 1e-9


def test_thinned_neighbours_are_enough_and_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    images = BODY.vertices + 0.02 * rng.standard_normal(BODY.vertices.shape)
    whole = moved(images)
    monkeypatch.setattr("nonrigid.formulations.local_rigidity._BLOCK", 100)
    assert np.array_equal(moved(images), whole)
    few = locally_rigid(BODY.vertices, BODY.vertex_normals, images, among=ALL[::3], reach=0.3, tolerance=0.03)
    assert np.linalg.norm(few - BODY.vertices, axis=1).mean() < 0.02
    alone = locally_rigid(BODY.vertices, BODY.vertex_normals, images, among=ALL[:1], reach=0.3, tolerance=0.03)
    assert np.isfinite(alone).all()
