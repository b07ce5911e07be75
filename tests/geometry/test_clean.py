"""The clean view is manifold, oriented and connected, and its maps lead back to the file's numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nonrigid.geometry.clean import CleanMesh, clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


def ball(subdivisions: int = 2) -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(made.vertices, made.faces, name="ball")


def assert_sound(view: CleanMesh) -> None:
    """Check manifoldness by gluing corners across edges: each vertex must be exactly one glued fan."""
    faces, n = view.mesh.faces, len(view.mesh.vertices)
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    here, twin = start * n + end, end * n + start
    assert len(np.unique(here)) == len(here), "two faces run an edge the same way"
    order = np.argsort(here)
    place = np.minimum(np.searchsorted(here[order], twin), len(here) - 1)
    inner = np.flatnonzero(here[order][place] == twin)
    other = order[place[inner]]
    following = lambda corner: 3 * (corner // 3) + (corner + 1) % 3  # noqa: E731
    i, j = np.concatenate([inner, following(inner)]), np.concatenate([following(other), other])
    glued = coo_array((np.ones(len(i)), (i, j)), shape=(faces.size, faces.size))
    assert connected_components(glued, directed=False)[0] == n
    assert view.mesh.component_of_vertex.max() == 0
    # and the maps agree with the geometry
    assert np.array_equal(view.mesh.vertices, view.raw.vertices[view.raw_of_vertex])
    assert np.array_equal(np.sort(view.raw_of_vertex[faces]), np.sort(view.raw.faces[view.raw_of_face]))
    kept = view.vertex_of_raw >= 0
    assert np.array_equal(view.raw_of_vertex[view.vertex_of_raw[kept]], np.flatnonzero(kept))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("fx,fx->", a, np.cross(b, c)) / 6)


def test_a_sound_mesh_is_left_alone() -> None:
    mesh = ball()
    view = clean(mesh)
    assert view.repairs == ()
    assert np.array_equal(view.mesh.vertices, mesh.vertices)
    assert np.array_equal(view.mesh.faces, mesh.faces)


def test_windings_are_made_consistent_and_outward_in_every_frame_and_order() -> None:
    mesh, generator = ball(), np.random.default_rng(1)
    rotation = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    for _ in range(3):
        faces = mesh.faces.copy()
        turned = generator.random(len(faces)) < 0.7
        faces[turned] = faces[turned, ::-1]
        number = generator.permutation(len(mesh.vertices))
        vertices = np.empty_like(mesh.vertices)
        vertices[number] = mesh.vertices @ rotation.T + 50.0
        view = clean(Mesh(vertices, generator.permutation(number[faces])))
        assert_sound(view)
        assert volume(view.mesh) > 0


def test_an_inside_out_part_of_a_sphere_is_turned_and_a_flat_part_keeps_its_side() -> None:
    mesh = ball(3)
    most = mesh.vertices[mesh.faces][:, :, 2].min(axis=1) > -0.5
    view = clean(Mesh(mesh.vertices, mesh.faces[most][:, ::-1]))
    corners = view.mesh.vertices[view.mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fx,fx->f", outward, corners.mean(axis=1)) > 0).all()

    flat = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, -1, 0]], [[2, 1, 0], [3, 2, 0], [0, 4, 1]])
    assert clean(flat).repairs == ("reversed 1 face",)
    assert clean(flat).mesh.faces[0].tolist() == [2, 1, 0]


def test_doubled_triangles_are_dropped_once_or_twice() -> None:
    mesh = ball(1)
    tip = len(mesh.vertices)
    a, b, c = mesh.faces[0]
    fold = [[a, b, tip], [b, a, tip]]
    vertices = np.vstack([mesh.vertices, [[2.0, 2.0, 2.0]]])
    view = clean(Mesh(vertices, np.vstack([mesh.faces, [[b, c, a]], fold])))
    assert_sound(view)
    assert len(view.mesh.faces) == len(mesh.faces)
    assert view.vertex_of_raw[tip] == -1
    assert view.repairs == ("dropped 3 doubled triangles", "dropped 1 vertex without a face")


def test_a_pinched_vertex_is_split_in_raw_order() -> None:
    mesh = ball(2)
    around = [f for f in range(len(mesh.faces)) if 0 in mesh.faces[f]]
    rest = np.setdiff1d(np.arange(len(mesh.faces)), [around[0], around[1]])
    neighbours = set(mesh.faces[around[0]]) & set(mesh.faces[around[1]])
    if len(neighbours) == 2:  # take two faces that share only vertex 0: two fans remain there
        around[1] = next(f for f in around if len(set(mesh.faces[f]) & set(mesh.faces[around[0]])) == 1)
        rest = np.setdiff1d(np.arange(len(mesh.faces)), [around[0], around[1]])
    view = clean(Mesh(mesh.vertices, mesh.faces[rest]))
    assert_sound(view)
    assert view.repairs == ("split 1 vertex of several fans into 2",)
    assert view.raw_of_vertex.tolist() == sorted(view.raw_of_vertex.tolist())
    first, second = np.flatnonzero(view.raw_of_vertex == 0)
    assert view.vertex_of_raw[0] == first
    assert view.mesh.vertex_areas[first] >= view.mesh.vertex_areas[second]


def test_an_edge_of_three_triangles_is_cut_and_a_one_sided_band_opened() -> None:
    fin = Mesh([*ball(2).vertices, [0, 0, 1.2]], [*ball(2).faces, [*ball(2).faces[0][:2], len(ball(2).vertices)]])
    assert_sound(clean(fin))
    steps = np.arange(12)
    angle = 2 * np.pi * steps / 12
    rim = [
        np.column_stack([(3 + s * np.cos(angle / 2)) * np.cos(angle), (3 + s * np.cos(angle / 2)) * np.sin(angle),
                         s * np.sin(angle / 2)])
        for s in (-1, 1)
    ]  # fmt: skip
    low, high = steps, steps + 12
    low_next, high_next = np.append(low[1:], 12), np.append(high[1:], 0)
    band = Mesh(np.vstack(rim), np.vstack([np.c_[low, low_next, high], np.c_[low_next, high_next, high]]))
    view = clean(band)
    assert_sound(view)
    assert "cut the surface open, because it has only one side" in view.repairs


def test_small_islands_are_recorded_and_large_ones_refused() -> None:
    mesh = ball(2)
    n = len(mesh.vertices)
    tip = mesh.vertices[5]
    hung = Mesh(np.vstack([mesh.vertices, tip + 0.1 * np.eye(3)[:2]]), [*mesh.faces, [5, n, n + 1]])
    view = clean(hung)
    assert_sound(view)
    assert view.repairs[0].startswith("dropped 1 piece that no edge joins to the rest, 0.0004")
    assert view.vertex_of_raw[5] >= 0
    assert (view.vertex_of_raw[n:] == -1).all()

    two = Mesh(np.vstack([mesh.vertices, mesh.vertices + 5]), np.vstack([mesh.faces, mesh.faces + n]), name="two")
    with pytest.raises(InputError, match=r"two: .* 2 pieces .* 50\.0%, 50\.0% of the area; keep one piece"):
        clean(two)
    halves = Mesh(np.vstack([mesh.vertices, mesh.vertices]), np.vstack([mesh.faces[:160], mesh.faces[160:] + n]))
    with pytest.raises(InputError, match="vertices lie in the place of another"):
        clean(halves)


def test_nothing_left_is_refused() -> None:
    with pytest.raises(InputError, match="total area is zero"):
        clean(Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
    with pytest.raises(InputError, match="no face is left: dropped 2 doubled triangles"):
        clean(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [1, 0, 2]]))


def test_points_keep_their_place_in_both_directions() -> None:
    mesh, generator = ball(2), np.random.default_rng(2)
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    raw = Mesh(mesh.vertices, np.vstack([[[0, 0, 1]], faces]))
    view = clean(raw)
    points = SurfacePoints([*generator.integers(1, len(faces), 50), -1], generator.dirichlet([1, 1, 1], 51))
    there = view.from_raw(points)
    np.testing.assert_allclose(there.positions(view.mesh)[:50], points.positions(raw)[:50], atol=1e-15)
    back = view.to_raw(there)
    assert np.array_equal(back.faces, points.faces)
    np.testing.assert_allclose(back.barycentric, points.barycentric, atol=1e-15)
    assert view.from_raw(SurfacePoints([0], [[1, 0, 0]])).faces.tolist() == [-1]


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["null/cat", "null/david", "holes/holes_wolf_shape_1", "holes/holes_victoria_shape_4"])
def test_defective_real_meshes_come_out_sound(data: Path, name: str) -> None:
    view = clean(read_mesh(data / "shrec16" / f"{name}.off"))
    assert view.repairs
    assert_sound(view)


def test_triangles_that_share_no_vertex_are_refused_however_small_each_is() -> None:
    whole = ball(3)
    soup = Mesh(whole.vertices[whole.faces].reshape(-1, 3), np.arange(whole.faces.size).reshape(-1, 3))
    with pytest.raises(InputError, match=r"falls into 1280 pieces .* are not merged.*merge vertices"):
        clean(soup)
