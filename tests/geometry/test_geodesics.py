"""Distances along a surface: known answers, bounds, metric axioms, refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from nonrigid.geometry.clean import clean
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.geodesics import METHODS, EdgeFlip, Geodesics, make_geodesics, virtual_edge_graph
from nonrigid.geometry.geodesics.exact import MissingExtraError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import largest_piece, restrict


def plane(n: int = 12, seed: int = 0) -> Mesh:
    """Return the unit square, triangulated irregularly and turned out of its plane."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)))
    inside = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    jitter = np.random.default_rng(seed).uniform(-0.25, 0.25, (n * n, 2)) / n * inside[:, None]
    quads = np.array([[k, k + 1, k + n + 1, k + n] for k in range(n * n - n) if k % n != n - 1])
    flat = np.c_[x + jitter[:, 0], y + jitter[:, 1], 0 * x]
    turned = Rotation.from_rotvec([0.3, 1.0, -0.4]).as_matrix()
    return Mesh(flat, np.r_[quads[:, :3], quads[:, [0, 2, 3]]]).transformed(rotation=turned)


def sphere() -> Mesh:
    ball = trimesh.creation.icosphere(subdivisions=3)
    return Mesh(ball.vertices, ball.faces)


PLANE, SPHERE = plane(), sphere()
# (mean, largest) relative error allowed on a plane; exact is exact
PLANAR_ERROR = {"exact": (1e-12, 1e-9), "dijkstra": (0.03, 0.12), "bridged": (0.03, 0.12), "heat": (0.05, 0.5)}


@pytest.mark.parametrize("method", sorted(METHODS))
def test_straight_lines_are_measured_on_a_plane(method: str) -> None:
    sources = np.array([0, 67, 143])
    truth = np.linalg.norm(PLANE.vertices[sources][:, None] - PLANE.vertices, axis=2)
    found = make_geodesics(PLANE, method).distances(sources)
    assert found.shape == truth.shape
    far = truth > 0.1
    error = np.abs(found - truth)[far] / truth[far]
    mean, largest = PLANAR_ERROR[method]
    assert error.mean() < mean
    assert error.max() < largest


@pytest.mark.parametrize("method", sorted(METHODS))
def test_great_circles_are_measured_on_a_sphere(method: str) -> None:
    truth = np.arccos(np.clip(SPHERE.vertices[:3] @ SPHERE.vertices.T, -1, 1))
    found = make_geodesics(SPHERE, method).distances([0, 1, 2])
    far = truth > 0.3
    assert (np.abs(found - truth)[far] / truth[far]).mean() < 0.03


@pytest.mark.parametrize("mesh", [PLANE, SPHERE], ids=["plane", "sphere"])
def test_dijkstra_is_an_upper_bound_tighter_than_edges_alone(mesh: Mesh) -> None:
    sources = np.arange(0, len(mesh.vertices), 37)
    exact = make_geodesics(mesh, "exact").distances(sources)
    found = make_geodesics(mesh, "dijkstra").distances(sources)
    assert (found >= exact - 1e-12).all()
    assert found.mean() < 1.06 * exact.mean()


@pytest.mark.parametrize("method", ["dijkstra", "bridged", "exact"])
def test_distances_are_a_metric(method: str) -> None:
    d = make_geodesics(PLANE, method).distances(np.arange(144))
    assert (np.diag(d) == 0).all()
    assert (d + 2 * np.eye(144) > 0).all()
    np.testing.assert_allclose(d, d.T, atol=1e-12)
    assert (d[:, None] <= d[:, :, None] + d[None] + 1e-12).all()


def test_a_virtual_edge_is_laid_only_where_it_crosses_the_shared_edge() -> None:
    kite = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0]]
    assert virtual_edge_graph(Mesh(kite, [[0, 1, 2], [1, 0, 3]]))[2, 3] == pytest.approx(2.0)
    folded = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 0, 1]]
    assert virtual_edge_graph(Mesh(folded, [[0, 1, 2], [1, 0, 3]]))[2, 3] == pytest.approx(2.0)
    bent_away = [[0, 0, 0], [1, 0, 0], [3, 0.1, 0], [3, -0.1, 0]]
    assert virtual_edge_graph(Mesh(bent_away, [[0, 1, 2], [1, 0, 3]]))[2, 3] == 0
    doubled = virtual_edge_graph(Mesh(np.eye(3), [[0, 1, 2], [2, 1, 0]]))
    np.testing.assert_allclose(doubled.data, np.sqrt(2))


