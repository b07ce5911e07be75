"""Make parts of posed shapes by the recipe of SHREC'16: cuts and holes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.cuts import cut_by_plane, serving_planes
from nonrigid.benchmark.datasets.holes import grow_holes
from nonrigid.benchmark.datasets.posed import PosedClass, PosedShape, seed_of
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.arrays import BoolArray
from nonrigid.geometry.cache import Arrays, default_cache
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import Restriction, restrict
from nonrigid.geometry.points import SurfacePoints

RECIPE_VERSION = 3
"""Part of the cache's keys: raise it whenever the same parameters give other parts."""

PLANES = 6
HOLES = tuple((count, keep) for count in (5, 25, 50) for keep in (0.4, 0.7, 0.9))
"""Number of holes, and fraction of the area kept."""


def part_pairs(classes: Iterable[PosedClass], *, seed: int) -> list[PairSpec]:
    """List six cuts and nine holed shapes of every pose of every class, without making them.

    The same six planes cut all poses of a class: `cuts_<class>_shape_<n>` numbers them pose by pose. Three numbers of
    holes times three kept areas give `holes_<class>_shape_<n>`.
    """
    classes = tuple(classes)
    cuts = [
        _spec(_Part(posed, pose, "cuts", place * PLANES + plane + 1, seed, plane=plane), None)
        for posed in classes
        for place, pose in enumerate(posed.pose_names)
        for plane in range(PLANES)
    ]
    holes = [
        _spec(_Part(posed, pose, "holes", place * len(HOLES) + kind + 1, seed, holes=count, keep=keep), keep)
        for posed in classes
        for place, pose in enumerate(posed.pose_names)
        for kind, (count, keep) in enumerate(HOLES)
    ]
    return cuts + holes


@dataclass(frozen=True, eq=False)
class _Part:
    """Make one part; what is costly stays in the cache."""

    posed: PosedClass
    pose: str
    split: str
    number: int
    seed: int
    plane: int = -1
    holes: int = 0
    keep: float = 0.0

    @property
    def name(self) -> str:
        return f"{self.split}_{self.posed.name}_shape_{self.number}"

    def restriction(self) -> tuple[Restriction, PosedShape]:
        """Return the part of the pose, and the pose."""
        whole = self.posed.posed(self.pose)
        key = (RECIPE_VERSION, self.posed.key, self.pose, self.seed, self.plane, self.holes, self.keep)
        stored = default_cache().fetch(("part of a pose", *key), lambda: self._kept(whole))
        keep = np.unpackbits(stored["kept"].astype(np.uint8), count=len(whole.mesh.faces)).astype(np.bool_)
        return restrict(whole.mesh, keep, name=self.name), whole

    def _kept(self, whole: PosedShape) -> Arrays:
        return {"kept": np.packbits(self._mask(whole))}

    def _mask(self, whole: PosedShape) -> BoolArray:
        if self.split == "holes":
            seed = seed_of("holes", self.seed, self.posed.name, self.pose, self.holes, self.keep)
            return grow_holes(whole.mesh, holes=self.holes, keep=self.keep, seed=seed)
        template = self.posed.template()
        points, normals = serving_planes(template, PLANES, seed_of("planes", self.seed, self.posed.name))
        return cut_by_plane(whole.mesh, whole.truth, template, point=points[self.plane], normal=normals[self.plane])


@dataclass(frozen=True, eq=False)
class _Role:
    """Give one member of a pair when it is asked for; picklable, so that a pair can be sent to another process."""

    part: _Part
    role: str

    def mesh(self) -> Mesh:
        return self.part.posed.template() if self.role == "full" else self.part.restriction()[0].mesh

    def points(self) -> SurfacePoints:
        part, whole = self.part.restriction()
        points = whole.truth if self.role == "truth" else whole.mirrored
        assert points is not None
        return points[part.vertex_of_part]


def _spec(part: _Part, keep: float | None) -> PairSpec:
    return PairSpec(
        name=part.name,
        split=part.split,
        class_name=part.posed.name,
        part=_Role(part, "part").mesh,
        full=_Role(part, "full").mesh,
        truth=_Role(part, "truth").points,
        mirrored=_Role(part, "mirrored").points if part.posed.has_mirrored else None,
        source_pose=part.pose,
        own_pose=False,
        kept_area=keep,
    )
