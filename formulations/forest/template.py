"""The full surface of a forest: what its labels are, and how to find them again on a copy of that surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics.dijkstra import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.surface import Surface

SAME = 1e-4
"""Distance, in units of sqrt(area), within which every vertex must lie for a surface to be the trained one."""

_TURNS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Template:
    """Hold the repaired full surface that a forest was trained for, in its principal axes, and its labels.

    Parameters
    ----------
    name, digest
        Of the mesh it was trained with: the name, and a hash of its shape in its own unit and frame.
    vertices
        (n, 3) vertices in the principal axes, in units of sqrt(area).
    labels
        (L,) vertices that stand for the labels: all vertices, or samples far from one another.
    cell
        (n,) label of each vertex: the sample nearest to it along the surface.
    """

    name: str
    digest: str
    vertices: FloatArray
    labels: IntArray
    cell: IntArray

    @classmethod
    def of(cls, full: Surface, labels: int) -> Template:
        """Return the template of a surface with at most `labels` labels."""
        mesh = full.mesh
        count = len(mesh.vertices)
        if labels >= count:
            chosen = cell = np.arange(count)
        else:
            chosen = full.samples(labels)
            cell = nearest_samples(mesh, chosen)
        vertices = _in_principal_axes(mesh)
        return cls(name=mesh.name, digest=content_hash(vertices)[:16], vertices=vertices, labels=chosen, cell=cell)

    def label_vertices(self, full: Surface) -> IntArray:
        """Return the (L,) vertices of `full` that the labels are, however it is moved, scaled or numbered.

        Raises
        ------
        InputError
            If `full` is another surface than the one trained for.
        """
        return self.vertices_on(full)[self.labels]

    def fits(self, full: Surface) -> bool:
        """Return whether `full` is the surface trained for."""
        try:
            self.vertices_on(full)
        except InputError:
            return False
        return True

    def vertices_on(self, full: Surface) -> IntArray:
        """Return the (n,) vertices of `full` that the template's are; raise `InputError` if it is another surface."""
        mesh = full.mesh
        wanted = "train a forest for this surface, or give the one it was trained for"
        trained = f"the forest was trained for the surface {self.name!r} ({self.digest})"
        if len(mesh.vertices) != len(self.vertices):
            counts = f"{len(self.vertices)} vertices, but {mesh.name!r} has {len(mesh.vertices)}"
            raise InputError(f"{trained} with {counts}", remedy=wanted)
        tree, best = KDTree(_in_principal_axes(mesh)), np.inf
        for turn in _TURNS:  # where a third moment nearly vanishes, its sign is no guide
            nearest = tree.query(self.vertices * turn)
            apart, vertex = float(np.max(nearest[0])), np.asarray(nearest[1], dtype=np.int64)
            best = min(best, apart)
            if apart <= SAME and len(np.unique(vertex)) == len(vertex):
                return vertex
        raise InputError(
            f"{trained}, but {mesh.name!r} differs from it by up to {best:.3g} of sqrt(area), {SAME:g} at most",
            remedy=wanted,
        )


def nearest_samples(mesh: Mesh, samples: IntArray) -> IntArray:
    """Return, for each vertex, the index of the sample nearest to it along the surface.

    Examples
    --------
    >>> strip = Mesh([[0, 0, 0], [1, 0, 0], [4, 0, 0], [0, 1, 0]], [[0, 1, 3], [1, 2, 3]])
    >>> nearest_samples(strip, np.array([2, 3]))
    array([1, 1, 0, 1])
    """
    _, _, source = dijkstra(
        virtual_edge_graph(mesh), directed=True, indices=samples, min_only=True, return_predecessors=True
    )
    place = np.full(len(mesh.vertices), -1, dtype=np.int64)
    place[samples] = np.arange(len(samples))
    return np.asarray(place[source])


def _in_principal_axes(mesh: Mesh) -> FloatArray:
    """Return the vertices about the centroid, along the principal axes of the area, a right-handed frame."""
    weights = mesh.vertex_areas / mesh.area
    offsets = (mesh.vertices - weights @ mesh.vertices) / np.sqrt(mesh.area)
    axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)[1]
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return np.asarray(offsets @ axes)
