from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.aggregate import by_partiality, summarize
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.metric import errors_of_both, geodesic_errors, point_distances
from nonrigid.benchmark.protocol import Score, coverage, curve, random_rigid_motion, score
from nonrigid.benchmark.vertex_pairs import METRICS, vertex_pair_distances
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points, decimate, isosurface


def plane(n: int, *, seed: int = 0) -> Mesh:
    """Return a flat rectangle of n x n irregular vertices, on which the distance of two points is the straight line."""
    x, y = (a.ravel().astype(float) for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    inner = (x > 0) & (x < n - 1) & (y > 0) & (y < n - 1)
    shift = np.random.default_rng(seed).uniform(-0.2, 0.2, (2, n * n)) * inner
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    return Mesh(np.stack([x + shift[0], y + shift[1], 0 * x], 1), faces, name="plane")


def some_points(mesh: Mesh, count: int, seed: int) -> SurfacePoints:
    generator = np.random.default_rng(seed)
    return SurfacePoints(generator.integers(0, len(mesh.faces), count), generator.dirichlet([1, 1, 1], count))


PLANE = plane(9)
VERTICES = np.random.default_rng(5).integers(0, 81, (2, 40))


@pytest.mark.parametrize("metric", METRICS)
def test_equal_points_have_no_error(metric: str) -> None:
    points = some_points(PLANE, 40, 0)
    np.testing.assert_allclose(geodesic_errors(PLANE, points, points, geodesics=metric), 0.0, atol=1e-12)


@pytest.mark.parametrize("metric", ["dijkstra", "edgeflip", "exact"])
def test_at_vertices_the_error_is_the_distance_of_the_vertices(metric: str) -> None:
    a, b = VERTICES
    points = SurfacePoints.at_vertices(PLANE, a), SurfacePoints.at_vertices(PLANE, b)
    expected = vertex_pair_distances(PLANE, a, b, geodesics=metric)
    np.testing.assert_allclose(point_distances(PLANE, *points, geodesics=metric), expected, atol=1e-9)


@pytest.mark.parametrize("metric", METRICS)
def test_the_error_is_symmetric(metric: str) -> None:
    a, b = some_points(PLANE, 60, 1), some_points(PLANE, 60, 2)
    there, back = (geodesic_errors(PLANE, *pair, geodesics=metric) for pair in ((a, b), (b, a)))
    # The heat method itself gives slightly different distances from a to b and from b to a.
    np.testing.assert_allclose(there, back, rtol=0.1 if metric == "heat" else 1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_on_a_plane_the_exact_metric_is_the_straight_line(seed: int) -> None:
    a, b = some_points(PLANE, 300, seed), some_points(PLANE, 300, seed + 100)
    straight = np.linalg.norm(a.positions(PLANE) - b.positions(PLANE), axis=1)
    measured = point_distances(PLANE, a, b, geodesics="exact")
    np.testing.assert_allclose(measured, straight, atol=1e-9)


def test_on_a_ball_the_exact_metric_is_close_to_the_great_circle() -> None:
    ball = decimate(isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.1), 400)
    a, b = some_points(ball, 30, 0), some_points(ball, 30, 1)
    p, q = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (a.positions(ball), b.positions(ball)))
    circle = 2 * np.arcsin(np.linalg.norm(p - q, axis=1) / 2)
    measured = point_distances(ball, a, b, geodesics="exact")
    np.testing.assert_allclose(measured, circle, rtol=0.02, atol=0.02)


def test_near_points_are_joined_over_their_common_edge() -> None:
    roof = Mesh([[0, 0, 0], [0, 2, 0], [1, 1, 1], [-1, 1, 1]], [[0, 1, 2], [1, 0, 3]])
    a, b = SurfacePoints([0], [[0.25, 0.25, 0.5]]), SurfacePoints([1], [[0.25, 0.25, 0.5]])
    np.testing.assert_allclose(point_distances(roof, a, b), np.sqrt(2), rtol=1e-12)


def test_a_point_on_an_edge_may_be_named_by_either_face() -> None:
    roof = Mesh([[0, 0, 0], [0, 2, 0], [1, 1, 1], [-1, 1, 1]], [[0, 1, 2], [1, 0, 3]])
    one, other = SurfacePoints([0], [[0.3, 0.7, 0.0]]), SurfacePoints([1], [[0.7, 0.3, 0.0]])
    assert geodesic_errors(roof, one, other)[0] == pytest.approx(0.0, abs=1e-12)


