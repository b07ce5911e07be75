"""SHOT against a plain loop, and its invariances."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.clean import clean
from nonrigid.geometry.descriptors.shot import shot
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh


def blob() -> Mesh:
    """Return a closed surface without any symmetry."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = ball.vertices.T
    wave = 0.12 * np.sin(5 * x + 2 * y) + 0.1 * np.cos(4 * z - 3 * y * x)
    return Mesh(np.c_[1.2 * x, y + 0.2 * x * z, 1.5 * z] * (1 + wave)[:, None], ball.faces)


BLOB = blob()
RADIUS = 0.15 * np.sqrt(BLOB.area)


def frame_by_loop(mesh: Mesh, vertex: int, radius: float, z_sign: str) -> tuple[FloatArray, list[int]]:
    """Return the axes as rows, and the neighbours."""
    here = mesh.vertices[vertex]
    near = [q for q in range(len(mesh.vertices)) if 0 < np.linalg.norm(mesh.vertices[q] - here) < radius]
    covariance, total = np.zeros((3, 3)), 0.0
    for q in near:
        offset = mesh.vertices[q] - here
        weight = radius - np.linalg.norm(offset)
        covariance += weight * np.outer(offset, offset)
        total += weight
    axes = np.linalg.eigh(covariance / total)[1]

    def majority(axis: FloatArray) -> FloatArray:
        sides = [np.sign((mesh.vertices[q] - here) @ axis) for q in near]
        if sum(sides) == 0:
            sides = [
                (radius - np.linalg.norm(mesh.vertices[q] - here)) * (mesh.vertices[q] - here) @ axis for q in near
            ]
        return axis if sum(sides) >= 0 else -axis

    x, z = majority(axes[:, 2]), majority(axes[:, 0])
    if z_sign == "normal" and z @ mesh.vertex_normals[vertex] < 0:
        z = -z
    return np.array([x, np.cross(z, x), z]), near


def shot_by_loop(
    mesh: Mesh, vertex: int, radius: float, bins: int, interpolation: str, z_sign: str, area_weighted: bool
) -> FloatArray:
    frame, near = frame_by_loop(mesh, vertex, radius, z_sign)
    histogram = np.zeros((8, 2, 2, bins))
    for q in near:
        x, y, z = frame @ (mesh.vertices[q] - mesh.vertices[vertex])
        distance = np.sqrt(x * x + y * y + z * z)
        places = (
            (np.degrees(np.arctan2(y, x)) + 180) / 45 - 0.5,
            (np.degrees(np.arccos(z / distance)) - 45) / 90,
            (distance - radius / 4) / (radius / 2),
            (1 + frame[2] @ mesh.vertex_normals[q]) / 2 * (bins - 1),
        )
        lasts = (None, 1, 1, bins - 1)
        own, beside, rest = [], [], []
        for place, last in zip(places, lasts, strict=True):
            nearest = int(np.floor(place + 0.5))
            if last is not None:
                nearest = min(max(nearest, 0), last)
            other = nearest + (1 if place >= nearest else -1)
            own.append(nearest % 8 if last is None else nearest)
            beside.append(other % 8 if last is None else other if 0 <= other <= last else None)
            rest.append(abs(place - nearest))
        area = mesh.vertex_areas[q] if area_weighted else 1.0
        if interpolation == "additive":
            histogram[tuple(own)] += area * sum(1 - r for r in rest)
            for direction in range(4):
                if beside[direction] is not None:
                    cell = [*own[:direction], beside[direction], *own[direction + 1 :]]
                    histogram[tuple(cell)] += area * rest[direction]
            continue
        for choice in itertools.product((0, 1), repeat=4):
            cell = [(own, beside)[c][k] for k, c in enumerate(choice)]
            if None not in cell:
                histogram[tuple(cell)] += area * np.prod([(1 - rest[k], rest[k])[c] for k, c in enumerate(choice)])
    return histogram.ravel() / np.linalg.norm(histogram)


