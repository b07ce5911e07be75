"""The repaired view of a mesh on which every solver runs, and the maps between it and the mesh as read."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

STRAY_SHARE = 0.01
"""Pieces without a common vertex with the largest are dropped below this share of the area, else refused."""

PINCHED_SHARE = 0.1
"""Pieces that hang on the largest by single vertices are dropped below this share of the area, else refused; so are
all that are dropped, together."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CleanMesh:
    """Hold a manifold, consistently oriented, connected view of a mesh, and how it relates to the mesh as read.

    Parameters
    ----------
    mesh
        The repaired view, with n vertices and m faces, in the order of the raw mesh.
    raw
        The mesh as read.
    vertex_of_raw
        (n_raw,) clean vertex of each raw vertex, -1 where it was dropped. A raw vertex that was split gives the copy
        with the largest incident area.
    raw_of_vertex, raw_of_face
        (n,) and (m,) raw number of each clean vertex and face.
    repairs
        What was done, in words; empty where nothing was.
    """

    mesh: Mesh
    raw: Mesh
    vertex_of_raw: IntArray
    raw_of_vertex: IntArray
    raw_of_face: IntArray
    repairs: tuple[str, ...]

    def to_raw(self, points: SurfacePoints) -> SurfacePoints:
        """Return points of the clean view as points of the raw mesh; they lie at the same places."""
        points.check(self.mesh)
        return _renamed(points, self.raw_of_face, self._raw_corners, self.raw.faces)

    def from_raw(self, points: SurfacePoints) -> SurfacePoints:
        """Return points of the raw mesh as points of the clean view; unmatched where their face was dropped."""
        points.check(self.raw)
        face_of_raw = np.full(len(self.raw.faces), -1, dtype=np.int64)
        face_of_raw[self.raw_of_face] = np.arange(len(self.raw_of_face))
        return _renamed(points, face_of_raw, self.raw.faces, self._raw_corners)

    @property
    def _raw_corners(self) -> IntArray:
        return self.raw_of_vertex[self.mesh.faces]


def clean(mesh: Mesh) -> CleanMesh:
    """Return a repaired view of `mesh`: edge- and vertex-manifold, consistently oriented, one component.

    In this order: faces that name a vertex twice are dropped; of triangles on the same three vertices one is kept, or
    none where windings are opposite (a fold without thickness); windings are made consistent; vertices are split where
    several fans of triangles, or more than two triangles along an edge, meet; small pieces that hang on no edge of the
    rest are dropped (holes that touch leave such islands: on 10 of 57 SHREC'16 surfaces with holes, up to 1.0 % of the
    area), and vertices without a face with them. Vertices in the same place are not merged.

    Which side is outside: the signed volume about the area centroid,

        volume = sum over faces of (centre - centroid) . (b - a) x (c - a) / 6,

    is made positive where its sign would be the same for every reference point within the root mean square radius of
    the centroid, that is where |volume| > |vector area| radius / 3: closed and nearly closed surfaces. On flatter open
    parts nothing intrinsic tells the sides apart; they keep the side that the larger part of the area has in the file.
    Neither rule depends on the frame or on the order of vertices.

    Raises
    ------
    InputError
        If the area is zero, no face is left, or a piece is too large to drop: `PINCHED_SHARE` of the area where it
        hangs on the largest piece by single vertices, `STRAY_SHARE` where it does not hang on it at all; or if all
        pieces but the largest have `PINCHED_SHARE` together, as those of a file do in which triangles share no vertex.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]], [[0, 1, 2], [0, 3, 2], [1, 1, 2]])
    >>> view = clean(square)
    >>> len(view.mesh.vertices), len(view.mesh.faces)
    (4, 2)
    >>> view.repairs
    ('dropped 1 face that names a vertex twice', 'reversed 1 face', 'dropped 1 vertex without a face')
    """
    if not mesh.area > 0:
        raise InputError("the total area is zero", file=mesh.source, remedy="check the unit and the faces of the mesh")
    repairs: list[str] = []
    kept = _without_repeated_corners(mesh.faces, repairs)
    kept = kept[_without_doubles(mesh.faces[kept], repairs)]
    if not len(kept):
        raise InputError(f"no face is left: {'; '.join(repairs)}", file=mesh.source, remedy="export the mesh again")

    raw_faces = mesh.faces[kept]
    oriented = np.asarray(igl.bfs_orient(raw_faces)[0], dtype=np.int64)
    one_sided = _edges_run_twice_the_same_way(oriented)
    faces, raw_of_copy = _split(oriented)

    inside = _largest_piece(mesh, faces, kept, raw_of_copy, repairs)
    kept, raw_faces, faces = kept[inside], raw_faces[inside], faces[inside]
    flipped = _oddly_permuted(raw_faces, raw_of_copy[faces])
    if _is_inside_out(mesh.vertices[raw_of_copy[faces]], flipped):
        faces, flipped = faces[:, ::-1], ~flipped
    if flipped.any():
        repairs.append(f"reversed {_counted(int(flipped.sum()), 'face')}")
    if one_sided:
        repairs.append("cut the surface open, because it has only one side")

    faces, raw_of_vertex = _renumbered(mesh, faces, kept, raw_of_copy)
    vertex_of_raw = np.full(len(mesh.vertices), -1, dtype=np.int64)
    vertex_of_raw[raw_of_vertex[::-1]] = np.arange(len(raw_of_vertex))[::-1]
    _describe_vertices(vertex_of_raw, raw_of_vertex, repairs)
    return CleanMesh(
        mesh=Mesh(mesh.vertices[raw_of_vertex], faces, name=mesh.name, file=mesh.file),
        raw=mesh,
        vertex_of_raw=vertex_of_raw,
        raw_of_vertex=raw_of_vertex,
        raw_of_face=kept,
        repairs=tuple(repairs),
    )


