"""A training set and a test set of two classes, with the official layout."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nonrigid.benchmark.datasets.convert import pack
from nonrigid.benchmark.formats import write_baryc
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import decimate, isosurface


def lump(x: float, y: float, z: float) -> Mesh:
    """Return a closed surface without symmetry."""

    def inside(p: np.ndarray) -> np.ndarray:
        return np.linalg.norm(p / [1.0, y, z], axis=1) - 1.0 - 0.2 * np.sin(3 * p[:, 0] + x)

    return decimate(isosurface(inside, [-1.5] * 3, [1.5] * 3, 0.12), 300)


@pytest.fixture(scope="session")
def fulls() -> dict[str, Mesh]:
    """Two classes, one with a name that no list of ours holds."""
    return {"cat": lump(0.3, 0.8, 0.6), "sea-horse": lump(1.0, 0.6, 0.9)}


def build(root: Path, fulls: dict[str, Mesh], *, truth: bool = True, null: bool = True, seed: int = 0) -> Path:
    """Write a set with the official layout: two splits, two classes, parts of several poses."""
    generator = np.random.default_rng(seed)
    poses = []
    for class_name, full in fulls.items():
        (root / "null").mkdir(parents=True, exist_ok=True)
        write_off(full, root / "null" / f"{class_name}.off")
        for split, numbers in (("cuts", (1, 2, 10)), ("holes", (1, 2))):
            (root / split).mkdir(exist_ok=True)
            for number in numbers:
                direction = generator.normal(size=3)
                centres = full.vertices[full.faces].mean(axis=1)
                part = restrict(full, centres @ direction > 0.1 * number / 10)
                stem = root / split / f"{split}_{class_name}_shape_{number}"
                pose = number % 3
                moved = part.mesh.transformed(translation=[5.0 * pose, 0, 0])
                write_off(moved, stem.with_suffix(".off"))
                poses.append(f"{stem.name},{class_name}{pose}")
                points = SurfacePoints.at_vertices(full, part.vertex_of_part)
                if truth:
                    write_baryc(stem.with_suffix(".baryc_gt"), points)
                    write_baryc(stem.with_suffix(".baryc_gt_sym"), points)
    (root / "source_poses.csv").write_text("shape,source_pose\n" + "\n".join(poses) + "\n")
    if not null:
        shutil.rmtree(root / "null")
        (root / "source_poses.csv").unlink()
    return root


@pytest.fixture(scope="session")
def training(fulls: dict[str, Mesh], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("a") / "shrec2016_PartialDeformableShapes", fulls)


@pytest.fixture(scope="session")
def test_set(fulls: dict[str, Mesh], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("b") / "shrec2016_PartialDeformableShapes_TestSet"
    return build(folder, fulls, truth=False, null=False, seed=1)


@pytest.fixture
def copy(training: Path, tmp_path: Path) -> Path:
    """Return a copy of the training set, to be spoiled."""
    return Path(shutil.copytree(training, tmp_path / "set"))


@pytest.fixture(scope="session")
def zipped() -> Callable[[Path, Path], Path]:
    """Pack a folder, and return the archive."""

    def packed(folder: Path, path: Path) -> Path:
        pack(folder, path, inside=folder.name)
        return path

    return packed