@pytest.mark.parametrize("method", sorted(METHODS))
def test_no_way_leads_to_another_piece(method: str) -> None:
    pieces = Mesh(np.r_[PLANE.vertices, PLANE.vertices + 5], np.r_[PLANE.faces, PLANE.faces + 144])
    found = make_geodesics(pieces, method).distances([3, 150])
    np.testing.assert_array_equal(np.isinf(found), [[False] * 144 + [True] * 144, [True] * 144 + [False] * 144])
    np.testing.assert_array_equal(EdgeFlip(pieces).distance_pairs([3, 3], [150, 3]), [np.inf, 0])


def test_edge_flips_find_the_straight_line() -> None:
    a, b = np.array([0, 0, 70, 143]), np.array([143, 77, 3, 0])
    truth = np.linalg.norm(PLANE.vertices[a] - PLANE.vertices[b], axis=1)
    np.testing.assert_allclose(EdgeFlip(PLANE).distance_pairs(a, b), truth, rtol=1e-9)


FAULTS = {
    "used by more than two": [[0, 1, 2], [0, 1, 3], [1, 0, 4]],
    "twice in the same direction": [[0, 1, 2], [0, 1, 3], [2, 1, 4]],
    "several fans": [[0, 1, 2], [2, 3, 4]],
    "name a vertex twice": [[0, 1, 2], [2, 1, 3], [3, 4, 4]],
    "are in no triangle": [[0, 1, 2], [2, 1, 3]],
    "have no area": [[0, 1, 2], [2, 1, 3], [3, 5, 4]],
}


@pytest.mark.parametrize("make", [lambda mesh: make_geodesics(mesh, "exact"), EdgeFlip], ids=["exact", "edgeflip"])
@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_what_would_crash_a_solver_is_refused(fault: str, make: object) -> None:
    places = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 2, 0.5], [1, 2, 0.5]]
    faces = np.array(FAULTS[fault])
    with pytest.raises(InputError, match=fault):
        make(Mesh(places[: max(faces.max() + 1, 5)], faces))  # type: ignore[operator]


def test_bad_names_and_numbers_are_refused() -> None:
    with pytest.raises(UnknownNameError, match=r"fast marching.*bridged, dijkstra, exact, heat"):
        make_geodesics(PLANE, "fast marching")
    for method in METHODS:
        solver = make_geodesics(PLANE, method)
        assert isinstance(solver, Geodesics)
        assert solver.name == method
        assert solver.distances(np.zeros(0, dtype=int)).shape == (0, 144)
        for bad in (-1, 144):
            with pytest.raises(InputError, match=f"vertex {bad}"):
                solver.distances([bad])
    with pytest.raises(InputError, match="integers"):
        make_geodesics(PLANE, "dijkstra").distances([0.5])
    with pytest.raises(InputError, match="2 first and 1 second"):
        EdgeFlip(PLANE).distance_pairs([0, 1], [2])


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygeodesic.geodesic", None)
    with pytest.raises(MissingExtraError, match=r"nonrigid\[exact\]"):
        make_geodesics(PLANE, "exact")


@pytest.mark.realdata
def test_edge_flips_agree_with_exact_distances_on_a_real_part(data: Path) -> None:
    mesh = clean(read_mesh(data / "shrec16" / "cuts" / "cuts_cat_shape_1.off")).mesh
    sources = np.random.default_rng(1).choice(len(mesh.vertices), 4, replace=False)
    exact = make_geodesics(mesh, "exact").distances(sources)
    rows, ends = np.nonzero((exact > 0) & (exact < 0.25 * np.sqrt(mesh.area)))
    chosen = np.random.default_rng(2).choice(len(rows), 600, replace=False)
    rows, ends = rows[chosen], ends[chosen]
    found = EdgeFlip(mesh).distance_pairs(sources[rows], ends)
    error = found / exact[rows, ends] - 1
    assert error.min() > -1e-6
    assert error.mean() <= 0.005
    dijkstra = make_geodesics(mesh, "dijkstra").distances(sources)[rows, ends]
    assert 0 < (dijkstra / exact[rows, ends] - 1).mean() < 0.04