def _without_repeated_corners(faces: IntArray, repairs: list[str]) -> IntArray:
    a, b, c = faces.T
    proper = np.flatnonzero((a != b) & (b != c) & (c != a))
    if len(proper) < len(faces):
        repairs.append(f"dropped {_counted(len(faces) - len(proper), 'face')} that names a vertex twice")
    return proper


def _without_doubles(faces: IntArray, repairs: list[str]) -> IntArray:
    """Return the faces to keep: one of equal triangles, none of those that also occur with the opposite winding."""
    _, first, group = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    opposite = _oddly_permuted(faces[first][group], faces)
    folded = np.zeros(len(first), dtype=bool)
    folded[group[opposite]] = True
    kept = np.sort(first[~folded])
    if len(kept) < len(faces):
        repairs.append(f"dropped {_counted(len(faces) - len(kept), 'doubled triangle')}")
    return kept


def _split(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Cut where the surface is no manifold; return the faces over the copies and the raw vertex of each copy."""
    split, raw_of_copy = igl.split_nonmanifold(np.ascontiguousarray(faces))
    return np.asarray(split, dtype=np.int64), np.asarray(raw_of_copy, dtype=np.int64)


def _largest_piece(mesh: Mesh, faces: IntArray, kept: IntArray, raw_of_copy: IntArray, repairs: list[str]) -> BoolArray:
    """(m,) whether each face lies in the largest piece; the others are recorded, or refused where they are large."""
    piece = _component_of_face(faces, len(raw_of_copy))
    areas = np.bincount(piece, weights=mesh.face_areas[kept])
    if len(areas) == 1:
        return np.ones(len(faces), dtype=bool)
    shares = areas / areas.sum()
    largest = int(areas.argmax())
    touching = _component_of_face(raw_of_copy[faces], len(mesh.vertices))
    pinched = np.zeros(len(areas), dtype=bool)
    pinched[piece] = touching == touching[piece == largest][0]
    too_large = shares >= np.where(pinched, PINCHED_SHARE, STRAY_SHARE)
    too_large[largest] = False
    in_crumbs = 1.0 - shares[largest] >= PINCHED_SHARE
    stacked = _stacked_vertices(mesh.vertices[np.unique(raw_of_copy[faces])])
    hint = f" ({stacked} vertices lie in the place of another and are not merged)" if stacked else ""
    if too_large.any() or in_crumbs:
        listed = ", ".join(f"{share:.1%}" for share in np.sort(shares)[::-1][:5])
        raise InputError(
            f"the surface falls into {len(areas)} pieces without a common edge, {(~pinched).sum()} of them without a"
            f" common vertex with the largest, with {listed} of the area{hint}",
            file=mesh.source,
            remedy="keep one piece, or merge vertices that lie in the same place",
        )
    repairs.append(
        f"dropped {_counted(len(areas) - 1, 'piece')} that no edge joins to the rest,"
        f" {1.0 - shares[largest]:.2g} of the area{hint}"
    )
    return np.asarray(piece == largest)


def _component_of_face(faces: IntArray, vertex_count: int) -> IntArray:
    start, end = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(vertex_count, vertex_count))
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    return np.asarray(np.unique(label, return_inverse=True)[1], dtype=np.int64)


def _stacked_vertices(vertices: FloatArray) -> int:
    return len(vertices) - len(np.unique(vertices, axis=0))


def _is_inside_out(corners: FloatArray, flipped: BoolArray) -> bool:
    """Tell whether the (m, 3, 3) oriented triangles should be reversed; see `clean` for the rule."""
    cross = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1)
    centres = corners.mean(axis=1)
    arms = centres - np.average(centres, axis=0, weights=areas)
    volume = np.einsum("fx,fx->", arms, cross) / 3.0
    radius = np.sqrt(np.average(np.square(arms).sum(axis=1), weights=areas))
    if abs(volume) > np.linalg.norm(cross.sum(axis=0)) * radius / 3.0 and abs(volume) > 1e-9 * areas.sum() * radius:
        return bool(volume < 0)
    return bool(areas[flipped].sum() > areas[~flipped].sum())


def _renumbered(mesh: Mesh, faces: IntArray, kept: IntArray, raw_of_copy: IntArray) -> tuple[IntArray, IntArray]:
    """Give the used copies numbers in the order of the raw vertices, larger incident area first."""
    areas = np.bincount(faces.ravel(), weights=np.repeat(mesh.face_areas[kept], 3), minlength=len(raw_of_copy))
    order = np.lexsort((-areas, raw_of_copy))
    order = order[np.isin(order, faces)]
    number = np.full(len(raw_of_copy), -1, dtype=np.int64)
    number[order] = np.arange(len(order))
    return number[faces], raw_of_copy[order]


def _describe_vertices(vertex_of_raw: IntArray, raw_of_vertex: IntArray, repairs: list[str]) -> None:
    dropped = int((vertex_of_raw < 0).sum())
    if dropped:
        repairs.append(f"dropped {_counted(dropped, 'vertex')} without a face")
    copies = np.bincount(raw_of_vertex)
    if (copies > 1).any():
        repairs.append(
            f"split {_counted(int((copies > 1).sum()), 'vertex')} of several fans into {copies[copies > 1].sum()}"
        )


def _edges_run_twice_the_same_way(faces: IntArray) -> bool:
    """Tell whether two triangles alone on an edge run it in the same direction: no consistent winding exists."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, edge, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    forward = np.bincount(edge, weights=directed[:, 0] < directed[:, 1])
    return bool(((count == 2) & (forward != 1)).any())


def _oddly_permuted(faces: IntArray, others: IntArray) -> BoolArray:
    """(m,) whether each row of `others` lists the corners of that row of `faces` with the opposite winding."""
    start = faces[:, 0]
    at = (others == start[:, None]).argmax(axis=1)
    following = others[np.arange(len(others)), (at + 1) % 3]
    return np.asarray(following != faces[:, 1])


def _renamed(points: SurfacePoints, face_map: IntArray, corners: IntArray, new_corners: IntArray) -> SurfacePoints:
    """Rename faces, and re-order the weights from the corners of the old faces to those of the new ones."""
    faces = np.where(points.matched, face_map[points.faces], -1)
    same = new_corners[faces][:, :, None] == corners[points.faces][:, None, :]
    weights = np.einsum("pij,pj->pi", same.astype(np.float64), points.barycentric)
    return SurfacePoints(faces, weights)


def _counted(count: int, noun: str) -> str:
    plural = {"vertex": "vertices"}.get(noun, noun + "s")
    return f"{count} {noun if count == 1 else plural}"