def test_dijkstra_agrees_with_itself_near_and_far() -> None:
    mesh = plane(30)
    a, b = np.random.default_rng(0).integers(0, 900, (2, 500))
    found = vertex_pair_distances(mesh, a, b)
    straight = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)
    assert (found >= straight - 1e-9).all()
    assert (found <= 1.12 * straight + 1e-9).all()


def test_distances_are_exact_as_far_as_they_are_wanted() -> None:
    full, rng = PAIR.full, np.random.default_rng(4)
    a, b = rng.integers(0, len(full.vertices), (2, 400))
    true = vertex_pair_distances(full, a, b)
    up_to = rng.uniform(0.0, 1.0, 400) * np.sqrt(full.area)
    found = vertex_pair_distances(full, a, b, up_to=up_to)
    assert 0 < np.isinf(found).sum() < 400
    np.testing.assert_array_equal(found[true <= up_to], true[true <= up_to])
    beyond = found[true > up_to]
    assert (np.isinf(beyond) | (beyond == true[true > up_to])).all()


def test_unmatched_points_have_no_error_and_bad_ones_are_refused() -> None:
    a = SurfacePoints([-1, 0], [[0, 0, 0], [1, 0, 0]])
    errors = geodesic_errors(PLANE, a, some_points(PLANE, 2, 0))
    np.testing.assert_array_equal(np.isnan(errors), [True, False])
    with pytest.raises(InputError, match="2 matched points, but 3"):
        geodesic_errors(PLANE, a, some_points(PLANE, 3, 0))
    with pytest.raises(InputError, match="names face 999"):
        geodesic_errors(PLANE, SurfacePoints([999], [[1, 0, 0]]), some_points(PLANE, 1, 0))
    with pytest.raises(UnknownNameError, match="exact"):
        geodesic_errors(PLANE, a, a, geodesics="guess")


def symmetric_pair() -> PairData:
    """Return a piece of the plane, whose left-right mirror image is x -> 8 - x."""
    full = plane(9)
    part = restrict(full, full.vertices[full.faces][:, :, 1].max(axis=1) < 4.6, name="piece")
    truth = SurfacePoints.at_vertices(full, part.vertex_of_part)
    mirrored = closest_points(full, part.mesh.vertices * [-1.0, 1.0, 1.0] + [8.0, 0.0, 0.0])
    return PairData(name="piece", part=part.mesh, full=full, truth=truth, mirrored=mirrored)


PAIR = symmetric_pair()
assert PAIR.truth is not None
assert PAIR.mirrored is not None
TRUTH, MIRRORED = PAIR.truth, PAIR.mirrored


def mixed(take_mirrored: np.ndarray, unmatched: np.ndarray | None = None) -> SurfacePoints:
    faces = np.where(take_mirrored, MIRRORED.faces, TRUTH.faces)
    weights = np.where(take_mirrored[:, None], MIRRORED.barycentric, TRUTH.barycentric)
    return SurfacePoints(faces if unmatched is None else np.where(unmatched, -1, faces), weights)


def test_truth_and_mirrored_truth_are_perfect() -> None:
    for points, side in ((TRUTH, "direct"), (MIRRORED, "mirrored")):
        result = score(PAIR, points)
        assert result.side == side
        assert result.mean_error == pytest.approx(0.0, abs=1e-9)
        assert result.coverage == pytest.approx(1.0)
        np.testing.assert_allclose(result.curve, 1.0)
        assert result.match_count == len(TRUTH)
    assert result.kept_area == pytest.approx(PAIR.part.area / PAIR.full.area)


def test_a_map_that_mixes_sides_is_penalised_in_the_primary_score_only() -> None:
    left = np.arange(len(TRUTH)) % 3 == 0
    result = score(PAIR, mixed(left))
    assert result.side == "direct"
    assert result.mean_error > 0.05
    assert result.mean_error_per_point == pytest.approx(0.0, abs=1e-9)
    assert result.mirrored is not None
    assert result.errors.mean() == result.mean_error <= result.mirrored.mean()


