"""Score a correspondence as the SHREC'16 partial-matching track does."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.transform import Rotation

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.metric import errors_of_both
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.geodesics import virtual_edge_graph
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

THRESHOLDS: FloatArray = np.linspace(0.0, 0.25, 51)
"""(51,) thresholds of the error curve, 0 to 0.25, in units of sqrt(area of the full shape)."""

ROUNDING = 1e-6
"""Fraction of sqrt(full area) up to which an error may exceed a threshold and count as within it."""

COVERAGE_RADIUS = 0.1
"""A match covers the part of the surface within this distance, in units of sqrt(area of the full shape)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Score:
    """Hold what one correspondence of one pair is worth.

    Errors are geodesic distances on the full shape over the square root of its area: fractions, to be multiplied by 100
    when printed. Unmatched vertices are left out of every error and counted in `unmatched_count`, and so are matched
    ones of which the truth is not known, in `unknown_count`.

    Parameters
    ----------
    name
        The pair.
    metric
        How distances were measured, see `geodesic_errors`.
    rows
        (p,) the vertices of the part that have a match and a known truth.
    direct, mirrored
        (p,) errors of these against the truth and against its mirror image (None where there is none). On the side with
        the greater mean, those that exceed the other's at the same point may be inf; see `errors_of_both`.
    side
        Which of the two has the smaller mean over the whole shape: "direct" or "mirrored".
    mean_error
        That mean, the primary score: a map that mixes the sides is penalised. NaN without matches.
    mean_error_per_point
        Mean of the smaller error at each point, the lenient secondary score. NaN without matches.
    match_count, unmatched_count
        Vertices with and without a match.
    unknown_count
        Vertices with a match that cannot be judged, since the ground truth does not say where they lie.
    coverage
        Fraction of the part's area within 0.1 sqrt(full area) of a matched vertex, along the part.
    curve
        (51,) fraction of the matches with an error of at most `THRESHOLDS`, on the chosen side.
    kept_area
        Area of the part over area of the full shape.
    """

    name: str
    metric: str
    rows: IntArray
    direct: FloatArray
    mirrored: FloatArray | None
    side: str
    mean_error: float
    mean_error_per_point: float
    match_count: int
    unmatched_count: int
    coverage: float
    curve: FloatArray
    kept_area: float
    unknown_count: int = 0

    @property
    def errors(self) -> FloatArray:
        """(p,) errors on the chosen side."""
        return self.direct if self.mirrored is None or self.side == "direct" else self.mirrored

    def errors_of(self, vertices: IntArray) -> FloatArray:
        """Return (m,) errors of vertices of the part on the chosen side; NaN where one has no match or no truth."""
        found = np.full(max(int(np.max(part, initial=-1)) for part in (vertices, self.rows)) + 1, np.nan)
        found[self.rows] = self.errors
        return np.asarray(found[vertices])


def score(pair: PairData, points: SurfacePoints, *, geodesics: str = "dijkstra") -> Score:
    """Compare a correspondence with the ground truth of its pair.

    Parameters
    ----------
    pair
        Raw meshes and truth.
    points
        For each vertex of the part a point of the full shape, or -1.
    geodesics
        The metric, see `geodesic_errors`.

    Raises
    ------
    InputError
        If the pair has no ground truth, or `points` has not one row a vertex of the part, or no matched vertex has
        ground truth, or one has it on one side only.

    Source: Cosmo et al. 2016, "SHREC'16: Partial Matching of Deformable Shapes", section 4. Its text leaves open
    whether the better of the two sides is taken for a shape or for a point; both means are given.
    """
    if pair.truth is None:
        raise InputError(f"pair {pair.name} has no ground truth", remedy="write a submission file instead")
    if len(points) != len(pair.part.vertices):
        raise InputError(
            f"{len(points)} rows, but the part of {pair.name} has {len(pair.part.vertices)} vertices",
            remedy="give one row a vertex of the part, -1 where unmatched",
        )
    points.check(pair.full)
    rows = np.flatnonzero(points.matched & pair.truth.matched)
    if points.matched.any() and not len(rows):
        raise InputError(f"no matched vertex of {pair.name} has ground truth", remedy="match vertices that have it")
    image = None if pair.mirrored is None else pair.mirrored[rows]
    direct, mirrored = errors_of_both(pair.full, points[rows], pair.truth[rows], image, geodesics=geodesics)
    if np.isnan(direct).any() or (mirrored is not None and np.isnan(mirrored).any()):
        raise InputError(
            f"a matched vertex of {pair.name} has ground truth on one side only", remedy="complete the ground truth"
        )
    swapped = mirrored is not None and len(rows) > 0 and mirrored.mean() < direct.mean()
    chosen = mirrored if mirrored is not None and swapped else direct
    lenient = direct if mirrored is None else np.minimum(direct, mirrored)
    return Score(
        name=pair.name,
        metric=geodesics,
        rows=rows,
        direct=direct,
        mirrored=mirrored,
        side="mirrored" if swapped else "direct",
        mean_error=_mean(chosen),
        mean_error_per_point=_mean(lenient),
        match_count=int(points.matched.sum()),
        unmatched_count=int((~points.matched).sum()),
        unknown_count=int((points.matched & ~pair.truth.matched).sum()),
        coverage=covered(pair, points),
        curve=curve(chosen),
        kept_area=pair.kept_area,
    )


