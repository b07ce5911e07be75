"""Check a data set of your own against what the benchmark relies on."""

from __future__ import annotations

from nonrigid.benchmark.datasets.checks import TORN_SHARE, torn_share
from nonrigid.benchmark.datasets.protocols import Dataset, PairData
from nonrigid.geometry.clean import clean
from nonrigid.solvers.testing.errors import expect


def check_dataset(dataset: Dataset, *, pairs: int = 3) -> list[PairData]:
    """Load the first pairs of a data set, check them, and return them.

    Checked: names are unique and listed the same way twice; meshes can be repaired into one surface; the truth has one
    point a vertex of the part, on faces of the full shape, and does not tear the part, and the mirrored truth too; the
    part is no larger than the full shape; loading twice gives the same vertices.

    Raises
    ------
    ConformanceError
        Saying what was expected and found, and where to look.

    Examples
    --------
    >>> from nonrigid.benchmark.datasets.creatures import Creatures
    >>> [pair.name for pair in check_dataset(Creatures(vertices=600), pairs=1)]
    ['cuts_anton_shape_1']
    """
    specs = list(dataset.pairs())
    names = [spec.name for spec in specs]
    expect(len(specs) > 0, dataset.name, expected="at least one pair", found=0, look="pairs")
    expect(len(set(names)) == len(names), dataset.name, expected="unique names", found=names, look="pairs")
    again = [spec.name for spec in dataset.pairs()]
    expect(again == names, dataset.name, expected="the same list twice", found=again, look="pairs")
    loaded = []
    for spec in specs[:pairs]:
        pair = spec.load()
        _check_pair(pair)
        same = spec.load().part.vertices.tobytes() == pair.part.vertices.tobytes()
        expect(same, pair.name, expected="the same part at each load", found="another", look="seeds")
        loaded.append(pair)
    return loaded


def _check_pair(pair: PairData) -> None:
    whole, piece = clean(pair.full).mesh, clean(pair.part).mesh
    ratio = piece.area / whole.area
    expect(ratio <= 1.1, pair.name, expected="a part no larger than the full shape", found=ratio, look="the units")
    for role, points in (("truth", pair.truth), ("mirrored", pair.mirrored)):
        if points is None:
            continue
        rows = len(pair.part.vertices)
        expect(len(points) == rows, pair.name, expected=f"{rows} rows of {role}", found=len(points), look=role)
        points.check(pair.full)
        torn = torn_share(pair, points)
        expect(torn <= TORN_SHARE, pair.name, expected=f"a {role} that does not tear", found=torn, look="row order")