@given(seed=st.integers(0, 1000), share=st.floats(0.0, 1.0), shift=st.sampled_from([0.0, 0.3, 4.0]))
@settings(max_examples=20, deadline=None)
def test_what_is_left_unmeasured_changes_no_score(seed: int, share: float, shift: float) -> None:
    generator = np.random.default_rng(seed)
    moved = mixed(generator.random(len(TRUTH)) < share).positions(PAIR.full)
    points = closest_points(PAIR.full, moved + shift * generator.standard_normal(moved.shape))
    sides = [geodesic_errors(PAIR.full, points, side) for side in (TRUTH, MIRRORED)]
    quick = errors_of_both(PAIR.full, points, TRUTH, MIRRORED)
    assert quick[1] is not None
    np.testing.assert_array_equal(np.minimum(*quick), np.minimum(*sides))
    better = int(np.mean(sides[1]) < np.mean(sides[0]))
    np.testing.assert_array_equal(quick[better], sides[better])
    assert not quick[1 - better].mean() < sides[better].mean()
    exceeding = np.isinf(quick[1 - better])
    assert (sides[1 - better] >= sides[better])[exceeding].all()
    result = score(PAIR, points)
    assert result.mean_error == pytest.approx(np.mean(sides[better]), abs=1e-12)
    assert result.mean_error_per_point == pytest.approx(np.minimum(*sides).mean(), abs=1e-12)


def test_unmatched_vertices_are_left_out_and_counted() -> None:
    none = np.arange(len(TRUTH)) % 4 > 0
    result = score(PAIR, mixed(np.zeros(len(TRUTH), dtype=bool), none))
    np.testing.assert_array_equal(result.rows, np.flatnonzero(~none))
    assert (result.match_count, result.unmatched_count) == ((~none).sum(), none.sum())
    assert result.mean_error == pytest.approx(0.0, abs=1e-9)
    empty = score(PAIR, mixed(none, np.ones(len(TRUTH), dtype=bool)))
    assert np.isnan(empty.mean_error)
    assert (empty.match_count, empty.coverage) == (0, 0.0)
    assert np.isnan(empty.curve).all()


def test_a_score_without_mirror_image_is_the_direct_one() -> None:
    alone = replace(PAIR, mirrored=None)
    assert score(alone, TRUTH).mean_error == pytest.approx(0.0, abs=1e-9)
    assert score(alone, MIRRORED).mean_error > 0.1


def test_rows_and_truth_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="the part of piece has"):
        score(PAIR, TRUTH[:3])
    with pytest.raises(InputError, match="has 3 rows, but the part has"):
        replace(PAIR, truth=TRUTH[:3])
    with pytest.raises(InputError, match="no ground truth"):
        score(replace(PAIR, truth=None), TRUTH)
    known = replace(PAIR, truth=mixed(np.zeros(len(TRUTH), dtype=bool), np.arange(len(TRUTH)) == 2))
    with pytest.raises(InputError, match="no matched vertex of piece has ground truth"):
        score(known, mixed(np.zeros(len(TRUTH), dtype=bool), np.arange(len(TRUTH)) != 2))
    with pytest.raises(InputError, match="on one side only"):
        score(replace(PAIR, mirrored=known.truth), TRUTH)


def test_vertices_without_truth_are_left_out_and_counted() -> None:
    unknown = np.arange(len(TRUTH)) % 4 == 2
    partial = replace(PAIR, truth=mixed(np.zeros(len(TRUTH), dtype=bool), unknown), mirrored=None)
    result = score(partial, TRUTH)
    assert result.mean_error == pytest.approx(0.0, abs=1e-9)
    assert (result.match_count, result.unknown_count) == (len(TRUTH), unknown.sum())
    assert len(result.rows) == len(result.errors) == (~unknown).sum()


def test_scale_and_rigid_motion_of_either_surface_change_no_score() -> None:
    points = mixed(np.arange(len(TRUTH)) % 3 == 0, np.arange(len(TRUTH)) % 5 == 0)
    one = score(PAIR, points)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.4]).as_matrix()
    moved = replace(
        PAIR,
        part=PAIR.part.transformed(rotation=turn, scale=100.0, translation=[5, 5, 5]),
        full=PAIR.full.transformed(rotation=turn.T, scale=100.0),
    )
    other = score(moved, points)
    np.testing.assert_allclose(one.direct, other.direct, atol=1e-9)
    assert one.coverage == pytest.approx(other.coverage)
    assert one.kept_area == pytest.approx(other.kept_area)


