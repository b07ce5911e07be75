"""Let holes grow in a complete shape."""

from __future__ import annotations

import heapq

import numpy as np
from scipy.sparse.csgraph import dijkstra

from nonrigid.geometry.arrays import BoolArray, FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.frame import canonical_frame
from nonrigid.geometry.geodesics import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.partial import largest_piece
from nonrigid.geometry.sampling import farthest_points

_WAVES = 64


def grow_holes(mesh: Mesh, *, holes: int, keep: float, seed: int, jitter: float = 0.2) -> BoolArray:
    """Grow holes from points far from each other until a given fraction of the area is left.

    Seeds are `holes` Euclidean farthest points. Triangles are removed in the order of their distance from the nearest
    seed, measured along edges whose lengths are multiplied by a random field, which makes the borders irregular. The
    field lives in the shape's own frame, so that neither its place nor the order of its vertices matters.

    Holes may meet, and what they cut off from the largest piece is lost with them; vertices with two fans of triangles
    lose both. Where the next triangles would cut off too much, the last bit of area goes triangle by triangle, passing
    over those whose removal would leave a corner with two fans: this cuts nothing off.

    Parameters
    ----------
    mesh
        A pose with m faces, one piece without pinch vertices.
    holes
        Number of seeds: 5, 25 and 50 in the track.
    keep
        Fraction of the area to be left: 0.4, 0.7 and 0.9 in the track.
    jitter
        Spread of the random field's logarithm.

    Returns
    -------
    (m,) whether each face is kept; the area kept is `keep` up to one triangle.

    Raises
    ------
    InputError
        If `keep` is not between 0 and 1, or growing stops before it is reached.
    """
    if not 0.0 < keep < 1.0:
        raise InputError(f"keep is {keep}, not between 0 and 1", remedy="give the fraction of the area to be left")
    arrival = _arrival(mesh, farthest_points(mesh, holes), np.random.default_rng(seed), jitter)
    kept = _largest_above(mesh, arrival, keep * mesh.area)
    fans = _Fans(mesh, kept)
    budget = float(mesh.face_areas[kept].sum()) - keep * mesh.area
    # Where nothing is open yet, each seed opens at the incident triangle that is reached first.
    start = arrival <= _first_arrivals(mesh, arrival) if kept.all() else _beside(mesh, kept)
    queue = [(float(arrival[face]), int(face)) for face in np.flatnonzero(start & kept)]
    heapq.heapify(queue)
    while budget > 0 and queue:
        _, face = heapq.heappop(queue)
        if fans.kept[face] and fans.may_lose(face):
            fans.kept[face] = False
            budget -= float(mesh.face_areas[face])
            for neighbour in fans.neighbours(face):
                heapq.heappush(queue, (float(arrival[neighbour]), neighbour))
    if budget > 0 or not fans.kept.any():
        raise InputError(
            f"{holes} holes in {mesh.name} cannot grow until {keep:.0%} of the area is left", remedy="keep more of it"
        )
    return fans.kept


def _arrival(mesh: Mesh, seeds: IntArray, generator: np.random.Generator, jitter: float) -> FloatArray:
    """(m,) jittered distance of each face from the nearest seed."""
    graph = virtual_edge_graph(mesh).tocoo()
    centroid, axes = canonical_frame(mesh)
    place = (mesh.vertices - centroid) @ axes / np.sqrt(mesh.area)
    # Waves between 0.05 and 0.2 of sqrt(area) long, whatever the triangles: their sum is about normal.
    direction = generator.normal(size=(3, _WAVES))
    direction /= np.linalg.norm(direction, axis=0)
    waves = direction * (2.0 * np.pi / generator.uniform(0.05, 0.2, size=_WAVES))
    phases = generator.uniform(0.0, 2.0 * np.pi, size=_WAVES)
    noise = np.sqrt(2.0 / _WAVES) * np.cos(place @ waves + phases).sum(axis=1)
    graph.data = graph.data * np.exp(0.5 * jitter * (noise[graph.row] + noise[graph.col]))
    reach = dijkstra(graph.tocsr(), directed=True, indices=seeds, min_only=True)
    return np.asarray(reach[mesh.faces].mean(axis=1), dtype=np.float64)


