"""What a data set of partial-matching pairs has to offer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeAlias, runtime_checkable

from nonrigid.benchmark.datasets.files import FileSource, Member, exists, load_mesh, local_file
from nonrigid.benchmark.formats import read_truth
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

MeshSource: TypeAlias = FileSource | Callable[[], Mesh]
PointsSource: TypeAlias = FileSource | Callable[[], SurfacePoints]


@dataclass(frozen=True, kw_only=True)
class PairSpec:
    """Describe a pair without reading it: cheap to list, to select from and to send to another process.

    Parameters
    ----------
    name
        Unique inside the data set.
    split
        Such as "cuts" or "holes".
    class_name
        The class whose full shape this is, such as "cat".
    part, full
        Where the meshes come from: a file, a member of a zip archive, or a picklable function without arguments.
    truth, mirrored
        Where the ground truth comes from; None where the data set has none.
    source_pose
        The pose that the part was cut from; learned methods are split by it, never by file.
    own_pose
        Whether that pose is the full shape's own, so that the part is a rigid copy of a piece of it; None if unknown.
    kept_area
        Fraction of the area kept, where it is known without reading the meshes.
    metadata
        Anything else worth a column in a table.
    """

    name: str
    split: str
    class_name: str
    part: MeshSource
    full: MeshSource
    truth: PointsSource | None = None
    mirrored: PointsSource | None = None
    source_pose: str | None = None
    own_pose: bool | None = None
    kept_area: float | None = None
    metadata: Mapping[str, object] = field(default_factory=dict)

    def load(self) -> PairData:
        """Read or build the pair.

        Raises
        ------
        InputError
            Naming the file, if one is missing or wrong, or does not fit the others.
        """
        for role in ("part", "full", "truth", "mirrored"):
            source = getattr(self, role)
            if isinstance(source, Path | Member) and not exists(source):
                raise InputError(f"pair {self.name} lacks its {role} file", file=source, remedy="complete the data set")
        part, full = _mesh(self.part), _mesh(self.full)
        return PairData(
            name=self.name,
            part=part,
            full=full,
            truth=_points(self.truth, part, full),
            mirrored=_points(self.mirrored, part, full),
            metadata={
                "split": self.split,
                "class_name": self.class_name,
                "source_pose": self.source_pose,
                "own_pose": self.own_pose,
                **self.metadata,
            },
        )

    def load_part(self) -> Mesh:
        """Read or build the part alone."""
        return _mesh(self.part)

    def load_full(self) -> Mesh:
        """Read or build the full shape alone."""
        return _mesh(self.full)


@dataclass(frozen=True, eq=False, kw_only=True)
class PairData:
    """Hold a partial shape, the full shape and the ground truth between them.

    Parameters
    ----------
    name
        Unique inside the data set; it seeds the random rigid motion.
    part, full
        Raw meshes, in the numbering that the ground truth refers to and in any unit of length.
    truth
        The point of `full` that each vertex of `part` lies on; None where there is no ground truth.
    mirrored
        The same for the left-right mirrored map; None where there is none.
    metadata
        Split, class, source pose and anything else worth a column in a table.

    Raises
    ------
    InputError
        If the ground truth has not one row a vertex of the part, or names a face that `full` has not.
    """

    name: str
    part: Mesh
    full: Mesh
    truth: SurfacePoints | None
    mirrored: SurfacePoints | None = None
    metadata: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for role, points in (("truth", self.truth), ("mirrored truth", self.mirrored)):
            if points is None:
                continue
            if len(points) != len(self.part.vertices):
                count = len(self.part.vertices)
                raise InputError(
                    f"the {role} of {self.name} has {len(points)} rows, but the part has {count} vertices",
                    remedy="give one row a vertex of the part",
                )
            points.check(self.full)

    @property
    def kept_area(self) -> float:
        """Area of the part as a fraction of the area of the full shape."""
        return self.part.area / self.full.area


@runtime_checkable
class Dataset(Protocol):
    """Offer named pairs; any object with these two members is a data set."""

    @property
    def name(self) -> str:
        """Name of the data set, shown in tables."""
        ...

    def pairs(self) -> Sequence[PairSpec]:
        """List the pairs in a fixed order, without reading them."""
        ...


def _mesh(source: MeshSource) -> Mesh:
    return load_mesh(source) if isinstance(source, Path | Member) else source()


def _points(source: PointsSource | None, part: Mesh, full: Mesh) -> SurfacePoints | None:
    if isinstance(source, Path | Member):
        with local_file(source) as path:
            return read_truth(path, full, expected_rows=len(part.vertices))
    return None if source is None else source()