def renumbered(mesh: Mesh, seed: int) -> tuple[Mesh, np.ndarray, np.ndarray, np.ndarray]:
    """Return the mesh in another order, with the new number of each vertex and face and the turn of each face."""
    generator = np.random.default_rng(seed)
    order, face_order = generator.permutation(len(mesh.vertices)), generator.permutation(len(mesh.faces))
    turn = generator.integers(0, 3, len(mesh.faces))
    turned = np.take_along_axis(mesh.faces, (np.arange(3) + turn[:, None]) % 3, axis=1)
    number, face_number = np.argsort(order), np.argsort(face_order)
    return Mesh(mesh.vertices[order], number[turned][face_order], name=mesh.name), order, face_number, turn


def test_the_order_of_vertices_and_faces_changes_no_score() -> None:
    full, _, face_number, turn = renumbered(PAIR.full, 1)
    part, order, _, _ = renumbered(PAIR.part, 2)

    def named(points: SurfacePoints) -> SurfacePoints:
        shift = (np.arange(3) + turn[points.faces][:, None]) % 3
        weights = np.take_along_axis(points.barycentric, shift, axis=1)
        return SurfacePoints(np.where(points.matched, face_number[points.faces], -1), weights)[order]

    points = mixed(np.arange(len(TRUTH)) % 3 == 0, np.arange(len(TRUTH)) % 5 == 0)
    one = score(PAIR, points)
    other = score(replace(PAIR, part=part, full=full, truth=named(TRUTH), mirrored=named(MIRRORED)), named(points))
    assert other.mean_error == pytest.approx(one.mean_error)
    assert other.mean_error_per_point == pytest.approx(one.mean_error_per_point, abs=1e-12)
    assert other.coverage == pytest.approx(one.coverage)
    np.testing.assert_allclose(np.sort(other.direct), np.sort(one.direct), atol=1e-12)


def test_coverage_grows_with_the_radius_and_stays_on_the_part() -> None:
    strip = plane(9)
    shares = [coverage(strip, np.array([0]), radius) for radius in (0.5, 2.0, 5.0, 20.0)]
    assert shares == sorted(shares)
    assert shares[0] < 0.02
    assert shares[-1] == pytest.approx(1.0)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=50))
def test_the_curve_is_the_share_within_each_threshold(errors: list[float]) -> None:
    found = curve(np.array(errors))
    assert (np.diff(found) >= 0).all()
    assert found[-1] == pytest.approx(np.mean(np.array(errors) <= 0.25 + 1e-12))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.text(max_size=10))
def test_random_motions_are_rigid_and_repeat(seed: int, name: str) -> None:
    mesh = Mesh(PLANE.vertices, PLANE.faces, name=name)
    moved, rotation, translation = random_rigid_motion(mesh, seed)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(moved.vertices, mesh.vertices @ rotation.T + translation)
    np.testing.assert_array_equal(random_rigid_motion(mesh, seed)[1], rotation)


def test_random_rotations_are_uniform_and_differ_by_name_and_seed() -> None:
    def turn(name: str, seed: int) -> np.ndarray:
        return random_rigid_motion(Mesh(PLANE.vertices, PLANE.faces, name=name), seed)[1]

    assert not np.allclose(turn("a", 0), turn("b", 0))
    assert not np.allclose(turn("a", 0), turn("a", 1))
    turns = np.stack([turn("a", seed) for seed in range(1000)])
    np.testing.assert_allclose(turns.mean(axis=0), 0.0, atol=0.08)
    # The trace of a uniform rotation has mean 0 and variance 1.
    assert np.trace(turns, axis1=1, axis2=2).var() == pytest.approx(1.0, abs=0.1)


