"""Eigenvalues with known answers, and invariance under what must not matter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.sparse import csc_array

from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.operators import Laplacian, laplacian
from nonrigid.geometry.spectrum import spectrum

KINDS = ("robust", "cotangent")


def ball(subdivisions: int) -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(made.vertices, made.faces)


def bumpy(subdivisions: int = 3) -> Mesh:
    mesh = ball(subdivisions)
    x, y, z = mesh.vertices.T
    radius = 1 + 0.3 * np.sin(3 * x + 1) * np.sin(2 * y + 0.5) + 0.2 * np.sin(4 * z + x)
    return Mesh(mesh.vertices * radius[:, None], mesh.faces)


def rectangle(width: float, height: float, columns: int, rows: int) -> Mesh:
    x, y = np.meshgrid(np.linspace(0, width, columns + 1), np.linspace(0, height, rows + 1), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    return Mesh(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], np.vstack([np.c_[a, b, c], np.c_[a, c, d]]))


@pytest.mark.parametrize("kind", KINDS)
def test_sphere_has_the_eigenvalues_of_spherical_harmonics(kind: str) -> None:
    values = spectrum(laplacian(ball(4), kind), 16).eigenvalues
    expected = np.repeat([0.0, 2.0, 6.0, 12.0], [1, 3, 5, 7])
    np.testing.assert_allclose(values, expected, rtol=0.01, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_rectangle_has_neumann_eigenvalues(kind: str) -> None:
    values = spectrum(laplacian(rectangle(2.0, 1.3, 60, 40), kind), 10).eigenvalues
    i, j = np.meshgrid(np.arange(8), np.arange(8))
    expected = np.sort(np.pi**2 * ((i / 2.0) ** 2 + (j / 1.3) ** 2).ravel())[:10]
    np.testing.assert_allclose(values, expected, rtol=0.005, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_laplacian_is_symmetric_with_constants_in_its_kernel_and_the_area_as_mass(kind: str) -> None:
    mesh = bumpy(2)
    made = laplacian(mesh, kind)
    dense = made.stiffness.toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-14)
    np.testing.assert_allclose(dense.sum(axis=1), 0, atol=1e-12)
    # the robust operator lengthens edges by about 1e-5 of their mean, against degenerate triangles
    assert made.mass.sum() == pytest.approx(mesh.area, rel=1e-3)
    assert np.linalg.eigvalsh(dense).min() > -1e-10


def test_eigenpairs_solve_the_problem_and_are_orthonormal() -> None:
    made = laplacian(bumpy())
    found = spectrum(made, 30)
    phi = found.eigenfunctions
    residual = made.stiffness @ phi - made.mass[:, None] * phi * found.eigenvalues
    assert np.abs(residual).max() < 1e-10
    np.testing.assert_allclose(found.project(phi), np.eye(30), atol=1e-10)
    assert (np.diff(found.eigenvalues) >= 0).all()
    dense = np.linalg.eigvalsh(made.stiffness.toarray() / np.sqrt(np.outer(made.mass, made.mass)))
    np.testing.assert_allclose(found.eigenvalues, dense[:30], atol=1e-10)


def test_scaling_the_surface_scales_the_spectrum() -> None:
    small, large = (spectrum(laplacian(bumpy().transformed(scale=scale)), 20) for scale in (1.0, 200.0))
    np.testing.assert_allclose(large.eigenvalues * 200.0**2, small.eigenvalues, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(large.eigenfunctions * 200.0, small.eigenfunctions, atol=1e-7)


def test_vertex_order_and_frame_do_not_matter_not_even_for_signs() -> None:
    mesh, generator = bumpy(), np.random.default_rng(0)
    order = generator.permutation(len(mesh.vertices))
    number = np.argsort(order)
    rotation = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    other = Mesh(mesh.vertices[order] @ rotation.T + 3.0, generator.permutation(number[mesh.faces]))
    first, second = (spectrum(laplacian(each), 25) for each in (mesh, other))
    np.testing.assert_allclose(first.eigenvalues, second.eigenvalues, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(first.eigenfunctions[order], second.eigenfunctions, atol=1e-6)


def test_a_reference_decides_the_sign_of_odd_eigenfunctions() -> None:
    mesh, generator = rectangle(2.0, 1.3, 20, 13), np.random.default_rng(4)
    reference = mesh.vertices @ [1.0, 0.6, 0.0]
    for _ in range(3):
        order = generator.permutation(len(mesh.vertices))
        other = Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces])
        found = spectrum(laplacian(other), 4, reference=reference[order])
        assert (found.project(reference[order])[1:3] > 0.01).all()


def test_the_same_input_gives_the_same_bits() -> None:
    first, second = (spectrum(laplacian(ball(3)), 12) for _ in range(2))
    assert first.eigenfunctions.tobytes() == second.eigenfunctions.tobytes()


def test_truncation_keeps_the_first_pairs() -> None:
    found = spectrum(laplacian(ball(1)), 9)
    assert found.truncated(4).eigenfunctions.shape == (42, 4)
    with pytest.raises(InputError, match="10 eigenpairs of 9"):
        found.truncated(10)


def test_what_cannot_work_is_refused() -> None:
    mesh = ball(0)
    with pytest.raises(InputError, match="12 eigenpairs of a surface with 12 vertices; ask for 1 to 11"):
        spectrum(laplacian(mesh), 12)
    with pytest.raises(UnknownNameError, match="cotangent, robust"):
        laplacian(mesh, "graph")
    sliver = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], [[0, 1, 2], [0, 1, 3]])
    with pytest.raises(InputError, match="1 triangles have no area, the first is face 1"):
        laplacian(sliver, "cotangent")
    with pytest.raises(InputError, match="1 vertices have no mass"):
        spectrum(Laplacian(csc_array(np.eye(3)), np.array([1.0, 0.0, 1.0])), 2)
    assert np.isfinite(spectrum(laplacian(sliver, "robust"), 3).eigenvalues).all()


@pytest.mark.realdata
def test_real_part_has_one_zero_and_orthonormal_functions(data: Path) -> None:
    mesh = clean(read_mesh(data / "shrec16" / "cuts" / "cuts_wolf_shape_1.off")).mesh
    found = spectrum(laplacian(mesh), 50)
    assert (found.eigenvalues * mesh.area > 1e-6).sum() == 49
    np.testing.assert_allclose(found.project(found.eigenfunctions), np.eye(50), atol=1e-9)
