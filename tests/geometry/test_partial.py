import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import face_pieces, largest_piece, restrict
from nonrigid.geometry.points import SurfacePoints


def grid(n: int) -> Mesh:
    """Return a square of n x n vertices, bent a little, so that triangles have different areas."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    return Mesh(np.stack([x, y, 0.1 * x * x + 0.2 * np.sin(y)], 1), faces)


MASKS = st.lists(st.booleans(), min_size=50, max_size=50).filter(any)


@given(MASKS)
def test_area_is_accounted_for(mask: list[bool]) -> None:
    part = restrict(grid(6), np.array(mask))
    assert part.kept_area + part.missing_area == pytest.approx(1.0)


@given(MASKS)
def test_numbers_lead_back_to_the_same_triangles(mask: list[bool]) -> None:
    mesh = grid(6)
    part = restrict(mesh, np.array(mask))
    np.testing.assert_array_equal(part.vertex_of_part[part.mesh.faces], mesh.faces[part.face_of_part])
    np.testing.assert_array_equal(part.mesh.vertices, mesh.vertices[part.vertex_of_part])
    np.testing.assert_array_equal(part.vertex_of_whole[part.vertex_of_part], np.arange(len(part.mesh.vertices)))


@given(MASKS, st.integers(0, 49))
def test_a_cut_of_a_cut_is_a_cut(mask: list[bool], first: int) -> None:
    mesh = grid(6)
    outer = restrict(mesh, np.array(mask))
    inner_mask = np.arange(len(outer.mesh.faces)) >= first % len(outer.mesh.faces)
    twice = outer.then(restrict(outer.mesh, inner_mask))
    whole_mask = np.zeros(50, dtype=bool)
    whole_mask[outer.face_of_part[inner_mask]] = True
    once = restrict(mesh, whole_mask)
    np.testing.assert_array_equal(twice.vertex_of_part, once.vertex_of_part)
    np.testing.assert_array_equal(twice.mesh.faces, once.mesh.faces)
    assert twice.kept_area == pytest.approx(once.kept_area)


def test_points_go_to_the_part_and_back() -> None:
    mesh = grid(4)
    part = restrict(mesh, np.arange(18) % 3 > 0)
    points = SurfacePoints(np.arange(18), np.full((18, 3), 1 / 3))
    moved = part.to_part(points)
    np.testing.assert_array_equal(moved.matched, np.arange(18) % 3 > 0)
    kept = moved.matched
    np.testing.assert_allclose(moved[kept].positions(part.mesh), points[kept].positions(mesh))
    np.testing.assert_array_equal(part.to_whole(moved).faces[kept], np.flatnonzero(kept))


def test_a_shared_vertex_does_not_join_pieces() -> None:
    bow = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-2, 0, 0], [0, -2, 0]], [[0, 1, 2], [0, 3, 4]])
    np.testing.assert_array_equal(face_pieces(bow), [1, 0])
    np.testing.assert_array_equal(face_pieces(bow, np.array([True, False])), [0, -1])


def test_largest_piece_is_by_area_not_by_count() -> None:
    mesh = grid(6)
    stretched = Mesh(mesh.vertices * np.where(mesh.vertices[:, :1] > 3.5, 10.0, 1.0), mesh.faces)
    column = mesh.vertices[mesh.faces][:, :, 0].max(axis=1)
    keep = column != 4
    assert set(column[largest_piece(stretched, keep)]) == {5}
    assert set(column[largest_piece(mesh, keep)]) == {1, 2, 3}


def test_bad_masks_are_refused() -> None:
    with pytest.raises(InputError, match="no face"):
        restrict(grid(3), np.zeros(8, dtype=bool))
    with pytest.raises(InputError, match="8 faces"):
        restrict(grid(3), np.ones(7, dtype=bool))
    with pytest.raises(InputError, match="int64"):
        restrict(grid(3), np.array([0, 1]))


def test_points_outside_their_triangle_or_mesh_are_refused() -> None:
    with pytest.raises(InputError, match="row 1: a barycentric weight is -4; give points inside"):
        SurfacePoints([0], [[5.0, -4.0, 0.0]])
    triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="vertex 9 is not one of the 3"):
        SurfacePoints.at_vertices(triangle, [9])