def made_up(mean: float, matches: int, kept: float, metric: str = "dijkstra") -> Score:
    errors = np.full(matches, mean)
    return Score(
        name="x", metric=metric, rows=np.arange(matches), direct=errors, mirrored=None, side="direct",
        mean_error=mean if matches else float("nan"), mean_error_per_point=mean if matches else float("nan"),
        match_count=matches, unmatched_count=0, coverage=0.5, curve=curve(errors), kept_area=kept,
    )  # fmt: skip


def test_every_shape_counts_the_same() -> None:
    summary = summarize([made_up(0.1, 1, 0.5), made_up(0.3, 99, 0.5), made_up(0.9, 0, 0.5)])
    assert summary.mean_error == pytest.approx(0.2)
    assert (summary.shape_count, summary.empty_count) == (2, 1)
    assert summary.match_count == pytest.approx(100 / 3)
    assert summary.curve[20] == pytest.approx(0.5)
    with pytest.raises(InputError, match="2 metrics"):
        summarize([made_up(0.1, 1, 0.5), made_up(0.1, 1, 0.5, "heat")])


def test_bins_of_partiality() -> None:
    scores = [made_up(0.1, 5, 0.95), made_up(0.2, 5, 0.9), made_up(0.3, 5, 0.65), made_up(0.4, 5, 0.05)]
    disjoint = by_partiality(scores, cumulative=False)
    assert [s.label for s in disjoint] == [
        "missing area 0 to 10 %", "missing area 30 to 40 %", "missing area 90 to 100 %",
    ]  # fmt: skip
    np.testing.assert_allclose([s.mean_error for s in disjoint], [0.15, 0.3, 0.4])
    cumulative = by_partiality(scores, cumulative=True)
    assert len(cumulative) == 10
    np.testing.assert_allclose([s.mean_error for s in cumulative][::3], [0.15, 0.2, 0.2, 0.25])


def test_remeshing_keeps_the_surface() -> None:
    ball = isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.1)
    small = decimate(ball, 300)
    assert abs(len(small.vertices) - 300) <= 2
    assert len(small.boundary_edges) == 0
    assert small.area == pytest.approx(4 * np.pi, rel=0.03)
    place = closest_points(small, ball.vertices).positions(small)
    assert np.linalg.norm(place - ball.vertices, axis=1).max() < 0.05
    with pytest.raises(InputError, match="99999 vertices asked"):
        decimate(ball, 99999)
    with pytest.raises(InputError, match="one sign"):
        isosurface(lambda p: np.ones(len(p)), [0] * 3, [1] * 3, 0.5)


@pytest.mark.realdata
@pytest.mark.parametrize("metric", METRICS)
def test_the_cat_with_its_doubled_triangles_is_measured(data: Path, metric: str) -> None:
    cat = read_mesh(data / "shrec16" / "null" / "cat.off")
    doubled = np.unique(np.sort(cat.faces, axis=1), axis=0, return_index=True, return_counts=True)
    faces = np.r_[doubled[1][doubled[2] > 1][:1], 4000]
    a = SurfacePoints(faces, [[0.2, 0.3, 0.5]] * 2)
    b = SurfacePoints([100, 100], [[1, 0, 0]] * 2)
    errors = geodesic_errors(cat, a, b, geodesics=metric)
    reference = geodesic_errors(cat, a, b)
    np.testing.assert_allclose(errors, reference, rtol=0.2, atol=0.02)


def test_errors_stand_at_their_vertices_where_truth_is_partial() -> None:
    part = restrict(PLANE, np.arange(len(PLANE.faces)) < 64).mesh
    count = len(part.vertices)
    truth = some_points(PLANE, count, 3)
    known = truth.faces.copy()
    known[:5] = -1
    pair = PairData(name="p", part=part, full=PLANE, truth=SurfacePoints(known, truth.barycentric), mirrored=None)
    wrong = truth.faces.copy()
    wrong[9] = (wrong[9] + 40) % len(PLANE.faces)
    result = score(pair, SurfacePoints(wrong, truth.barycentric))
    errors = result.errors_of(np.arange(count))
    assert np.isnan(errors[:5]).all()
    assert int(np.nanargmax(errors)) == 9
    assert result.unknown_count == 5
    assert result.curve[0] > 0.9


def test_what_is_within_the_digits_of_truth_files_is_within_a_threshold() -> None:
    assert curve(np.array([5e-8, 0.1]), np.array([0.0])).tolist() == [0.5]
