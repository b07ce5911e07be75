"""A surface and everything derived from it: computed when first asked for, and kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from operator import index
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from nonrigid.geometry.arrays import FloatArray, IntArray, frozen
from nonrigid.geometry.cache import Cache, content_hash, default_cache
from nonrigid.geometry.clean import CleanMesh, clean
from nonrigid.geometry.descriptors.heat_kernel import heat_kernel_signature, heat_times
from nonrigid.geometry.descriptors.shot import shot
from nonrigid.geometry.descriptors.wave_kernel import wave_energies, wave_kernel_signature
from nonrigid.geometry.frame import canonical_priority
from nonrigid.geometry.geodesics import Geodesics, make_geodesics
from nonrigid.geometry.geodesics.protocol import checked_vertices
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.operators import Laplacian, laplacian
from nonrigid.geometry.sampling import farthest_points
from nonrigid.geometry.spectrum import Spectrum, spectrum

LARGEST_STORED = 64_000_000
"""Bytes: larger distance matrices are computed again instead of being kept."""

Made = TypeVar("Made")
Answers: TypeAlias = list[tuple[IntArray, FloatArray]]
"""Distances that are known: ascending vertices, and a row of each."""


class Surface:
    """Hold a mesh and derive from its repaired view whatever a formulation asks for.

    Everything is computed when first asked for, kept in memory, and (what takes longer than reading it) kept in a cache
    on disk under the hash of the mesh and of the parameters. A stored answer equals a fresh one bit for bit. Arrays are
    read-only, because they are shared.

    Parameters
    ----------
    mesh
        As read. Lengths and areas below are in its unit.
    cache
        Where results are kept between runs; `default_cache()` unless given, None for nowhere.

    Attributes
    ----------
    raw
        The mesh as read.

    Examples
    --------
    >>> octahedron = Mesh(
    ...     [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
    ...     [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]],
    ... )
    >>> surface = Surface(octahedron, cache=None)
    >>> surface.spectrum(3).eigenvalues.shape, round(surface.area, 3)
    ((3,), 6.928)
    """

    def __init__(self, mesh: Mesh, *, cache: Cache | Literal["default"] | None = "default") -> None:
        self.raw = mesh
        self._cache = default_cache() if cache == "default" else Cache(None) if cache is None else cache
        self._made: dict[str, Any] = {}
        self._rows: dict[str, Answers] = {}
        self._squares: dict[str, Answers] = {}

    def __repr__(self) -> str:
        return f"Surface({self.raw.name}: {len(self.raw.vertices)} vertices, {len(self.raw.faces)} faces)"

    @cached_property
    def clean_view(self) -> CleanMesh:
        """The repaired view and its maps to the raw mesh; see `nonrigid.geometry.clean`."""
        return clean(self.raw)

    @property
    def mesh(self) -> Mesh:
        """The repaired mesh; every result below is in its numbering."""
        return self.clean_view.mesh

    @property
    def area(self) -> float:
        """Area of the repaired mesh, in the squared unit of the vertices."""
        return self.mesh.area

    @cached_property
    def key(self) -> str:
        """Hash of the raw vertices and faces; the name does not count."""
        return content_hash(self.raw.vertices, self.raw.faces)

    def laplacian(self, kind: str = "robust") -> Laplacian:
        """Return the Laplacian; see `nonrigid.geometry.operators.laplacian`."""
        return self._remember(f"laplacian {kind}", lambda: laplacian(self.mesh, kind))

    def spectrum(self, k: int, kind: str = "robust") -> Spectrum:
        """Return the `k` smallest eigenpairs; see `nonrigid.geometry.spectrum.spectrum`.

        Where a symmetry of the surface leaves the sign of an eigenfunction open, `canonical_priority` decides it.
        """
        k = index(k)

        def fresh() -> dict[str, FloatArray]:
            made = spectrum(self.laplacian(kind), k, reference=canonical_priority(self.mesh))
            return {"eigenvalues": made.eigenvalues, "eigenfunctions": made.eigenfunctions, "mass": made.mass}

        return self._remember(f"spectrum {k} {kind}", lambda: Spectrum(**self._stored(("spectrum", k, kind), fresh)))

    def heat_kernel_signature(self, count: int = 16, k: int = 100) -> FloatArray:
        """Return the (n, count) heat kernel signature at logarithmic times, from `k` eigenpairs."""
        basis = self.spectrum(k)
        return self._remember(
            f"heat {count} {k}", lambda: frozen(heat_kernel_signature(basis, heat_times(basis, count)))
        )

    def wave_kernel_signature(self, count: int = 100, k: int = 100) -> FloatArray:
        """Return the (n, count) wave kernel signature at logarithmic energies, from `k` eigenpairs."""
        basis = self.spectrum(k)
        return self._remember(
            f"wave {count} {k}", lambda: frozen(wave_kernel_signature(basis, *wave_energies(basis, count)))
        )

    def shot(
        self,
        radius: float,
        cosine_bins: int = 11,
        interpolation: Literal["quadrilinear", "additive"] = "quadrilinear",
    ) -> FloatArray:
        """Return the (n, 32 cosine_bins) SHOT descriptors; `radius` is in the unit of the vertices."""
        key = ("shot", float(radius), cosine_bins, interpolation)

        def fresh() -> dict[str, FloatArray]:
            return {"rows": shot(self.mesh, radius, cosine_bins=cosine_bins, interpolation=interpolation)}

        return self._remember(repr(key), lambda: self._stored(key, fresh)["rows"])

    def samples(self, count: int, metric: Literal["euclidean", "geodesic"] = "euclidean") -> IntArray:
        """Return `count` vertices far from one another; see `nonrigid.geometry.sampling.farthest_points`."""
        count = index(count)
        key = ("samples", count, metric)

        def fresh() -> dict[str, IntArray]:
            return {"vertices": farthest_points(self.mesh, count, metric=metric)}

        return self._remember(repr(key), lambda: self._stored(key, fresh)["vertices"])

    def distances(self, sources: ArrayLike, method: str = "dijkstra") -> FloatArray:
        """Return the (s, n) distances along the surface from `sources` to every vertex, in the unit of the vertices.

        `method` is "dijkstra", "bridged", "heat" or "exact"; see `nonrigid.geometry.geodesics`. Answers larger than
        `LARGEST_STORED` are not kept; what an earlier answer for more sources holds is taken from there.
        """
        wanted, method = checked_vertices(sources, len(self.mesh.vertices)), self._same_as(method)
        ascending, place = np.unique(wanted, return_inverse=True)
        answers = self._rows.setdefault(method, [])
        if (earlier := _holding(ascending, answers)) is not None:
            known, larger = earlier
            return larger if np.array_equal(wanted, known) else larger[np.searchsorted(known, wanted)]
        key = ("distances", method, ascending)

        def fresh() -> dict[str, FloatArray]:
            return {"rows": self._geodesics(method).distances(ascending)}

        if ascending.size * len(self.mesh.vertices) * 8 > LARGEST_STORED:
            large: FloatArray = frozen(fresh()["rows"][place])
            return large
        rows: FloatArray = self._stored(key, fresh)["rows"]
        answers.append((ascending, rows))
        return rows if np.array_equal(wanted, ascending) else rows[place]

    def distances_between(self, vertices: ArrayLike, method: str = "dijkstra", *, keep: bool = True) -> FloatArray:
        """Return the (s, s) distances along the surface between the given vertices, in the unit of the vertices.

        The rows are computed a block at a time, so that memory stays small; what an earlier answer for more vertices
        holds is taken from there. `keep=False` says that another run will hardly ask for these vertices: the answer is
        then kept in memory only.
        """
        wanted, method = checked_vertices(vertices, len(self.mesh.vertices)), self._same_as(method)
        ascending, place = np.unique(wanted, return_inverse=True)
        squares = self._squares.setdefault(method, [])
        if (earlier := _holding(ascending, squares)) is not None:
            known, larger = earlier
            rows = np.searchsorted(known, wanted)
            return larger if np.array_equal(wanted, known) else larger[np.ix_(rows, rows)]
        if (earlier := _holding(ascending, self._rows.get(method, []))) is not None:
            known, larger = earlier
            return larger[np.searchsorted(known, wanted)].take(wanted, axis=1)
        key = ("between", method, ascending)

        def fresh() -> dict[str, FloatArray]:
            blocks = np.array_split(ascending, max(1, len(ascending) // 256))
            made = self._geodesics(method)
            return {"square": np.vstack([made.distances(block)[:, ascending] for block in blocks])}

        square: FloatArray = self._stored(key, fresh)["square"] if keep else frozen(fresh()["square"])
        squares.append((ascending, square))
        return square if np.array_equal(wanted, ascending) else square[np.ix_(place, place)]

    def scaled(self, factor: float) -> Surface:
        """Return the surface with all lengths multiplied by `factor`, with the same cache."""
        return Surface(self.raw.transformed(scale=factor), cache=self._cache)

    def _same_as(self, method: str) -> str:
        """Return the simplest method with the same answers, so that they are kept once."""
        return "dijkstra" if method == "bridged" and not len(self.mesh.boundary_edges) else method

    def _geodesics(self, method: str) -> Geodesics:
        return self._remember(f"geodesics {method}", lambda: make_geodesics(self.mesh, method))

    def _remember(self, name: str, make: Callable[[], Made]) -> Made:
        if name not in self._made:
            self._made[name] = make()
        made: Made = self._made[name]
        return made

    def _stored(self, key: tuple[object, ...], compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        return {name: frozen(array) for name, array in self._cache.fetch((self.key, *key), compute).items()}


def _holding(ascending: IntArray, answers: Answers) -> tuple[IntArray, FloatArray] | None:
    """Return the first of earlier answers that is known for all the given vertices, if there is one."""
    return next((one for one in answers if np.isin(ascending, one[0], assume_unique=True).all()), None)
