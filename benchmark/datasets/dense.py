"""Classes of dense meshes whose vertices correspond by their numbers, such as those of TOSCA."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from nonrigid.benchmark.datasets.posed import (
    PosedShape,
    remeshed,
    seed_of,
    shape_arrays,
    shape_from_arrays,
    through_dense,
)
from nonrigid.geometry.arrays import IntArray
from nonrigid.geometry.cache import Arrays, content_hash, default_cache
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import closest_points

_POSE = re.compile(r"(?P<class_name>.*\D)(?P<number>\d+)")
_SUFFIXES = (".off", ".obj", ".ply", ".mat", ".vert")
_VERSION = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class DenseClass:
    """Remesh a class of dense meshes, of which the one with the lowest number is the template.

    Parameters
    ----------
    name
        Of the class.
    files
        The template and its poses. Vertices correspond by number; the template's triangles serve for all.
    vertices
        Vertices of each remeshed shape; a dense mesh that has hardly more is brought to nine tenths of its own.
    seed
        For the numbering.

    Source: methods of the track, Cosmo et al. 2016: shapes are remeshed first and cut after.
    """

    name: str
    files: tuple[Path, ...]
    vertices: int
    seed: int = 0

    @cached_property
    def key(self) -> str:
        """Text that differs whenever a file does."""
        return content_hash(_VERSION, self.name, self.vertices, self.seed, *(file.read_bytes() for file in self.files))

    @property
    def pose_names(self) -> tuple[str, ...]:
        """The names of the files of the poses."""
        return tuple(file.stem for file in self.files[1:])

    @property
    def has_mirrored(self) -> bool:
        """False: nothing tells left from right."""
        return False

    def template(self) -> Mesh:
        """Return the remeshed template."""

        def build() -> Arrays:
            mesh = self._remeshed(read_mesh(self.files[0]), self.files[0].stem)
            return {"vertices": mesh.vertices, "faces": mesh.faces}

        stored = default_cache().fetch(("dense template", self.key), build)
        return Mesh(stored["vertices"], stored["faces"], name=self.name)

    def posed(self, pose: str) -> PosedShape:
        """Return a remeshed pose and its truth, which goes through the dense meshes.

        Raises
        ------
        InputError
            If the dense meshes have not the same triangles.
        """

        def build() -> Arrays:
            neutral = read_mesh(self.files[0])
            dense = self._with_same_faces(read_mesh(self.files[1 + self.pose_names.index(pose)]), neutral)
            mesh = self._remeshed(dense, pose)
            truth = closest_points(self.template(), through_dense(mesh, dense, neutral))
            return shape_arrays(PosedShape(mesh=mesh, truth=truth, mirrored=None))

        return shape_from_arrays(default_cache().fetch(("dense pose", self.key, pose), build), pose)

    def _remeshed(self, dense: Mesh, pose: str) -> Mesh:
        # Fewer than the dense mesh has, or nothing would tell the triangulations of two poses apart.
        return remeshed(dense, min(self.vertices, 9 * len(dense.vertices) // 10), seed_of(self.seed, pose))

    def _with_same_faces(self, dense: Mesh, neutral: Mesh) -> Mesh:
        if len(dense.vertices) != len(neutral.vertices) or not np.array_equal(_sorted(dense), _sorted(neutral)):
            raise InputError(
                f"{dense.name} has not the triangles of {neutral.name}, of which it should be a pose",
                remedy="give meshes whose vertices are numbered alike",
            )
        return Mesh(dense.vertices, neutral.faces, name=dense.name)


def dense_classes(root: Path, *, vertices: int, seed: int) -> Sequence[DenseClass]:
    """Find the classes in a folder of meshes called `<class><number>`, with at least two poses each, by name.

    Raises
    ------
    InputError
        If there is no folder, or no class with two poses in it.
    """
    if not root.is_dir():
        raise InputError("there is no such folder", file=root, remedy="name a folder of dense meshes such as cat0.off")
    found: dict[str, dict[int, Path]] = {}
    for path in sorted(root.iterdir()):
        match = _POSE.fullmatch(path.stem)
        if match and path.suffix.lower() in _SUFFIXES:
            found.setdefault(match["class_name"], {})[int(match["number"])] = path
    classes = [
        DenseClass(name=name, files=tuple(files[n] for n in sorted(files)), vertices=vertices, seed=seed)
        for name, files in sorted(found.items())
        if len(files) > 1
    ]
    if not classes:
        raise InputError(
            f"no two meshes are called like cat0{_SUFFIXES[0]} and cat1{_SUFFIXES[0]}",
            file=root,
            remedy="name each mesh after its class, with the pose's number",
        )
    return classes


def _sorted(mesh: Mesh) -> IntArray:
    faces = np.sort(mesh.faces, axis=1)
    return np.asarray(faces[np.lexsort(faces.T)])