def curve(errors: FloatArray, thresholds: FloatArray = THRESHOLDS) -> FloatArray:
    """Return the fraction of the errors that are at most each threshold; NaN where there are no errors.

    Examples
    --------
    >>> curve(np.array([0.0, 0.1, 0.3]), np.array([0.0, 0.2])).round(3)
    array([0.333, 0.667])
    """
    if not len(errors):
        return np.full(len(thresholds), np.nan)
    # An error that equals a threshold up to the seven digits of truth files is within it.
    return np.searchsorted(np.sort(errors), thresholds + ROUNDING, side="right") / len(errors)


def covered(pair: PairData, points: SurfacePoints) -> float:
    """Return the fraction of the part's area within `COVERAGE_RADIUS` of a match; `points` has one row a vertex."""
    return coverage(pair.part, np.flatnonzero(points.matched), COVERAGE_RADIUS * float(np.sqrt(pair.full.area)))


def coverage(part: Mesh, vertices: IntArray, radius: float) -> float:
    """Return the fraction of the part's area at the vertices within `radius` of the given ones, along the part.

    The radius is in the unit of the vertices; an area is that of a third of the triangles about a vertex.
    """
    if not len(vertices):
        return 0.0
    near = dijkstra(virtual_edge_graph(part), directed=True, indices=vertices, min_only=True, limit=radius)
    return float(part.vertex_areas[np.isfinite(near)].sum() / part.area)


def random_rigid_motion(mesh: Mesh, seed: int = 0) -> tuple[Mesh, FloatArray, FloatArray]:
    """Turn and shift a mesh at random, the same way each time for its name and seed.

    Partial shapes lie in the frame of their source pose, so that some are solved by the nearest point in space; after
    this motion none is. Rotations are uniform over all rotations; each coordinate of the shift is uniform within the
    square root of the area.

    Returns
    -------
    The moved mesh, the (3, 3) rotation R and the (3,) translation t of v -> R v + t.

    Examples
    --------
    >>> mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="corner")
    >>> moved, rotation, translation = random_rigid_motion(mesh, seed=3)
    >>> bool(np.allclose((moved.vertices - translation) @ rotation, mesh.vertices))
    True
    """
    # Python's own hash of a text differs from process to process.
    digest = hashlib.sha256(f"{mesh.name} {seed}".encode()).digest()
    generator = np.random.default_rng(int.from_bytes(digest[:16], "little"))
    # A normal vector in four dimensions, normalised, is a uniform unit quaternion, and that a uniform rotation.
    rotation = np.asarray(Rotation.from_quat(generator.normal(size=4)).as_matrix())
    translation = generator.uniform(-1.0, 1.0, size=3) * np.sqrt(mesh.area)
    return mesh.transformed(rotation=rotation, translation=translation), rotation, translation


def _mean(errors: FloatArray) -> float:
    return float(errors.mean()) if len(errors) else float("nan")