@pytest.mark.realdata
def test_the_template_that_crashes_solvers_is_refused_raw_and_measured_clean(data: Path) -> None:
    raw = read_mesh(data / "shrec16" / "null" / "cat.off")
    with pytest.raises(InputError, match="edges"):
        make_geodesics(raw, "exact")
    assert EdgeFlip(clean(raw).mesh).distance_pairs([0], [1]).shape == (1,)


def holed(mesh: Mesh, count: int, radius: float, seed: int) -> Mesh:
    """Return the largest piece of a mesh with round patches around some vertices cut out; vertices keep their order."""
    centres = mesh.vertices[np.random.default_rng(seed).choice(len(mesh.vertices), count, replace=False)]
    away = np.linalg.norm(mesh.vertices[:, None] - centres, axis=2).min(axis=1) > radius
    return restrict(mesh, largest_piece(mesh, away[mesh.faces].all(axis=1))).mesh


@pytest.mark.parametrize("seed", range(4))
def test_bridges_bring_back_most_of_what_holes_add(seed: int) -> None:
    part = holed(SPHERE, 8, 0.45, seed)
    sources = np.arange(0, len(part.vertices), 7)
    truth = np.arccos(np.clip(part.vertices[sources] @ part.vertices.T, -1, 1))
    plain, bridged = (make_geodesics(part, method).distances(sources) for method in ("dijkstra", "bridged"))
    assert (bridged <= plain + 1e-12).all()
    assert np.abs(bridged - truth).mean() < 0.75 * np.abs(plain - truth).mean()


def test_bridges_are_nothing_without_a_boundary_and_change_with_nothing_but_the_surface() -> None:
    sources = [0, 40, 100]
    plain, bridged = (make_geodesics(SPHERE, method).distances(sources) for method in ("dijkstra", "bridged"))
    np.testing.assert_array_equal(plain, bridged)
    part = holed(SPHERE, 3, 0.9, 1)  # loops of more vertices than bridges go between
    order = np.random.default_rng(0).permutation(len(part.vertices))
    turned = part.transformed(rotation=Rotation.from_rotvec([1.0, 0.2, 0.5]).as_matrix(), scale=3.0)
    moved = Mesh(turned.vertices[order], np.argsort(order)[part.faces])
    before = make_geodesics(part, "bridged").distances(order)[:, order]
    np.testing.assert_allclose(make_geodesics(moved, "bridged").distances(np.arange(len(order))), 3.0 * before)


def test_loops_of_the_boundary_are_its_pieces() -> None:
    assert SPHERE.boundary_loops == ()
    two = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]], [[0, 1, 2], [3, 4, 5]])
    assert [loop.tolist() for loop in two.boundary_loops] == [[0, 1, 2], [3, 4, 5]]


def test_bridges_over_a_round_hole_are_the_same_in_every_order_and_frame() -> None:
    angle = np.arange(200) * 2.0 * np.pi / 200
    rings = [np.c_[r * np.cos(angle), r * np.sin(angle), np.full(200, 3.0 * r)] for r in (1.0, 1.1, 1.2, 1.3)]
    vertices = np.vstack(rings)
    vertices[vertices[:, 0] > 1.2, 2] += 1.0  # so that no turn maps the tube onto itself
    quads = [(k, k - k % 200 + (k + 1) % 200) for k in range(600)]
    tube = Mesh(vertices, [f for a, b in quads for f in ((a, b, b + 200), (a, b + 200, a + 200))])
    order = np.random.default_rng(0).permutation(len(vertices))
    place = np.argsort(order)
    turned = Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix()
    other = Mesh(tube.vertices[order], place[tube.faces]).transformed(rotation=turned)
    sources = np.array([0, 57, 399, 700])
    here = make_geodesics(tube, "bridged").distances(sources)
    there = make_geodesics(other, "bridged").distances(place[sources])[:, place]
    np.testing.assert_allclose(there, here, rtol=1e-9, atol=1e-9)


def test_heat_refuses_vertices_in_no_triangle() -> None:
    loose = Mesh(np.vstack([PLANE.vertices, [[9.0, 9.0, 9.0]]]), PLANE.faces)
    with pytest.raises(InputError, match="'heat': 1 vertices are in no triangle; clean"):
        make_geodesics(loose, "heat").distances([0])
