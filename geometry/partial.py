"""Cut a part out of a mesh, and keep account of where it came from and how much area it keeps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nonrigid.geometry.arrays import BoolArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints


@dataclass(frozen=True, eq=False, kw_only=True)
class Restriction:
    """Hold a part of a mesh and the numbers its vertices and faces have in the whole.

    Parameters
    ----------
    mesh
        The part; its vertices and faces stand in the order they have in the whole.
    whole
        The mesh it was cut from.
    vertex_of_part
        (n_part,) number in the whole of each vertex of the part.
    face_of_part
        (m_part,) number in the whole of each face of the part.
    """

    mesh: Mesh
    whole: Mesh
    vertex_of_part: IntArray
    face_of_part: IntArray

    @property
    def kept_area(self) -> float:
        """Area of the part as a fraction of the area of the whole."""
        return self.mesh.area / self.whole.area

    @property
    def missing_area(self) -> float:
        """Area left out, as a fraction of the area of the whole; sums to one with `kept_area`."""
        left_out = np.delete(self.whole.face_areas, self.face_of_part)
        return float(left_out.sum()) / self.whole.area

    @cached_property
    def vertex_of_whole(self) -> IntArray:
        """(n,) number in the part of each vertex of the whole; -1 where it was cut away."""
        return _inverse(self.vertex_of_part, len(self.whole.vertices))

    @cached_property
    def face_of_whole(self) -> IntArray:
        """(m,) number in the part of each face of the whole; -1 where it was cut away."""
        return _inverse(self.face_of_part, len(self.whole.faces))

    def to_whole(self, points: SurfacePoints) -> SurfacePoints:
        """Return points of the part as points of the whole."""
        points.check(self.mesh)
        return SurfacePoints(np.where(points.matched, self.face_of_part[points.faces], -1), points.barycentric)

    def to_part(self, points: SurfacePoints) -> SurfacePoints:
        """Return points of the whole as points of the part; unmatched where their face was cut away."""
        points.check(self.whole)
        return SurfacePoints(np.where(points.matched, self.face_of_whole[points.faces], -1), points.barycentric)

    def then(self, inner: Restriction) -> Restriction:
        """Return the restriction of the whole that `inner`, a restriction of this part, amounts to."""
        return Restriction(
            mesh=inner.mesh,
            whole=self.whole,
            vertex_of_part=self.vertex_of_part[inner.vertex_of_part],
            face_of_part=self.face_of_part[inner.face_of_part],
        )


def restrict(mesh: Mesh, keep_faces: ArrayLike, *, name: str | None = None) -> Restriction:
    """Keep some faces of a mesh and the vertices they use, in their old order.

    Parameters
    ----------
    mesh
        The whole.
    keep_faces
        (m,) bool, which faces to keep.
    name
        Name of the part; that of the whole where not given.

    Raises
    ------
    InputError
        If the mask has the wrong length or keeps nothing.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> part = restrict(square, [False, True])
    >>> part.vertex_of_part, part.kept_area
    (array([0, 2, 3]), 0.5)
    """
    keep = _mask(mesh, keep_faces)
    if not keep.any():
        raise InputError(f"no face of {mesh.name} is kept", remedy="keep at least one face")
    faces = np.flatnonzero(keep)
    vertices = np.unique(mesh.faces[faces])
    renumber = _inverse(vertices, len(mesh.vertices))
    part = Mesh(mesh.vertices[vertices], renumber[mesh.faces[faces]], name=name or mesh.name)
    return Restriction(mesh=part, whole=mesh, vertex_of_part=vertices, face_of_part=faces)


def face_pieces(mesh: Mesh, keep_faces: ArrayLike | None = None) -> IntArray:
    """Label the pieces into which the kept faces fall when only a shared edge connects two faces.

    Returns
    -------
    (m,) piece numbers, 0 for the piece of the largest area and so on down; -1 for faces not kept.
    """
    keep = np.ones(len(mesh.faces), dtype=bool) if keep_faces is None else _mask(mesh, keep_faces)
    used = np.flatnonzero(keep)
    edges = np.sort(mesh.faces[used][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge_of_side = np.unique(edges, axis=0, return_inverse=True)
    # Two faces are neighbours when they use one edge: faces and edges form a bipartite graph with the same components.
    face_of_side = np.repeat(np.arange(len(used)), 3)
    node = len(used) + edge_of_side.ravel()
    size = len(used) + len(edges)
    graph = coo_array((np.ones(len(node)), (face_of_side, node)), shape=(size, size))
    component = connected_components(graph, directed=False)[1][: len(used)]
    _, label = np.unique(component, return_inverse=True)
    area = np.bincount(label, weights=mesh.face_areas[used])
    rank = np.empty(len(area), dtype=np.int64)
    rank[np.argsort(-area, kind="stable")] = np.arange(len(area))
    pieces = np.full(len(mesh.faces), -1, dtype=np.int64)
    pieces[used] = rank[label]
    return pieces


def largest_piece(mesh: Mesh, keep_faces: ArrayLike | None = None) -> BoolArray:
    """Return the (m,) mask of the piece of the largest area, pieces being joined through shared edges only.

    Examples
    --------
    >>> bow = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-2, 0, 0], [0, -2, 0]], [[0, 1, 2], [0, 3, 4]])
    >>> largest_piece(bow)
    array([False,  True])
    """
    return np.asarray(face_pieces(mesh, keep_faces) == 0)


def _mask(mesh: Mesh, keep_faces: ArrayLike) -> BoolArray:
    keep = np.asarray(keep_faces)
    if keep.dtype != np.bool_ or keep.shape != (len(mesh.faces),):
        raise InputError(
            f"keep_faces has type {keep.dtype} and shape {keep.shape}, but {mesh.name} has {len(mesh.faces)} faces",
            remedy="give one True or False a face",
        )
    return np.asarray(keep, dtype=np.bool_)


def _inverse(numbers: IntArray, size: int) -> IntArray:
    inverse = np.full(size, -1, dtype=np.int64)
    inverse[numbers] = np.arange(len(numbers))
    return inverse
