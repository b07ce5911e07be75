import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.datasets.cuts import KEEPS, cut_by_plane, cut_planes, serving_planes
from nonrigid.benchmark.datasets.holes import grow_holes
from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.frame import canonical_frame
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import face_pieces, restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import decimate, isosurface


def lumpy(places: np.ndarray) -> np.ndarray:
    """Return a field whose zero set no rotation maps to itself."""
    x, y, z = places.T
    return np.sqrt(x**2 + 1.6 * y**2 + 2.3 * z**2) - 1.0 - 0.15 * x * y - 0.1 * z * (1 + x)


BALL = decimate(isosurface(lumpy, [-1.6] * 3, [1.6] * 3, 0.08), 600)
EVERY_VERTEX = SurfacePoints.at_vertices(BALL, np.arange(len(BALL.vertices)))


def shuffled(mesh: Mesh, seed: int) -> tuple[Mesh, np.ndarray, np.ndarray]:
    """Return the mesh renumbered, and the old numbers of its vertices and faces."""
    generator = np.random.default_rng(seed)
    vertex, face = generator.permutation(len(mesh.vertices)), generator.permutation(len(mesh.faces))
    return Mesh(mesh.vertices[vertex], np.argsort(vertex)[mesh.faces[face]]), vertex, face


@settings(max_examples=12, deadline=None)
@given(st.integers(1, 20), st.floats(0.5, 0.95), st.integers(0, 1000))
def test_holes_leave_one_piece_of_the_promised_area(holes: int, keep: float, seed: int) -> None:
    kept = grow_holes(BALL, holes=holes, keep=keep, seed=seed)
    part = restrict(BALL, kept)
    assert keep - BALL.face_areas.max() / BALL.area <= part.kept_area <= keep
    assert part.kept_area + part.missing_area == pytest.approx(1.0)
    assert face_pieces(part.mesh).max() == 0
    assert clean(part.mesh).repairs == ()
    np.testing.assert_array_equal(kept, grow_holes(BALL, holes=holes, keep=keep, seed=seed))


def test_impossible_holes_are_refused() -> None:
    with pytest.raises(InputError, match=r"keep is 1.5"):
        grow_holes(BALL, holes=3, keep=1.5, seed=0)
    with pytest.raises(InputError, match="cannot grow"):
        grow_holes(BALL, holes=300, keep=1e-9, seed=0)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000))
def test_neither_numbering_nor_place_changes_what_is_kept(seed: int) -> None:
    mesh, vertex, face = shuffled(BALL, seed)
    mesh = mesh.transformed(rotation=Rotation.random(rng=seed).as_matrix(), translation=[3.0, -2.0, 7.0], scale=4.0)
    holes = grow_holes(BALL, holes=5, keep=0.7, seed=seed)
    np.testing.assert_array_equal(grow_holes(mesh, holes=5, keep=0.7, seed=seed), holes[face])
    points, normals = serving_planes(BALL, 2, seed)
    moved_points, moved_normals = serving_planes(mesh, 2, seed)
    truth = SurfacePoints.at_vertices(mesh, np.arange(len(vertex)))
    for number in range(2):
        kept = cut_by_plane(BALL, EVERY_VERTEX, BALL, point=points[number], normal=normals[number])
        moved = cut_by_plane(mesh, truth, mesh, point=moved_points[number], normal=moved_normals[number])
        np.testing.assert_array_equal(moved, kept[face])


def test_a_frame_is_right_handed_and_orthonormal() -> None:
    _, axes = canonical_frame(BALL)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_cut_keeps_the_side_of_the_plane_that_the_truth_says() -> None:
    bent = Mesh(BALL.vertices * [1, 2, 1] + [0, 0, 7], BALL.faces)
    for point, normal in zip(*cut_planes(BALL, 4, 1), strict=True):
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        kept = cut_by_plane(bent, EVERY_VERTEX, BALL, point=point, normal=normal)
        used = np.unique(bent.faces[kept])
        assert ((BALL.vertices[used] - point) @ normal > 0).all()
        assert KEEPS[0] < BALL.face_areas[kept].sum() / BALL.area < KEEPS[1]
    with pytest.raises(InputError, match="leaves nothing"):
        cut_by_plane(bent, EVERY_VERTEX, BALL, point=np.array([9.0, 0, 0]), normal=np.array([1.0, 0, 0]))


def test_a_cut_of_a_cut_is_what_both_planes_keep() -> None:
    near = {"point": np.array([0.0, 0.0, 0.3]), "normal": np.array([0.0, 0.6, 0.8])}
    other = {"point": np.array([0.2, 0.0, 0.0]), "normal": np.array([1.0, 0.0, 0.0])}
    first = restrict(BALL, cut_by_plane(BALL, EVERY_VERTEX, BALL, **near))
    inside = EVERY_VERTEX[first.vertex_of_part]
    twice = first.then(restrict(first.mesh, cut_by_plane(first.mesh, inside, BALL, **other)))
    both = cut_by_plane(BALL, EVERY_VERTEX, BALL, **near) & cut_by_plane(BALL, EVERY_VERTEX, BALL, **other)
    np.testing.assert_array_equal(twice.face_of_part, np.flatnonzero(both))


def test_planes_that_hardly_cut_do_not_serve() -> None:
    with pytest.raises(InputError, match="of 200 planes"):
        serving_planes(BALL, 300, 0)
