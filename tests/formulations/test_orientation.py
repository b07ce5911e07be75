"""Patches that a map turns over: found, turned back from their rims, whatever the frame, the scale and the order."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.orientation import Orientation
from nonrigid.geometry.arrays import BoolArray, IntArray
from nonrigid.geometry.mesh import Mesh


def limb() -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=4)
    x, y, z = made.vertices.T
    return Mesh(np.c_[5 * x + 0.3 * y * y, y, 0.8 * z] * (1 + 0.1 * np.sin(4 * x + y))[:, None], made.faces)


LIMB = limb()
ALL = np.arange(len(LIMB.vertices))
MIDDLE = np.abs(LIMB.vertices[:, 0]) < 2.5
MIRRORED = np.asarray(cKDTree(LIMB.vertices).query(LIMB.vertices * [1, -1, 1])[1], dtype=np.int64)
WRONG = np.where(MIDDLE, MIRRORED, ALL)


def orientation(mesh: Mesh = LIMB, full: Mesh = LIMB, points: IntArray = ALL) -> Orientation:
    return Orientation.of(Pair.of(mesh, full), points)


def off(images: IntArray, among: BoolArray) -> float:
    """Return the mean distance to the truth, in units of sqrt(area)."""
    apart = np.linalg.norm(LIMB.vertices[images] - LIMB.vertices, axis=1)[among]
    return float(apart.mean() / np.sqrt(LIMB.area))


def test_a_limb_whose_front_and_back_are_exchanged_is_turned_back() -> None:
    found = orientation()
    over = found.turned_over(WRONG)
    inner, outer = np.abs(LIMB.vertices[:, 0]) < 2.2, np.abs(LIMB.vertices[:, 0]) > 2.8
    assert over[inner].mean() > 0.95
    assert not over[outer].any()
    back = found.turned_back(WRONG)
    assert off(WRONG, MIDDLE) > 0.1
    assert off(back, MIDDLE) < 0.015
    assert np.array_equal(back[outer], WRONG[outer])
    assert not found.turned_over(back).any()


@pytest.mark.parametrize("images", [ALL, MIRRORED], ids=["true", "mirrored"])
def test_a_map_of_one_orientation_is_left_alone(images: IntArray) -> None:
    found = orientation()
    assert found.sense(images).min() > 0.5
    assert np.array_equal(found.turned_back(images), images)


def test_a_patch_without_a_rim_stays_as_it_is() -> None:
    along = np.abs(LIMB.vertices[:, 0])
    points = np.r_[ALL[along > 2.8], ALL[along < 1.5][::3]]
    found = orientation(points=points)
    over = found.turned_over(WRONG[points])
    assert np.array_equal(over, along[points] < 1.5)
    assert np.array_equal(found.turned_back(WRONG[points]), WRONG[points])


def test_input_is_not_written_to() -> None:
    images = WRONG.copy()
    images.setflags(write=False)
    assert not np.array_equal(orientation().turned_back(images), images)


@given(seed=st.integers(0, 1000), scale=st.floats(0.01, 100.0))
@settings(max_examples=8, deadline=None)
def test_frames_scale_and_order_change_nothing(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.sort(rng.choice(ALL, 800, replace=False))
    expected = orientation(points=points).sense(WRONG[points])
    one, other = (Rotation.random(rng=rng).as_matrix() for _ in range(2))
    order = rng.permutation(len(points))
    found = orientation(
        Mesh(scale * LIMB.vertices @ one.T + rng.standard_normal(3), LIMB.faces),
        Mesh(scale * LIMB.vertices @ other.T + rng.standard_normal(3), LIMB.faces),
        points[order],
    )
    assert np.abs(found.sense(WRONG[points][order]) - expected[order]).max() < 1e-6
