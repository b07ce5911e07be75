"""Measure how far matched points are from the truth, along the full surface."""

from __future__ import annotations

import numpy as np

from nonrigid.benchmark.vertex_pairs import check_metric, vertex_pair_distances
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.clean import CleanMesh, clean
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints
from nonrigid.geometry.remesh import closest_points


def errors_of_both(
    full: Mesh,
    matched: SurfacePoints,
    truth: SurfacePoints,
    mirrored: SurfacePoints | None,
    *,
    geodesics: str = "dijkstra",
) -> tuple[FloatArray, FloatArray | None]:
    """Return the errors against the truth and against its mirror image, as far as it matters which is the smaller.

    The side on which points lie nearer in space is measured first. Of the other, errors beyond it at the same point are
    inf, if what is known of them already tells that their mean is the greater one: long ways take most of the time.

    Parameters
    ----------
    full, matched, truth, geodesics
        See `geodesic_errors`, also for what is raised.
    mirrored
        (p,) points of `full`; None if there is no mirror image.

    Returns
    -------
    (p,) errors without unit, and as many, or None. Their means tell the better side, their minima the lesser errors.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> corners = SurfacePoints.at_vertices(square, [0, 1])
    >>> errors_of_both(square, corners, corners, SurfacePoints.at_vertices(square, [1, 0]))
    (array([0., 0.]), array([1., 1.]))
    """
    if mirrored is None:
        return geodesic_errors(full, matched, truth, geodesics=geodesics), None
    chords = [_chords(full, matched, side) for side in (truth, mirrored)]
    first = int(np.nansum(chords[1]) < np.nansum(chords[0]))
    sides = (truth, mirrored)
    better = geodesic_errors(full, matched, sides[first], geodesics=geodesics)
    other = geodesic_errors(full, matched, sides[1 - first], geodesics=geodesics, up_to=better)
    at_least = np.where(np.isinf(other), np.maximum(better, chords[1 - first]), other)
    if np.isinf(other).any() and not at_least.mean() >= better.mean():
        other = geodesic_errors(full, matched, sides[1 - first], geodesics=geodesics)
    return (better, other) if first == 0 else (other, better)


def geodesic_errors(
    full: Mesh,
    matched: SurfacePoints,
    truth: SurfacePoints,
    *,
    geodesics: str = "dijkstra",
    up_to: FloatArray | None = None,
) -> FloatArray:
    """Return the geodesic distance between matched and true points, divided by the square root of the full area.

    error = d(y, y*) / sqrt(|M|). The distance between points inside faces is the lesser of two lengths:

    1. |y - y*| + sum_ij b_i c_j (d(i, j) - |i - j|): the chord, and by how much the distances between the corners of
       the two faces exceed their chords, interpolated by both points' weights; but the straight way, if the faces are
       the same or share an edge (over which they are unfolded);
    2. min_ij |y - i| + d(i, j) + |j - y*|, the way through a corner of each face;

    and never less than the chord. Distances themselves have a kink at the source and interpolate badly near by; their
    excess over the chord is smooth, and zero where the surface is flat. At vertices all this is d(i, j) itself, and
    equal points have distance 0.

    Parameters
    ----------
    full
        The full shape, in any unit of length.
    matched, truth
        (p,) points of `full`; -1 says unmatched.
    geodesics
        How d is measured between vertices: "dijkstra" (edges and one virtual edge across each interior edge, on the
        mesh as read), "heat", "exact" or "edgeflip" (these on its clean view; a point on a face that the clean view
        drops moves to the closest point of it).
    up_to
        (p,) errors of which greater ones may be returned as inf, which saves time with "dijkstra"; all are exact unless
        given.

    Returns
    -------
    (p,) errors without unit (times 100 when printed); NaN where either point is unmatched, inf where no way joins them.

    Raises
    ------
    InputError
        If the two have not the same length, or name a face that `full` has not.
    UnknownNameError
        If there are no such geodesics.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> here, there = SurfacePoints([0], [[0.5, 0.5, 0]]), SurfacePoints([1], [[0, 0.5, 0.5]])
    >>> geodesic_errors(square, here, there)
    array([1.])

    Source: Kim, Lipman, Funkhouser 2011, "Blended Intrinsic Maps", section 7, as used by the SHREC'16 track.
    """
    if len(matched) != len(truth):
        raise InputError(
            f"{len(matched)} matched points, but {len(truth)} true ones", remedy="give one row a vertex of the part"
        )
    check_metric(geodesics)
    matched.check(full)
    truth.check(full)
    errors = np.full(len(matched), np.nan)
    both = np.flatnonzero(matched.matched & truth.matched)
    if not len(both):
        return errors
    mesh, here, there = full, matched[both], truth[both]
    if geodesics != "dijkstra":
        view = clean(full)
        mesh, here, there = view.mesh, _onto(view, here), _onto(view, there)
    unit = np.sqrt(full.area)
    most = None if up_to is None else up_to[both] * unit
    errors[both] = point_distances(mesh, here, there, geodesics=geodesics, up_to=most) / unit
    return errors


