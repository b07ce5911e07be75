"""The lazy surface gives the same answers fresh, remembered and from disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from nonrigid.geometry import surface as module
from nonrigid.geometry.cache import Cache
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.surface import Surface


def bumpy() -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = made.vertices.T
    radius = 1 + 0.3 * np.sin(3 * x + 1) * np.cos(2 * y) + 0.2 * np.sin(4 * z + x)
    return Mesh(made.vertices * radius[:, None], made.faces, name="bumpy")


def everything(surface: Surface) -> dict[str, np.ndarray]:
    return {
        "values": surface.spectrum(30).eigenvalues,
        "functions": surface.spectrum(30, "cotangent").eigenfunctions,
        "heat": surface.heat_kernel_signature(5, 30),
        "wave": surface.wave_kernel_signature(6, 30),
        "shot": surface.shot(0.5, cosine_bins=7),
        "samples": surface.samples(12),
        "geodesic samples": surface.samples(12, "geodesic"),
        "dijkstra": surface.distances([5, 2, 5]),
        "heat distances": surface.distances(np.array([7]), "heat"),
    }


def test_fresh_remembered_and_stored_answers_are_equal_bit_for_bit(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    fresh = everything(Surface(bumpy(), cache=None))
    first = Surface(bumpy(), cache=cache)
    for answers in (everything(first), everything(first), everything(Surface(bumpy(), cache=cache))):
        for name, value in fresh.items():
            assert answers[name].tobytes() == value.tobytes(), name
            assert answers[name].shape == value.shape, name
    assert cache.info().entries == 7  # two spectra, SHOT, two samplings, two distances; signatures cost nothing


def test_shapes_and_order_of_sources() -> None:
    surface = Surface(bumpy(), cache=None)
    n = len(surface.mesh.vertices)
    found = everything(surface)
    assert found["heat"].shape == (n, 5)
    assert found["wave"].shape == (n, 6)
    assert found["shot"].shape == (n, 32 * 7)
    assert found["dijkstra"].shape == (3, n)
    assert found["dijkstra"][[0, 1, 2], [5, 2, 5]].tolist() == [0, 0, 0]
    assert len(set(found["samples"].tolist())) == 12
    with pytest.raises(ValueError, match="read-only"):
        found["shot"][0] = 1


@pytest.mark.parametrize("method", ["dijkstra", "heat"])
def test_distances_between_some_of_the_vertices_of_an_earlier_answer_are_taken_from_it(
    tmp_path: Path, method: str
) -> None:
    surface, cache = Surface(bumpy(), cache=Cache(tmp_path)), Cache(tmp_path)
    surface.distances_between([9, 4, 30, 2], method)
    for some in ([30, 4], [2, 9, 2], [2, 4, 9, 30]):
        alone = Surface(bumpy(), cache=None).distances_between(some, method)
        assert surface.distances_between(some, method).tobytes() == alone.tobytes()
    assert cache.info().entries == 1
    surface.distances_between([9, 5], method)
    assert cache.info().entries == 2


@pytest.mark.parametrize("method", ["dijkstra", "heat"])
def test_distances_from_some_of_the_sources_of_an_earlier_answer_are_taken_from_it(tmp_path: Path, method: str) -> None:
    surface, cache = Surface(bumpy(), cache=Cache(tmp_path)), Cache(tmp_path)
    surface.distances([9, 4, 30, 2], method)
    for some in ([30, 4], [2, 9, 2], [2, 4, 9, 30]):
        alone = Surface(bumpy(), cache=None)
        assert surface.distances(some, method).tobytes() == alone.distances(some, method).tobytes()
        assert surface.distances_between(some, method).tobytes() == alone.distances_between(some, method).tobytes()
    assert cache.info().entries == 1
    surface.distances([9, 5], method)
    assert cache.info().entries == 2


def test_large_distance_matrices_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    surface = Surface(bumpy(), cache=Cache(tmp_path))
    kept = surface.distances([3, 1])
    monkeypatch.setattr(module, "LARGEST_STORED", 100)
    assert np.array_equal(Surface(bumpy(), cache=Cache(tmp_path)).distances([3, 1]), kept)
    surface.distances([4])
    assert surface.clean_view.repairs == ()
    assert Cache(tmp_path).info().entries == 1


def test_scaling_and_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path))
    surface = Surface(bumpy())
    double = surface.scaled(2.0)
    assert double.area == pytest.approx(4 * surface.area)
    assert double.key != surface.key
    assert Surface(Mesh(bumpy().vertices, bumpy().faces, name="other")).key == surface.key
    np.testing.assert_allclose(double.distances([0]), 2 * surface.distances([0]), rtol=1e-12)
    assert len(list(tmp_path.glob("*/*.npz"))) == 2
    assert repr(surface) == "Surface(bumpy: 642 vertices, 1280 faces)"


def test_numbers_of_vertices_are_checked_and_numpy_counts_taken(tmp_path: Path) -> None:
    surface = Surface(bumpy(), cache=Cache(tmp_path))
    for wrong in ([1.9], [True, False], [642], [-1]):
        with pytest.raises(InputError, match="source vert"):
            surface.distances(wrong)
        with pytest.raises(InputError, match="source vert"):
            surface.distances_between(wrong)
    assert len(surface.spectrum(np.int64(5)).eigenvalues) == 5  # type: ignore[arg-type]
    assert len(surface.samples(np.int64(5))) == 5  # type: ignore[arg-type]


def test_what_a_mesh_derives_is_read_only() -> None:
    mesh = bumpy()
    for name in ("face_areas", "vertex_areas", "vertex_normals", "edges", "boundary_edges", "component_of_vertex"):
        assert not getattr(mesh, name).flags.writeable, name
