from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nonrigid.benchmark.formats import (
    read_baryc,
    read_corr,
    read_map,
    read_truth,
    read_vts,
    write_baryc,
    write_corr,
    write_map,
    write_text,
    write_vts,
)
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], name="square")


@given(st.lists(st.tuples(st.integers(-1, 1), st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=20))
def test_corr_comes_back_as_written(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, float, float]]
) -> None:
    faces = [row[0] for row in rows]
    weights = [(a * b, a * (1 - b), 1 - a) for _, a, b in rows]
    points = SurfacePoints(faces, weights)
    path = tmp_path_factory.mktemp("corr") / "m.corr"
    write_corr(path, points)
    again = read_corr(path, full=SQUARE, expected_rows=len(rows))
    np.testing.assert_array_equal(again.faces, points.faces)
    np.testing.assert_allclose(again.barycentric, points.barycentric, atol=1e-15)


def test_every_form_comes_back_as_written(tmp_path: Path) -> None:
    points = SurfacePoints.at_vertices(SQUARE, [2, 0, 3, 1])
    write_baryc(tmp_path / "a.baryc_gt", points)
    write_vts(tmp_path / "a.vts", points, SQUARE)
    write_map(tmp_path / "a.map", points, SQUARE)
    write_corr(tmp_path / "a.corr", points)
    assert (tmp_path / "a.vts").read_text().split() == ["3", "1", "4", "2"]
    assert (tmp_path / "a.map").read_text().split() == ["2", "0", "3", "1"]
    for name in ("a.baryc_gt", "a.vts", "a.map", "a.corr"):
        again = read_truth(tmp_path / name, SQUARE, expected_rows=4)
        np.testing.assert_array_equal(again.nearest_corner(SQUARE), [2, 0, 3, 1])


def test_official_float_triangles_and_tiny_negative_weights_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.baryc_gt"
    path.write_text("   2.0000000e+00   1.0000000e+00  -2.0000000e-16   0.0000000e+00\n")
    points = read_baryc(path, full=SQUARE)
    assert points.faces[0] == 1
    assert points.barycentric.min() == 0.0


def test_unmatched_is_read_where_the_form_has_a_word_for_it(tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    path.write_text("-1\n2\n")
    np.testing.assert_array_equal(read_map(path, SQUARE).matched, [False, True])
    path.write_text("1.0\n2.0000e+00\n")
    np.testing.assert_array_equal(read_vts(path, SQUARE).nearest_corner(SQUARE), [0, 1])


GOOD = "1 1 0 0\n"
BAD: list[tuple[Callable[[Path], SurfacePoints], str, str]] = [
    (read_corr, GOOD + "1 1 0\n", "row 2: 3 columns, not 4"),
    (read_corr, GOOD + "1 x 0 0\n", "row 2: 'x' is not a number"),
    (read_corr, GOOD + "1 nan 0 0\n", "row 2: a value is not finite"),
    (read_corr, GOOD + "0 1 0 0\n", "row 2: triangle 0 .* looks 0-based; add 1"),
    (read_corr, GOOD + "-2 1 0 0\n", "row 2: triangle -2"),
    (read_baryc, GOOD + "-1 0 0 0\n", "row 2: triangle -1"),
    (read_corr, GOOD + "1.5 1 0 0\n", "row 2: triangle 1.5 is not a whole number"),
    (read_corr, GOOD + "1 0.5 0.5 0.5\n", "row 2: barycentric weights sum to 1.5"),
    (read_corr, GOOD + "1 2 -1 0\n", "row 2: a barycentric weight is -1"),
    (lambda path: read_corr(path, full=SQUARE), GOOD + "3 1 0 0\n", "row 2: triangle 3, but square has 2"),
    (lambda path: read_corr(path, expected_rows=7), GOOD, "1 rows, but the part has 7 vertices"),
    (lambda path: read_vts(path, SQUARE), "1\n0\n", "row 2: vertex 0 .* looks 0-based"),
    (lambda path: read_vts(path, SQUARE), "1\n5\n", "row 2: vertex 5, but square has 4"),
    (lambda path: read_map(path, SQUARE), "0\n4\n", "row 2: vertex 4, but square has 4"),
    (lambda path: read_truth(path, SQUARE), GOOD, "suffix '.txt'"),
]


@pytest.mark.parametrize(("read", "text", "message"), BAD)
def test_a_wrong_file_is_named_with_its_row(
    tmp_path: Path, read: Callable[[Path], SurfacePoints], text: str, message: str
) -> None:
    path = tmp_path / "m.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_missing_and_binary_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_corr(tmp_path / "none.corr")
    (tmp_path / "b.corr").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as text"):
        read_corr(tmp_path / "b.corr")


def test_writing_is_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "m.corr"
    path.write_text("old")
    with pytest.raises(TypeError):
        write_text(path, 3)  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(InputError, match="does not exist"):
        write_text(tmp_path / "none" / "m.corr", "")


def test_forms_without_a_word_for_unmatched_refuse_it(tmp_path: Path) -> None:
    points = SurfacePoints([-1], [[0, 0, 0]])
    with pytest.raises(InputError, match="1 points are unmatched"):
        write_baryc(tmp_path / "a.baryc_gt", points)
    with pytest.raises(InputError, match="1 points are unmatched"):
        write_vts(tmp_path / "a.vts", points, SQUARE)


@pytest.mark.realdata
def test_real_ground_truth_is_read(data: Path) -> None:
    for path in sorted((data / "shrec16" / "holes").glob("*_cat_shape_1*.baryc_gt*")):
        points = read_baryc(path)
        np.testing.assert_allclose(points.barycentric.sum(axis=1), 1.0, atol=1e-12)


def test_suffixes_and_marks_of_other_systems_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.CORR").write_bytes(b"\xef\xbb\xbf1 1 0 0\r\n-1 0 0 0\r\n")
    assert read_truth(tmp_path / "a.CORR", SQUARE).faces.tolist() == [0, -1]


def test_points_read_again_are_the_same_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    points = SurfacePoints(np.zeros(500, dtype=int), rng.dirichlet([1, 1, 1], 500))
    assert (points[np.arange(500)].barycentric == points.barycentric).all()