def point_distances(
    mesh: Mesh,
    a: SurfacePoints,
    b: SurfacePoints,
    *,
    geodesics: str = "dijkstra",
    up_to: FloatArray | None = None,
) -> FloatArray:
    """Return the (p,) distances between matched points along `mesh`, in its unit; see `geodesic_errors`."""
    corner_a, corner_b = mesh.faces[a.faces], mesh.faces[b.faces]
    pair = (a.barycentric[:, :, None] > 0) & (b.barycentric[:, None, :] > 0)
    point, i, j = np.nonzero(pair)
    place_a, place_b = a.positions(mesh), b.positions(mesh)
    to_a = np.linalg.norm(mesh.vertices[corner_a] - place_a[:, None], axis=2)
    to_b = np.linalg.norm(mesh.vertices[corner_b] - place_b[:, None], axis=2)
    # What is interpolated differs from the way through any two corners by less than this: no pair needed is left out.
    slack = 4.0 * (to_a.max(axis=1, initial=0.0) + to_b.max(axis=1, initial=0.0))
    most = None if up_to is None else (up_to + slack)[point]
    between = np.full(pair.shape, np.inf)
    between[point, i, j] = vertex_pair_distances(
        mesh, corner_a[point, i], corner_b[point, j], geodesics=geodesics, up_to=most
    )
    excess = np.zeros(pair.shape)
    chord_of_corners = np.linalg.norm(mesh.vertices[corner_a[point, i]] - mesh.vertices[corner_b[point, j]], axis=1)
    excess[point, i, j] = between[point, i, j] - chord_of_corners
    chord = np.linalg.norm(place_a - place_b, axis=1)
    weight = np.where(pair, a.barycentric[:, :, None] * b.barycentric[:, None, :], 1.0)
    interpolated = chord + (weight * excess).sum(axis=(1, 2))
    through = (to_a[:, :, None] + between + to_b[:, None, :]).min(axis=(1, 2))
    straight = _straight(mesh, a.faces, b.faces, place_a, place_b)
    direct = np.where(np.isfinite(straight), straight, interpolated)
    # No way is shorter than the chord; the heat method alone can say so.
    return np.asarray(np.maximum(np.minimum(direct, through), chord), dtype=np.float64)


def _chords(full: Mesh, a: SurfacePoints, b: SurfacePoints) -> FloatArray:
    """Return the (p,) straight distances in units of sqrt(area), NaN where either point is unmatched."""
    matched = a.matched & b.matched
    chords = np.full(len(a), np.nan)
    apart = a[matched].positions(full) - b[matched].positions(full)
    chords[matched] = np.linalg.norm(apart, axis=1) / np.sqrt(full.area)
    return chords


def _onto(view: CleanMesh, points: SurfacePoints) -> SurfacePoints:
    moved = view.from_raw(points)
    lost = ~moved.matched
    if not lost.any():
        return moved
    near = closest_points(view.mesh, points[lost].positions(view.raw))
    faces, weights = moved.faces.copy(), moved.barycentric.copy()
    faces[lost], weights[lost] = near.faces, near.barycentric
    return SurfacePoints(faces, weights)


def _straight(mesh: Mesh, f: IntArray, g: IntArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """Return lengths of ways inside one face or across one shared edge; inf where there is no such way."""
    length = np.where(f == g, np.linalg.norm(p - q, axis=1), np.inf)
    shared = mesh.faces[f][:, :, None] == mesh.faces[g][:, None, :]
    across = np.flatnonzero((f != g) & (shared.sum(axis=(1, 2)) >= 2))
    if len(across):
        common = shared[across].any(axis=2)
        first = common.argmax(axis=1)
        last = 2 - common[:, ::-1].argmax(axis=1)
        start = mesh.vertices[mesh.faces[f[across], first]]
        end = mesh.vertices[mesh.faces[f[across], last]]
        length[across] = _over_edge(p[across], q[across], start, end)
    return length


def _over_edge(p: FloatArray, q: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the lengths of the shortest ways from p to q over the edges start-end, the two sides unfolded."""
    edge = end - start
    base = np.linalg.norm(edge, axis=1)
    axis = np.divide(edge, base[:, None], out=np.zeros_like(edge), where=base[:, None] > 0)
    along_p, along_q = np.einsum("px,px->p", p - start, axis), np.einsum("px,px->p", q - start, axis)
    height_p = np.linalg.norm(p - start - along_p[:, None] * axis, axis=1)
    height_q = np.linalg.norm(q - start - along_q[:, None] * axis, axis=1)
    height = height_p + height_q
    share = np.divide(height_p, height, out=np.zeros_like(height), where=height > 0)
    # The length is convex in the crossing point, so that the best one on the edge is the free one, clamped.
    crossing = np.clip(along_p + (along_q - along_p) * share, 0.0, base)
    return np.asarray(np.hypot(along_p - crossing, height_p) + np.hypot(along_q - crossing, height_q), dtype=np.float64)