def _largest_above(mesh: Mesh, arrival: FloatArray, least: float) -> BoolArray:
    """(m,) the piece that is left when holes have grown as far as leaves an area of `least`, by bisection."""
    order = np.sort(arrival)
    low, high = 0, len(order) - 1
    best = np.ones(len(arrival), dtype=bool)
    # The last bit of area is left to single triangles.
    while high - low > len(order) // 500 + 1:
        middle = (low + high + 1) // 2
        kept = _without_pinches(mesh, arrival >= order[middle])
        if mesh.face_areas[kept].sum() >= least:
            low, best = middle, kept
        else:
            high = middle - 1
    return best


def _without_pinches(mesh: Mesh, kept: BoolArray) -> BoolArray:
    """Return the largest piece, smaller by the triangles about vertices where two fans would meet."""
    while kept.any():
        kept = largest_piece(mesh, kept)
        faces = mesh.faces[kept]
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, counts = np.unique(edges, axis=0, return_counts=True)
        n = len(mesh.vertices)
        # k triangles about a vertex that share k - f edges there form f open fans.
        fans = np.bincount(faces.ravel(), minlength=n) - np.bincount(unique[counts == 2].ravel(), minlength=n)
        if fans.max() < 2:
            break
        kept = kept & (fans[mesh.faces] < 2).all(axis=1)
    return kept


def _beside(mesh: Mesh, kept: BoolArray) -> BoolArray:
    """(m,) whether a face shares a vertex with one that is gone."""
    gone = np.zeros(len(mesh.vertices), dtype=bool)
    gone[mesh.faces[~kept]] = True
    return np.asarray(gone[mesh.faces].any(axis=1))


def _first_arrivals(mesh: Mesh, arrival: FloatArray) -> FloatArray:
    """(m,) least arrival among the faces that share a vertex with each face; its minima are where holes open."""
    least = np.full(len(mesh.vertices), np.inf)
    np.minimum.at(least, mesh.faces.ravel(), np.repeat(arrival, 3))
    return np.asarray(least[mesh.faces].min(axis=1), dtype=np.float64)


class _Fans:
    """Keep track of the triangles about each vertex while triangles are removed."""

    def __init__(self, mesh: Mesh, kept: BoolArray) -> None:
        self.kept: BoolArray = kept.copy()
        self._faces: list[list[int]] = mesh.faces.tolist()
        self._around: list[list[int]] = [[] for _ in range(len(mesh.vertices))]
        for face, corners in enumerate(self._faces):
            for corner in corners:
                self._around[corner].append(face)

    def neighbours(self, face: int) -> list[int]:
        """Return the kept faces that share an edge with `face`."""
        mine = set(self._faces[face])
        near = {other for corner in mine for other in self._around[corner] if self.kept[other] and other != face}
        return sorted(other for other in near if len(mine.intersection(self._faces[other])) == 2)

    def may_lose(self, face: int) -> bool:
        """Tell whether each corner of `face` keeps a single fan, or nothing, without it."""
        return all(self._is_one_fan(corner, face) for corner in self._faces[face])

    def _is_one_fan(self, vertex: int, without: int) -> bool:
        left = [face for face in self._around[vertex] if self.kept[face] and face != without]
        if not left:
            return True
        reached, todo = {left[0]}, [left[0]]
        while todo:
            corners = set(self._faces[todo.pop()])
            for other in left:
                if other not in reached and len(corners.intersection(self._faces[other])) >= 2:
                    reached.add(other)
                    todo.append(other)
        return len(reached) == len(left)
