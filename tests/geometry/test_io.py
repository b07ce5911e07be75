"""Files are read as stored, or refused with the row that is wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import read_mesh, write_off
from nonrigid.geometry.mesh import Mesh

VERTICES = [[0, 0, 0], [1, 0, 0], [0, 2, 0], [5, 5, 5], [0, 0, 0]]
FACES = [[2, 0, 1], [4, 1, 2]]

Write = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return written


def test_off_with_comments_blank_lines_and_counts_beside_the_header(write: Write) -> None:
    path = write(
        "a.off", "# made by hand\n\nOFF 4 1 0  # counts\n\n0 0 0\n1 0 0\r\n0 1e0 0\n# gap\n7 7 7\n3 0 1 2 255 0 0\n"
    )
    mesh = read_mesh(path)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [7, 7, 7]]
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.name == "a"


@settings(max_examples=30, deadline=None)
@given(arrays(np.float64, (4, 3), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_off_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, vertices: np.ndarray) -> None:
    mesh = Mesh(vertices, [[3, 1, 0], [0, 1, 3]])
    path = tmp_path_factory.mktemp("off") / "any.off"
    write_off(mesh, path)
    again = read_mesh(path)
    assert again.vertices.tobytes() == mesh.vertices.tobytes()
    assert again.faces.tolist() == mesh.faces.tolist()


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_keeps_order_duplicates_and_unreferenced_vertices(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.ply"
    trimesh.Trimesh(VERTICES, FACES, process=False).export(path, encoding=encoding)
    mesh = read_mesh(path)
    assert mesh.vertices.tolist() == VERTICES
    assert mesh.faces.tolist() == FACES


def test_obj_with_texture_seams_and_negative_numbers_keeps_the_vertices(write: Write) -> None:
    vertices = "".join("v {} {} {}\n".format(*vertex) for vertex in VERTICES)
    path = write("a.obj", f"{vertices}vt 0 0\nvt 1 1\nvn 0 0 1\nf 3/1/1 1/2/1 2/1/1\nf -1//1 -4//1 3/2\n")
    mesh = read_mesh(path)
    assert mesh.vertices.tolist() == VERTICES
    assert mesh.faces.tolist() == FACES


HEAD = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n"


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.off", "", "empty"),
        ("a.off", "solid x\n", "row 1: this is no text OFF file"),
        ("a.off", "OFF BINARY\n3 1 0\n", "row 1: this is no text OFF file"),
        ("a.off", "OFF\n", "ends before the numbers"),
        ("a.off", "OFF\nmany\n", "row 2: expected the numbers"),
        ("a.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "3 vertex rows and 2 face rows were promised, 4 rows"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n\n1 nan 0\n0 1 0\n3 0 1 2\n", "row 5: vertex 1 .* 'nan|1 nan 0'"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "row 4: vertex 1 "),
        ("a.off", "OFF\n3 1 0\n0 0 x\n1 0 0\n0 1 0\n3 0 1 2\n", "row 3: vertex 0 "),
        ("a.off", HEAD + "4 0 1 2 0\n", "row 6: a face with 4 corners; triangulate"),
        ("a.off", HEAD + "3 0 1\n", "row 6: not a triangle"),
        ("a.off", HEAD + "3 0 1 3\n", "row 6: face 0 .* names vertex 3, but there are 3 vertices"),
        ("a.off", HEAD + "3 0 -1 2\n", "row 6: face 0 .* names vertex -1"),
        ("a.off", "OFF\n1 0 0\n0 0 0\n", "no faces"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 1\n", "row 4: a face with 4 corners"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "row 4: face 0 .* names vertex 3"),
        ("a.obj", "v 0 0 0\nf 1 a 2\n", "row 2: not a triangle"),
        ("a.obj", "hello\n", "no OBJ"),
        ("a.ply", "OFF\n", "no PLY file"),
        ("a.stl", "solid\n", "'.stl' is none of .mat, .obj, .off, .ply, .vert"),
    ],
)
def test_bad_files_are_refused_naming_file_and_row(write: Write, name: str, text: str, complaint: str) -> None:
    path = write(name, text)
    with pytest.raises(InputError, match=complaint) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(str(path))


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.off: there is no such file"):
        read_mesh(tmp_path / "none.off")


@pytest.mark.parametrize("change", ["quad", "cut"])
def test_ply_that_would_change_is_refused(write: Write, change: str) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n"
    path = write("a.ply", head + ("0 1 0\n4 0 1 2 3\n" if change == "quad" else ""))
    with pytest.raises(InputError, match=r"a\.ply"):
        read_mesh(path)


@pytest.mark.realdata
def test_real_templates_have_the_documented_sizes(data: Path) -> None:
    sizes = {"cat": (10000, 19940), "david": (10000, 19950), "wolf": (4344, 8684)}
    for name, size in sizes.items():
        mesh = read_mesh(data / "shrec16" / "null" / f"{name}.off")
        assert (len(mesh.vertices), len(mesh.faces)) == size


def test_of_many_names_the_nearest_are_shown() -> None:
    names = [f"cuts_{kind}_shape_{number}" for kind in ("cat", "dog") for number in range(30)]
    message = str(UnknownNameError("pair", "cuts_cat_shape_77", names))
    assert "choose one of 60, such as cuts_cat_shape_" in message
    assert message.count("shape") <= 6


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99999999999999999999 0\n"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n"),
    ],
)
def test_numbers_beyond_any_vertex_are_refused(write: Write, name: str, text: str) -> None:
    with pytest.raises(InputError, match=rf"{name}, row \d: face 0 .* names vertex 4"):
        read_mesh(write(name, text))


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (VERTICES, [[0.7, 1.2, 2.9]], r"face 0 .* names vertex 0.7 of 5"),
        (VERTICES, [[-1, 0, 1]], r"face 0 .* names vertex -1 of 5"),
        (VERTICES, [[0, 1, 2], [0, 1]], "faces are rows of different lengths"),
        (VERTICES, [["a", "b", "c"]], "faces are of type"),
        ([[0, 0, 0], [1, 0]], FACES, "vertices are rows of different lengths"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices: list[list[float]], faces: list[list[float]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Mesh(vertices, faces)
