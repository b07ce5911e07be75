"""Two creatures in several poses, cut and holed, with exact ground truth: data that ships as code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.anatomy import ANATOMIES, Anatomy
from nonrigid.benchmark.datasets.body import Body, build_body
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.benchmark.datasets.recipe import cut_by_plane, cut_planes, grow_holes
from nonrigid.geometry.arrays import BoolArray
from nonrigid.geometry.cache import Arrays, content_hash, default_cache
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import restrict
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points, decimate

FEWEST_VERTICES = 500

_RECIPE_VERSION = 1
"""Part of the cache's keys: raise it whenever the same parameters give other meshes."""

_CUT_KEEPS = (0.35, 0.75)
"""Planes that keep an area fraction outside this range are passed over."""


@dataclass(frozen=True, kw_only=True)
class Creatures:
    """Offer cuts and holes of a fox and a troll, in three poses each, without any file.

    Each class has a left-right symmetric template and poses of it, remeshed independently and numbered at random. The
    ground truth goes through the dense skin on which all poses are made, so that it is exact up to the remeshing. The
    mirrored truth reflects the template. Equal parameters give equal pairs; built pairs stay in the cache.

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
    >>> [spec.name for spec in Creatures().pairs()][:2]
    ['cuts_fox_shape_1', 'cuts_fox_shape_2']
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

    def pairs(self) -> Sequence[PairSpec]:
        """List two cuts and two holes of each creature."""
        specs = []
        for split, parts in (("cuts", _CUTS), ("holes", _HOLES)):
            for anatomy in ANATOMIES:
                for number, (pose, holes, keep) in enumerate(parts, start=1):
                    piece = _Piece(self, anatomy, split, number, pose, holes, keep)
                    specs.append(
                        PairSpec(
                            name=piece.name,
                            split=split,
                            class_name=anatomy.name,
                            part=_Role(piece, "part").mesh,
                            full=_Role(piece, "full").mesh,
                            truth=_Role(piece, "truth").points,
                            mirrored=_Role(piece, "mirrored").points,
                            source_pose=f"{anatomy.name}{pose + 1}",
                            own_pose=False,
                            kept_area=keep or None,
                        )
                    )
        return specs


# Pose, number of holes, area kept (for cuts the plane decides).
_CUTS = ((0, 0, 0.0), (1, 0, 0.0))
_HOLES = ((1, 5, 0.7), (2, 15, 0.55))


@dataclass(frozen=True, eq=False)
class _Piece:
    """Build one pair, or fetch it from the cache."""

    data: Creatures
    anatomy: Anatomy
    split: str
    number: int
    pose: int
    holes: int
    keep: float

    @property
    def name(self) -> str:
        return f"{self.split}_{self.anatomy.name}_shape_{self.number}"

    def arrays(self) -> Arrays:
        """Return the meshes and points by role."""
        own = (self.split, self.number, self.pose, self.holes, self.keep)
        return default_cache().fetch(("creature pair", *_key(self.data, self.anatomy), *own), self._build)

    def _build(self) -> Arrays:
        stored = posed_creature(self.anatomy, self.pose, vertices=self.data.vertices, seed=self.data.seed)
        template = Mesh(stored["full vertices"], stored["full faces"], name=self.anatomy.name)
        pose = Mesh(stored["part vertices"], stored["part faces"], name=f"{self.anatomy.name}{self.pose + 1}")
        truth = SurfacePoints(stored["truth faces"], stored["truth weights"])
        mirrored = SurfacePoints(stored["mirrored faces"], stored["mirrored weights"])
        part = restrict(pose, self._kept(pose, truth, template))
        inside = part.vertex_of_part
        return _flat(part.mesh, template, truth[inside], mirrored[inside])

    def _kept(self, pose: Mesh, truth: SurfacePoints, template: Mesh) -> BoolArray:
        seed = _seed(self.data.seed, self.name)
        if self.split == "holes":
            return grow_holes(pose, holes=self.holes, keep=self.keep, seed=seed)
        low, high = _CUT_KEEPS
        for point, normal in zip(*cut_planes(template, 100, seed), strict=True):
            kept = cut_by_plane(pose, truth, template, point=point, normal=normal)
            if low <= pose.face_areas[kept].sum() / pose.area <= high:
                return kept
        raise InputError(
            f"no plane of a hundred keeps {low:.0%} to {high:.0%} of {pose.name}", remedy="change the seed"
        )


@dataclass(frozen=True, eq=False)
class _Role:
    """Give one member of a pair when it is asked for; picklable, so that a pair can be sent to another process."""

    piece: _Piece
    role: str

    def mesh(self) -> Mesh:
        arrays = self.piece.arrays()
        name = self.piece.name if self.role == "part" else self.piece.anatomy.name
        return Mesh(arrays[f"{self.role} vertices"], arrays[f"{self.role} faces"], name=name)

    def points(self) -> SurfacePoints:
        arrays = self.piece.arrays()
        return SurfacePoints(arrays[f"{self.role} faces"], arrays[f"{self.role} weights"])


def posed_creature(anatomy: Anatomy, pose: int, *, vertices: int, seed: int = 0) -> Arrays:
    """Return a complete pose, the template and the ground truth between them, as arrays by role, kept in the cache.

    The keys are "part vertices", "part faces" (here the whole pose), "full vertices", "full faces" (the template),
    "truth faces", "truth weights" and the same of "mirrored". The truth of a vertex of the pose: the closest point of
    the dense pose, the same triangle and weights on the dense neutral skin, from there the closest point of the
    template; for the mirrored truth the point of the neutral skin is reflected before the last step.
    """

    def build() -> Arrays:
        body = _body(anatomy, vertices)
        template = _template(body, vertices, seed)
        dense = body.posed(anatomy.poses[pose])
        mesh = _remeshed(dense, vertices, _seed(seed, anatomy.name, pose))
        neutral = closest_points(dense, mesh.vertices).positions(body.skin)
        truth = closest_points(template, neutral)
        mirrored = closest_points(template, neutral * np.array([-1.0, 1.0, 1.0]))
        return _flat(mesh, template, truth, mirrored)

    return default_cache().fetch(("creature pose", _RECIPE_VERSION, repr(anatomy), pose, vertices, seed), build)


def _body(anatomy: Anatomy, vertices: int) -> Body:
    count = 4_000 + 26 * vertices // 10
    stored = default_cache().fetch(
        ("creature body", _RECIPE_VERSION, repr(anatomy), count), lambda: _body_arrays(build_body(anatomy, count))
    )
    skin = Mesh(stored["vertices"], stored["faces"], name=anatomy.name)
    return Body(anatomy=anatomy.both_sides(), skin=skin, weights=np.asarray(stored["weights"], dtype=np.float64))


def _template(body: Body, vertices: int, seed: int) -> Mesh:
    def build() -> Arrays:
        mesh = _remeshed(body.skin, vertices, _seed(seed, body.anatomy.name, "template"))
        return {"vertices": mesh.vertices, "faces": mesh.faces}

    stored = default_cache().fetch(("creature template", _RECIPE_VERSION, repr(body.anatomy), vertices, seed), build)
    return Mesh(stored["vertices"], stored["faces"], name=body.anatomy.name)


def _body_arrays(body: Body) -> Arrays:
    return {"vertices": body.skin.vertices, "faces": body.skin.faces, "weights": body.weights}


def _remeshed(dense: Mesh, vertices: int, seed: int) -> Mesh:
    """Return a decimation that shares neither triangulation nor numbering with that of another pose.

    Where a limb moves rigidly the dense triangles are the same in both poses and would collapse in the same order.
    Hence each dense vertex first slides towards the centre of a random triangle beside it, staying on the dense
    surface.
    """
    generator = np.random.default_rng(seed)
    face = np.empty(len(dense.vertices), dtype=np.int64)
    order = generator.permutation(3 * len(dense.faces))
    face[dense.faces.ravel()[order]] = order // 3
    centre = dense.vertices[dense.faces[face]].mean(axis=1)
    share = generator.uniform(0.0, 0.5, size=(len(face), 1))
    small = decimate(Mesh(dense.vertices + share * (centre - dense.vertices), dense.faces, name=dense.name), vertices)
    number = generator.permutation(len(small.vertices))
    corners = np.argsort(number)[small.faces]
    return Mesh(small.vertices[number], corners[generator.permutation(len(corners))], name=dense.name)


def _flat(part: Mesh, full: Mesh, truth: SurfacePoints, mirrored: SurfacePoints) -> Arrays:
    return {
        "part vertices": part.vertices,
        "part faces": part.faces,
        "full vertices": full.vertices,
        "full faces": full.faces,
        "truth faces": truth.faces,
        "truth weights": truth.barycentric,
        "mirrored faces": mirrored.faces,
        "mirrored weights": mirrored.barycentric,
    }


def _key(data: Creatures, anatomy: Anatomy) -> tuple[object, ...]:
    return (_RECIPE_VERSION, repr(anatomy), data.vertices, data.seed)


def _seed(*parts: object) -> int:
    return int(content_hash(*parts)[:15], 16)
