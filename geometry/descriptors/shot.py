"""SHOT: histograms of normals in a local frame, all points at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array
from scipy.spatial import cKDTree

from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.descriptors.local_frames import Neighbours, ZSign, coordinates, local_frames
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh

AZIMUTHS, VOLUMES = 8, 32  # 8 azimuth sectors x 2 elevations x 2 shells
FEWEST = 5  # neighbours that a frame needs


def shot(
    mesh: Mesh,
    radius: float,
    *,
    at: ArrayLike | None = None,
    cosine_bins: int = 11,
    interpolation: Literal["quadrilinear", "additive"] = "quadrilinear",
    z_sign: ZSign = "normal",
    area_weighted: bool = True,
    pairs_per_chunk: int = 1 << 16,
) -> FloatArray:
    """Describe each vertex by the normals around it, seen in a right-handed frame that moves with the surface.

    The ball around a vertex is cut into 32 volumes: 8 azimuth sectors, 2 elevations, 2 shells. In each, a histogram
    counts the cosine between the normals of the neighbours and the frame's z axis. Each neighbour spreads linearly over
    the two nearest bins of cosine, azimuth, elevation and distance. Rows change with the mesh's density and the
    orientation of its faces, not with rigid motion or vertex order; a mirrored surface gives other rows.

    Parameters
    ----------
    radius
        Radius of the ball, in the unit of the vertices.
    at
        (s,) vertices to describe; all of them unless given.
    cosine_bins
        Number of values of the cosine, from -1 to 1, on which the histograms stand; at least 2.
    interpolation
        "quadrilinear": the four weights of a neighbour are multiplied, as published. "additive": its own bin gets the
        sum of its four weights and the next bin along each direction one weight, as widely used programs do. The two
        are not interchangeable: unit rows differ by 0.3 to 0.4.
    z_sign
        "normal": z points to the side of the mesh normal; "majority": to the side of more neighbours.
    area_weighted
        Whether a neighbour counts by its vertex area rather than as one; this makes rows depend less on the density.
    pairs_per_chunk
        How many pairs of neighbours are held at a time, roughly; it bounds the memory and changes rounding only.

    Returns
    -------
    descriptors
        (s, 32 cosine_bins) rows of unit length, ordered azimuth, elevation, shell, cosine; a row is zero where fewer
        than five other vertices lie in the ball.

    Raises
    ------
    InputError
        If `radius` is not positive, `cosine_bins` is below 2 or `at` names no vertex.
    UnknownNameError
        If `interpolation` or `z_sign` is not one of the names above.

    Examples
    --------
    >>> x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 2, 6))
    >>> quads = np.array([[k, k + 1, k + 7, k + 6] for k in range(29) if k % 6 != 5])
    >>> bowl = Mesh(np.c_[x.ravel(), y.ravel(), (x * x + y).ravel()], np.r_[quads[:, :3], quads[:, [0, 2, 3]]])
    >>> rows = shot(bowl, 0.8, at=[14, 15])
    >>> rows.shape, np.linalg.norm(rows, axis=1).round(6)
    ((2, 352), array([1., 1.]))

    Source: Tombari, Salti, Di Stefano, "Unique signatures of histograms for local surface description", ECCV 2010;
    Salti, Tombari, Di Stefano, "SHOT", CVIU 125, 2014, section 4.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"SHOT radius is {radius}", remedy="give a positive length in the unit of the vertices")
    if cosine_bins < 2:
        raise InputError(f"{cosine_bins} cosine bins", remedy="ask for at least 2")
    if interpolation not in ("quadrilinear", "additive"):
        raise UnknownNameError("interpolation", interpolation, ("quadrilinear", "additive"))
    if z_sign not in ("normal", "majority"):
        raise UnknownNameError("z_sign", z_sign, ("normal", "majority"))
    vertices = np.arange(len(mesh.vertices)) if at is None else checked_vertices(at, len(mesh.vertices), "described")
    accumulate = _quadrilinear if interpolation == "quadrilinear" else _additive
    normals = mesh.vertex_normals
    areas = mesh.vertex_areas if area_weighted else np.ones(len(mesh.vertices))
    result = np.zeros((len(vertices), VOLUMES * cosine_bins))
    for rows, neighbours in _chunks(mesh, vertices, radius, pairs_per_chunk):
        axes = local_frames(neighbours, radius, normals[vertices[rows]], z_sign)
        cosine = np.einsum("px,px->p", axes[:, 2].take(neighbours.centre, axis=0), normals[neighbours.vertex])
        places = _places(neighbours, axes, cosine, radius, cosine_bins)
        histograms = accumulate(places, areas[neighbours.vertex], neighbours, cosine_bins)
        enough = np.bincount(neighbours.centre, minlength=neighbours.count) >= FEWEST
        result[rows] = _unit(histograms) * enough[:, None]
    return result


