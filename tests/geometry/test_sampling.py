"""Farthest points: known answers, and the same samples in every frame, scale and order."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.transform import Rotation

from nonrigid.geometry.arrays import IntArray
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.frame import canonical_priority
from nonrigid.geometry.geodesics import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.sampling import farthest_points


def mirror_symmetric() -> Mesh:
    """Return a closed blob that the plane x = 0, and no other, mirrors onto itself."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = ball.vertices.T
    bent = np.c_[1.3 * x * (1.0 + 0.3 * z), y + 0.3 * z * z, 2.0 * z + 0.4 * y * y]
    return Mesh(bent, ball.faces)


def shuffled(mesh: Mesh, seed: int) -> tuple[Mesh, IntArray]:
    """Return the mesh in another frame, scale and order, and the old number of each new vertex."""
    rng = np.random.default_rng(seed)
    old = rng.permutation(len(mesh.vertices))
    new = np.argsort(old)
    faces = np.roll(new[mesh.faces][rng.permutation(len(mesh.faces))], rng.integers(3), axis=1)
    moved = Mesh(mesh.vertices[old], faces).transformed(
        rotation=Rotation.random(None, rng).as_matrix(),
        translation=rng.normal(size=3),
        scale=float(rng.uniform(0.01, 90)),
    )
    return moved, old


BLOB = mirror_symmetric()


@pytest.mark.parametrize("metric", ["euclidean", "geodesic"])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_samples_ignore_frame_scale_and_order_on_a_mirror_symmetric_shape(metric: str, seed: int) -> None:
    moved, old = shuffled(BLOB, seed)
    np.testing.assert_array_equal(
        old[farthest_points(moved, 120, metric=metric)], farthest_points(BLOB, 120, metric=metric)
    )


def test_priority_is_invariant_and_tells_mirror_images_apart() -> None:
    moved, old = shuffled(BLOB, 7)
    np.testing.assert_allclose(canonical_priority(moved), canonical_priority(BLOB)[old], atol=1e-10)
    mirrored = np.linalg.norm(BLOB.vertices[:, None] * [-1, 1, 1] - BLOB.vertices, axis=2).argmin(axis=1)
    off_plane = np.abs(BLOB.vertices[:, 0]) > 1e-6
    gap = np.abs(canonical_priority(BLOB) - canonical_priority(BLOB)[mirrored])
    assert off_plane.sum() > 500
    assert gap[off_plane].min() > 1e-4


def test_samples_of_a_strip_are_the_ends_then_the_middles() -> None:
    x = np.arange(9.0)
    vertices = np.r_[np.c_[x, 0 * x, 0 * x], np.c_[x, 0 * x + 0.1, 0 * x]]
    lower = np.arange(8)
    faces = np.r_[np.c_[lower, lower + 1, lower + 10], np.c_[lower, lower + 10, lower + 9]]
    samples = farthest_points(Mesh(vertices, faces), 5, start=0)
    np.testing.assert_array_equal(vertices[samples[:3], 0], [0, 8, 4])
    assert set(vertices[samples[3:], 0]) == {2.0, 6.0}


def test_pruning_changes_no_geodesic_sample() -> None:
    graph, start = virtual_edge_graph(BLOB), 5
    plain, cover, priority = [start], np.full(len(BLOB.vertices), np.inf), canonical_priority(BLOB)
    for _ in range(79):
        cover = np.minimum(cover, dijkstra(graph, indices=plain[-1]))
        tied = np.flatnonzero(cover >= cover.max() * (1 - 1e-9))
        plain.append(int(tied[priority[tied].argmax()]))
    np.testing.assert_array_equal(farthest_points(BLOB, 80, metric="geodesic", start=start), plain)


def test_every_vertex_is_taken_once_even_where_two_share_a_place_or_a_piece_lies_apart() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 3]], dtype=float)
    pieces = Mesh(corners, [[0, 1, 2], [3, 4, 5]])
    for metric in ("euclidean", "geodesic"):
        assert sorted(farthest_points(pieces, 6, metric=metric)) == list(range(6))
    first_two = farthest_points(pieces, 2, metric="geodesic")
    assert set(first_two // 3) == {0, 1}


def test_bad_requests_are_refused_with_the_number() -> None:
    with pytest.raises(InputError, match="0 samples of 642"):
        farthest_points(BLOB, 0)
    with pytest.raises(InputError, match="start vertex 642"):
        farthest_points(BLOB, 3, start=642)
    with pytest.raises(UnknownNameError, match="diffusion"):
        farthest_points(BLOB, 3, metric="diffusion")  # type: ignore[arg-type]