@pytest.mark.parametrize("z_sign", ["normal", "majority"])
@pytest.mark.parametrize("area_weighted", [True, False])
@pytest.mark.parametrize("interpolation", ["quadrilinear", "additive"])
def test_rows_equal_a_loop_over_neighbours(interpolation: str, area_weighted: bool, z_sign: str) -> None:
    at = np.array([600, 3, 77, 200, 345, 501])
    bins = 10 if z_sign == "majority" else 11
    found = shot(
        BLOB,
        RADIUS,
        at=at,
        cosine_bins=bins,
        interpolation=interpolation,
        z_sign=z_sign,
        area_weighted=area_weighted,  # type: ignore[arg-type]
    )
    for row, vertex in zip(found, at, strict=True):
        expected = shot_by_loop(BLOB, int(vertex), RADIUS, bins, interpolation, z_sign, area_weighted)
        np.testing.assert_allclose(row, expected, atol=1e-12)


def test_rows_have_the_shape_and_length_promised_and_chunks_change_rounding_only() -> None:
    whole = shot(BLOB, RADIUS)
    assert whole.shape == (642, 352)
    np.testing.assert_allclose(np.linalg.norm(whole, axis=1), 1.0)
    assert (whole >= 0).all()
    np.testing.assert_allclose(shot(BLOB, RADIUS, pairs_per_chunk=50), whole, atol=1e-12)
    np.testing.assert_allclose(shot(BLOB, RADIUS, at=[9, 4]), whole[[9, 4]], atol=1e-12)
    assert shot(BLOB, RADIUS, at=np.zeros(0, dtype=int), cosine_bins=2).shape == (0, 64)


def test_fewer_than_five_neighbours_give_a_zero_row() -> None:
    shortest = np.linalg.norm(np.subtract(*BLOB.vertices[BLOB.edges.T]), axis=1).min()
    assert not shot(BLOB, 0.9 * shortest).any()
    fan = np.array([[0, 0, 0], [1, 0, 0.1], [0, 1, 0.2], [-1, 0, 0.1], [0, -1, 0.3], [9, 9, 9], [9, 9, 8], [9, 8, 9]])
    mesh = Mesh(fan, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 6, 7]])
    assert not shot(mesh, 2.5).any()


@pytest.mark.parametrize("interpolation", ["quadrilinear", "additive"])
def test_rigid_motion_scale_and_order_leave_nearly_all_rows_alone(interpolation: str) -> None:
    rng = np.random.default_rng(5)
    order = rng.permutation(642)
    moved = Mesh(BLOB.vertices[order], np.argsort(order)[BLOB.faces]).transformed(
        rotation=Rotation.random(None, rng).as_matrix(), translation=[5, -3, 9], scale=37.0
    )
    before = shot(BLOB, RADIUS, interpolation=interpolation)[order]  # type: ignore[arg-type]
    after = shot(moved, 37.0 * RADIUS, interpolation=interpolation)  # type: ignore[arg-type]
    assert (np.abs(after - before).max(axis=1) < 1e-6).mean() >= 0.97


def test_a_mirrored_surface_has_other_rows() -> None:
    mirrored = Mesh(BLOB.vertices * [-1, 1, 1], BLOB.faces[:, ::-1])
    gap = np.linalg.norm(shot(mirrored, RADIUS) - shot(BLOB, RADIUS), axis=1)
    assert np.median(gap) > 0.1


def test_senseless_requests_are_refused() -> None:
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match=f"radius is {radius}"):
            shot(BLOB, radius)
    with pytest.raises(InputError, match="1 cosine bins"):
        shot(BLOB, RADIUS, cosine_bins=1)
    with pytest.raises(InputError, match="vertex 642"):
        shot(BLOB, RADIUS, at=[642])
    with pytest.raises(UnknownNameError, match="trilinear"):
        shot(BLOB, RADIUS, interpolation="trilinear")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="up"):
        shot(BLOB, RADIUS, z_sign="up")  # type: ignore[arg-type]


@pytest.mark.realdata
def test_rigid_motion_leaves_nearly_all_rows_of_a_real_shape_alone(data: Path) -> None:
    mesh = clean(read_mesh(data / "shrec16" / "null" / "wolf.off")).mesh
    radius = 0.06 * np.sqrt(mesh.area)
    turned = mesh.transformed(rotation=Rotation.random(None, np.random.default_rng(2)).as_matrix(), translation=50.0)
    same = np.abs(shot(mesh, radius) - shot(turned, radius)).max(axis=1) < 1e-6
    assert same.mean() >= 0.97
