"""TOSCA's own forms give the mesh that OFF gives, and errors that say where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh, write_off
from nonrigid.geometry.mesh import Mesh

TENT = Mesh([[0, 0, 0], [1, 0, 0.125], [0, 2, 0], [0, 0, 3]], [[0, 1, 2], [0, 3, 1], [1, 3, 2]], name="cat0")


def write_vert_tri(folder: Path, first: int = 1) -> Path:
    np.savetxt(folder / "cat0.vert", TENT.vertices)
    np.savetxt(folder / "cat0.tri", TENT.faces + first, fmt="%d")
    return folder / "cat0.vert"


def write_mat(folder: Path, **changed: object) -> Path:
    x, y, z = TENT.vertices.T[:, :, None]
    surface = {"X": x, "Y": y, "Z": z, "TRIV": (TENT.faces + 1).astype(float), **changed}
    savemat(folder / "cat0.mat", {"surface": surface})
    return folder / "cat0.mat"


@pytest.mark.parametrize("write", [write_vert_tri, write_mat])
def test_both_forms_give_the_mesh(tmp_path: Path, write: object) -> None:
    mesh = read_mesh(write(tmp_path))  # type: ignore[operator]
    np.testing.assert_array_equal(mesh.vertices, TENT.vertices)
    np.testing.assert_array_equal(mesh.faces, TENT.faces)
    assert mesh.name == "cat0"
    assert mesh.file is not None


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cat0.tri, row 1: .*looks 0-based.*add 1"):
        read_mesh(write_vert_tri(tmp_path, first=0))
    (tmp_path / "cat0.tri").write_text("1 2 3\n1 4\n")
    with pytest.raises(InputError, match=r"cat0.tri, row 2: 2 columns"):
        read_mesh(tmp_path / "cat0.vert")
    (tmp_path / "cat0.tri").unlink()
    with pytest.raises(InputError, match=r"cat0.tri: there is no such file"):
        read_mesh(tmp_path / "cat0.vert")
    path = write_mat(tmp_path, TRIV=np.array([[1.0, 2.0, 5.0]]))
    with pytest.raises(InputError, match=r"cat0.mat, row 1: .*numbers run from 1 to 4"):
        read_mesh(path)
    with pytest.raises(InputError, match="have the shapes"):
        read_mesh(write_mat(tmp_path, X=np.zeros((3, 1))))
    savemat(path, {"other": np.eye(2)})
    with pytest.raises(InputError, match="0 structures"):
        read_mesh(path)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match="cannot be read as MATLAB data"):
        read_mesh(path)


def test_an_unrepairable_mesh_is_named_by_its_file(tmp_path: Path) -> None:
    far = Mesh(np.vstack([TENT.vertices, TENT.vertices + 9]), np.vstack([TENT.faces, TENT.faces + 4]), name="two")
    write_off(far, tmp_path / "two.off")
    with pytest.raises(InputError, match=r"two\.off: the surface falls into 2 pieces"):
        clean(read_mesh(tmp_path / "two.off"))
    with pytest.raises(InputError, match=r"^two: the surface"):
        clean(far)


def test_a_structure_that_holds_no_tables_of_numbers_is_refused(tmp_path: Path) -> None:
    path = write_mat(tmp_path, X="text")
    with pytest.raises(InputError, match=r"cat0.mat: the structure does not hold one table"):
        read_mesh(path)
