"""Eight creatures in several poses, cut and holed, with exact ground truth: data that ships as code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.anatomy import Anatomy
from nonrigid.benchmark.datasets.bestiary import ANATOMIES
from nonrigid.benchmark.datasets.body import Body, build_body
from nonrigid.benchmark.datasets.parts import part_pairs
from nonrigid.benchmark.datasets.posed import (
    PosedShape,
    remeshed,
    seed_of,
    shape_arrays,
    shape_from_arrays,
    through_dense,
)
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.cache import Arrays, default_cache
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.remesh import closest_points

FEWEST_VERTICES = 500

_VERSION = 3
"""Part of the cache's keys: raise it whenever the same parameters give other meshes."""

_FEWEST_DENSE = 24_000
"""Fewer vertices lose fingers and ears of the dense skin."""


@dataclass(frozen=True, kw_only=True)
class Creatures:
    """Offer cuts and holes of three people, a cat, a dog, a wolf, a horse and a centaur, without any file.

    Each class has a left-right symmetric template and eight poses of it, remeshed independently and numbered at random.
    The ground truth goes through the dense skin on which all poses are made, so that it is exact up to the remeshing.
    The mirrored truth reflects the template. Equal parameters give equal pairs; built shapes stay in the cache.

    Parameters
    ----------
    vertices
        Vertices of each complete shape, template or pose; SHREC'16 has 10 000.
    seed
        For planes, borders of holes and the numbering.

    Raises
    ------
    InputError
        If fewer than 500 vertices are asked for: ears and paws would be lost.

    Examples
    --------
    >>> specs = Creatures().pairs()
    >>> specs[0].name, len(specs), len({spec.class_name for spec in specs})
    ('cuts_anton_shape_1', 960, 8)
    """

    vertices: int = 2500
    seed: int = 0

    def __post_init__(self) -> None:
        if self.vertices < FEWEST_VERTICES:
            raise InputError(f"{self.vertices} vertices are too few", remedy=f"ask for at least {FEWEST_VERTICES}")

    @property
    def name(self) -> str:
        """Name of the data set with its size and seed."""
        return f"creatures {self.vertices} seed {self.seed}"

    def classes(self) -> tuple[Creature, ...]:
        """Return the eight classes."""
        return tuple(Creature(anatomy=one, vertices=self.vertices, seed=self.seed) for one in ANATOMIES)

    def pairs(self) -> Sequence[PairSpec]:
        """List six cuts and nine holed shapes of every pose, without building them."""
        return part_pairs(self.classes(), seed=self.seed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Creature:
    """Offer the template and the poses of one creature.

    Parameters
    ----------
    anatomy
        What it is made of.
    vertices, seed
        As in `Creatures`.
    """

    anatomy: Anatomy
    vertices: int
    seed: int = 0

    @property
    def name(self) -> str:
        """Name of the class."""
        return self.anatomy.name

    @property
    def key(self) -> str:
        """Text that differs whenever a shape does."""
        return repr((_VERSION, self.anatomy, self.vertices, self.seed))

    @property
    def pose_names(self) -> tuple[str, ...]:
        """The class's name with the numbers of the poses; number 0 would be the template."""
        return tuple(f"{self.name}{number}" for number in range(1, len(self.anatomy.poses) + 1))

    @property
    def has_mirrored(self) -> bool:
        """True: the template is symmetric."""
        return True

    def template(self) -> Mesh:
        """Return the remeshed neutral pose."""

        def build() -> Arrays:
            mesh = remeshed(self._body().skin, self.vertices, seed_of(self.seed, self.name, "template"))
            return {"vertices": mesh.vertices, "faces": mesh.faces}

        stored = default_cache().fetch(("creature template", self.key), build)
        return Mesh(stored["vertices"], stored["faces"], name=self.name)

    def posed(self, pose: str) -> PosedShape:
        """Return a pose.

        The truth of a vertex: the closest point of the dense pose, the same triangle and weights on the dense neutral
        skin, from there the closest point of the template; for the mirrored truth the point of the neutral skin is
        reflected before the last step.
        """

        def build() -> Arrays:
            body, template = self._body(), self.template()
            dense = body.posed(self.anatomy.poses[self.pose_names.index(pose)])
            mesh = remeshed(dense, self.vertices, seed_of(self.seed, pose))
            neutral = through_dense(mesh, dense, body.skin)
            truth = closest_points(template, neutral)
            mirrored = closest_points(template, neutral * np.array([-1.0, 1.0, 1.0]))
            return shape_arrays(PosedShape(mesh=mesh, truth=truth, mirrored=mirrored))

        stored = default_cache().fetch(("creature pose", self.key, pose), build)
        return shape_from_arrays(stored, pose)

    def _body(self) -> Body:
        count = max(_FEWEST_DENSE, 3 * self.vertices)

        def build() -> Arrays:
            body = build_body(self.anatomy, count)
            return {"vertices": body.skin.vertices, "faces": body.skin.faces, "weights": body.weights}

        stored = default_cache().fetch(("creature body", _VERSION, repr(self.anatomy), count), build)
        skin = Mesh(stored["vertices"], stored["faces"], name=self.name)
        weights = np.asarray(stored["weights"], dtype=np.float64)
        return Body(anatomy=self.anatomy.both_sides(), skin=skin, weights=weights)
