"""Pictures show what is nearest, where it is, in its colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from nonrigid.benchmark.render import View, framing, position_colors, render, save_png
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import isosurface

BALL = isosurface(lambda p: np.linalg.norm(p, axis=1) - 1.0, [-1.2] * 3, [1.2] * 3, 0.1)
FRONT = View(azimuth=0.0, elevation=0.0)


def test_a_ball_covers_a_disc() -> None:
    image = render(BALL, view=FRONT, size=100)
    radius = 0.48 * 100
    np.testing.assert_allclose(image[..., 3].sum() / 255.0, np.pi * radius**2, rtol=0.02)
    assert image[50, 50, 3] == 255
    assert image[2, 2].tolist() == [0, 0, 0, 0]


def test_the_nearest_triangle_is_seen_in_any_order() -> None:
    corners = np.array([[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]])
    mesh = Mesh(np.vstack([corners, corners - [0, 0, 1], corners - [0, 0, -1]]), [[0, 1, 2], [3, 4, 5], [6, 7, 8]])
    colors = np.eye(3)
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        seen = render(Mesh(mesh.vertices, mesh.faces[order]), colors[order], view=FRONT, size=40)
        assert seen[24, 16].argmax() in (2, 3)
        assert seen[24, 16, 2] > 3 * seen[24, 16, :2].max()
        behind = render(
            Mesh(mesh.vertices, mesh.faces[order]), colors[order], view=View(azimuth=180, elevation=0), size=40
        )
        assert behind[24, 24, :3].argmax() == 1


@pytest.mark.parametrize(("up", "tip"), [("x", 0), ("y", 1), ("z", 2)])
def test_the_chosen_axis_points_up(up: str, tip: int) -> None:
    mesh = BALL.transformed(scale=0.5, translation=1.2 * np.eye(3)[tip])
    view = View(up=up, azimuth=70.0, elevation=10.0, centre=(0, 0, 0), radius=2.0)  # type: ignore[arg-type]
    rows = np.flatnonzero(render(mesh, view=view, size=60)[..., 3].any(axis=1))
    assert 3 < rows[0] < 10
    assert rows[-1] < 25
    np.testing.assert_allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.rotation) == pytest.approx(1.0)


def test_order_of_faces_and_vertices_changes_nothing() -> None:
    generator = np.random.default_rng(0)
    order, faces = generator.permutation(len(BALL.vertices)), generator.permutation(len(BALL.faces))
    other = Mesh(BALL.vertices[order], np.argsort(order)[BALL.faces][faces])
    one = render(BALL, position_colors(BALL.vertices, BALL), size=80).astype(int)
    two = render(other, position_colors(other.vertices, other), size=80).astype(int)
    assert np.abs(one - two).max() <= 1


def test_the_inside_is_dark_and_large_triangles_are_drawn_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    square = Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    outside = render(square, view=FRONT, size=60)
    inside = render(square, view=View(azimuth=180, elevation=0), size=60)
    assert outside[30, 30, :3].sum() > 1.3 * inside[30, 30, :3].sum()
    monkeypatch.setattr("nonrigid.benchmark.render._BLOCK", 10)
    np.testing.assert_array_equal(render(square, view=FRONT, size=60), outside)


def test_parts_can_be_drawn_at_the_scale_of_the_whole() -> None:
    small = BALL.transformed(scale=0.5)
    view = framing(BALL, FRONT)
    drawn, whole = render(small, view=view, size=80), render(BALL, view=view, size=80)
    assert drawn[..., 3].sum() / whole[..., 3].sum() == pytest.approx(0.25, rel=0.05)


def test_colours_and_files_are_checked(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"colors have shape \(2, 3\)"):
        render(BALL, np.zeros((2, 3)))
    assert position_colors([[np.nan] * 3], BALL).tolist() == [[0.6, 0.6, 0.6]]
    image = render(BALL, size=30)
    save_png(image, tmp_path / "ball.png")
    np.testing.assert_allclose(imread(tmp_path / "ball.png"), image / 255.0, atol=1e-3)
    assert list(tmp_path.iterdir()) == [tmp_path / "ball.png"]
    with pytest.raises(InputError, match="does not exist"):
        save_png(image, tmp_path / "no" / "ball.png")