def _chunks(mesh: Mesh, vertices: IntArray, radius: float, pairs: int) -> Iterator[tuple[IntArray, Neighbours]]:
    """Yield rows of `vertices` that lie near each other, with all their neighbours, about `pairs` pairs at a time."""
    points = mesh.vertices - mesh.vertices.mean(axis=0)  # far from the origin, differences lose digits
    tree = cKDTree(points)
    order = np.asarray(cKDTree(points[vertices]).indices, dtype=np.int64) if len(vertices) else vertices
    size, first = 32, 0
    columns = np.ascontiguousarray(points.T)
    while first < len(order):
        rows = order[first : first + size]
        found = cKDTree(points[vertices[rows]]).sparse_distance_matrix(tree, radius, output_type="ndarray")
        found = found[found["v"] > 1e-12 * radius]
        centre, vertex = np.ascontiguousarray(found["i"]), np.ascontiguousarray(found["j"])
        offsets = columns[:, vertex] - columns[:, vertices[rows]][:, centre]
        distances = np.ascontiguousarray(found["v"])
        yield rows, Neighbours(centre=centre, vertex=vertex, offsets=offsets, distances=distances, count=len(rows))
        first += size
        size = int(np.clip(size * pairs // max(len(found), 1), 1, 2 * size))


def _places(
    neighbours: Neighbours, axes: FloatArray, cosine: FloatArray, radius: float, cosine_bins: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return where each neighbour lies among the bin centres 0, 1, ... of cosine, azimuth, elevation and shell."""
    x, y, z = (coordinates(neighbours, axes[:, axis]) for axis in range(3))
    inclination = np.arccos(np.clip(z / neighbours.distances, -1.0, 1.0))
    return (
        np.clip((1.0 + cosine) * (0.5 * (cosine_bins - 1)), 0.0, cosine_bins - 1.0),
        (np.arctan2(y, x) + np.pi) * (AZIMUTHS / (2.0 * np.pi)) - 0.5,
        inclination * (2.0 / np.pi) - 0.5,
        neighbours.distances * (2.0 / radius) - 0.5,
    )


def _quadrilinear(
    places: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    areas: FloatArray,
    neighbours: Neighbours,
    cosine_bins: int,
) -> FloatArray:
    """Return the (count, 32 cosine_bins) histograms of products of the four weights."""
    cosine, azimuth, elevation, shell = places
    pairs = len(cosine)
    low = np.minimum(np.floor(cosine), cosine_bins - 2)
    sector = np.floor(azimuth)
    cosine_next, azimuth_next = cosine - low, azimuth - sector
    here = neighbours.centre * AZIMUTHS
    sectors = sector.astype(np.int64)
    own = (here + sectors % AZIMUTHS) * cosine_bins + low.astype(np.int64)
    beside = (here + (sectors + 1) % AZIMUTHS) * cosine_bins + low.astype(np.int64)
    # A sparse matrix scatters each pair to 2 x 2 bins of azimuth and cosine; its columns are the pairs. Multiplied by
    # the (pairs, 4) weights of elevation and shell it sums all sixteen contributions in one pass.
    bins = np.empty((pairs, 4), dtype=np.int64)
    weights = np.empty((pairs, 4))
    bins[:, 0], bins[:, 1], bins[:, 2], bins[:, 3] = own, own + 1, beside, beside + 1
    at_sector, at_next = areas * (1.0 - azimuth_next), areas * azimuth_next
    weights[:, 1], weights[:, 3] = at_sector * cosine_next, at_next * cosine_next
    weights[:, 0], weights[:, 2] = at_sector - weights[:, 1], at_next - weights[:, 3]
    volumes = np.empty((pairs, 4))
    for column, (upper, outer) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        volumes[:, column] = _hat(elevation - upper) * _hat(shell - outer)
    starts = np.arange(0, 4 * pairs + 1, 4)
    shape = (neighbours.count * AZIMUTHS * cosine_bins, pairs)
    sums = np.asarray(csc_array((weights.ravel(), bins.ravel(), starts), shape=shape) @ volumes)
    ordered = sums.reshape(neighbours.count, AZIMUTHS, cosine_bins, 4).transpose(0, 1, 3, 2)
    return np.ascontiguousarray(ordered).reshape(neighbours.count, -1)


def _additive(
    places: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    areas: FloatArray,
    neighbours: Neighbours,
    cosine_bins: int,
) -> FloatArray:
    """Return the (count, 32 cosine_bins) histograms of the summed weights; each next bin gets its own weight."""
    own = [np.floor(place + 0.5).astype(np.int64) for place in places]
    for direction in (2, 3):
        np.clip(own[direction], 0, 1, out=own[direction])
    rest = [place - bin_ for place, bin_ in zip(places, own, strict=True)]
    size = neighbours.count * VOLUMES * cosine_bins

    def bins(cosine: IntArray, azimuth: IntArray, elevation: IntArray, shell: IntArray) -> IntArray:
        volume = ((neighbours.centre * AZIMUTHS + azimuth % AZIMUTHS) * 2 + elevation) * 2 + shell
        return np.asarray(volume * cosine_bins + cosine)

    # Azimuth goes round; past the ends of the other three there is no bin, and the weight there is lost.
    last = (cosine_bins - 1, np.inf, 1, 1)
    first = (0, -np.inf, 0, 0)
    shares = 4.0 - np.abs(rest[0]) - np.abs(rest[1]) - np.abs(rest[2]) - np.abs(rest[3])
    result = np.bincount(bins(*own), weights=areas * shares, minlength=size)
    for direction in range(4):
        beside = list(own)
        step = np.where(rest[direction] < 0, -1, 1)
        inside = (own[direction] + step >= first[direction]) & (own[direction] + step <= last[direction])
        beside[direction] = own[direction] + step * inside
        result = result + np.bincount(bins(*beside), weights=areas * np.abs(rest[direction]) * inside, minlength=size)
    return np.asarray(result, dtype=np.float64).reshape(neighbours.count, -1)


def _hat(distance: FloatArray) -> FloatArray:
    """Return the linear weight of a bin whose centre is `distance` bins away."""
    return np.asarray(np.maximum(1.0 - np.abs(distance), 0.0))


def _unit(rows: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(np.divide(rows, lengths, out=np.zeros_like(rows), where=lengths > 0))
