"""Grow a forest on parts whose points are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from nonrigid.formulations.forest.forest import Forest
from nonrigid.formulations.forest.heat_tests import Answers, HeatTests, draw_tests
from nonrigid.formulations.forest.template import Template, nearest_samples
from nonrigid.formulations.forest.tree import Tree
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.arrays import IntArray
from nonrigid.geometry.errors import InputError
from nonrigid.geometry.frame import canonical_priority
from nonrigid.geometry.points import SurfacePoints


@dataclass(frozen=True, eq=False, kw_only=True)
class Example:
    """Hold a part, the full surface, and the point of the latter that each vertex of the former is.

    Parameters
    ----------
    pair
        The surfaces.
    truth
        One point a vertex of the part, in the numbers of the files.
    pose
        The pose that the part was cut from.
    """

    pair: Pair
    truth: SurfacePoints
    pose: str

    def __post_init__(self) -> None:
        rows, wanted = len(self.truth), len(self.pair.part.raw.vertices)
        if rows != wanted:
            raise InputError(
                f"the truth of {self.pair.part.raw.name} has {rows} rows for {wanted} vertices",
                remedy="give one row a vertex of the part",
            )


@dataclass(frozen=True, kw_only=True)
class ForestSettings:
    """Hold how forests grow.

    Parameters
    ----------
    trees, depth, leaf_samples
        Number of trees, largest depth, and fewest training points at a leaf.
    labels
        Largest number of labels: vertices of the full surface, or as many cells of it.
    cells
        Cells of the full surface whose entropy the tests are to lower; leaves count labels, not cells. With a label a
        vertex, every label is nearly alone in its node after a few tests, and its entropy tells tests apart no more.
    tests, tries
        Random tests drawn for a tree, and how many of them each node tries, at one random threshold each.
    eigenfunctions
        Largest number of eigenfunctions in a test.
    samples, bag
        Largest number of training points, evenly drawn, and the share of them that each tree sees.

    Source: Geurts, Ernst and Wehenkel, extremely randomized trees (Machine Learning 2006), for the thresholds.
    """

    trees: int = 15
    depth: int = 20
    leaf_samples: int = 10
    labels: int = 10_000
    cells: int = 200
    tests: int = 200
    tries: int = 60
    eigenfunctions: int = 100
    samples: int = 100_000
    bag: float = 0.6

    def __post_init__(self) -> None:
        for name in ("trees", "depth", "leaf_samples", "labels", "cells", "tests", "tries", "samples"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}", remedy="give a number of at least 1")
        if not 0.0 < self.bag <= 1.0:
            raise InputError(f"bag is {self.bag}", remedy="give a share above 0 and up to 1")


def train_forest(
    examples: Sequence[Example], *, class_name: str = "", settings: ForestSettings | None = None, seed: int = 0
) -> Forest:
    """Grow a forest for one full surface.

    Each tree sees a random share of the points and draws its own tests. Memory: 4 bytes a point and test of one tree,
    and 12 bytes a point and tree in the end; histograms are sparse, so the number of labels does not count.

    Parameters
    ----------
    examples
        Parts of one and the same full surface.
    class_name
        Kept with the forest.
    seed
        Same seed, same machine, same forest; neither the order of the examples nor, where their parts have different
        names, that of vertices counts.

    Raises
    ------
    InputError
        If there is no example, the full surfaces differ, or scikit-learn is not installed.
    """
    settings = settings or ForestSettings()
    if not examples:
        raise InputError("a forest has no training part", remedy="give at least one example")
    full = examples[0].pair.full
    for example in examples:
        if example.pair.full.key != full.key:
            raise InputError(
                f"{example.pair.part.raw.name} is a part of another full surface than {examples[0].pair.part.raw.name}",
                remedy="train one forest for each full surface",
            )
    rng = np.random.default_rng(seed)
    ordered = sorted(examples, key=lambda example: (example.pair.part.raw.name, example.pair.part.key))
    count = min(settings.eigenfunctions, len(full.mesh.vertices) - 1)
    template = Template.of(full, settings.labels)
    coarse = full.samples(min(settings.cells, len(full.mesh.vertices)))
    data = _Data.of(ordered, settings, nearest_samples(full.mesh, coarse), count, rng)
    trees = tuple(
        _tree(data, draw_tests(full.spectrum(count), settings.tests, rng), template, settings, rng)
        for _ in range(settings.trees)
    )
    return Forest(
        template=template,
        trees=trees,
        eigenfunctions=count,
        class_name=class_name,
        poses=tuple(sorted({example.pose for example in examples})),
        parts=tuple(example.pair.part.raw.name for example in ordered),
        training=f"{settings}, seed {seed}",
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Data:
    """Hold the training points: for each example the vertices used; the full vertex and the cell of every point."""

    examples: Sequence[Example]
    rows: tuple[IntArray, ...]
    target: IntArray
    cell: IntArray
    eigenfunctions: int

    @classmethod
    def of(
        cls,
        examples: Sequence[Example],
        settings: ForestSettings,
        cell: IntArray,
        count: int,
        rng: np.random.Generator,
    ) -> _Data:
        """Choose the training points, at random where there are more than wanted."""
        rows, targets = [], []
        for example in examples:
            part, full = example.pair.part, example.pair.full
            nearest = full.clean_view.from_raw(example.truth).nearest_corner(full.mesh)[part.clean_view.raw_of_vertex]
            order = np.argsort(canonical_priority(part.mesh), kind="stable")  # so that numbering plays no part
            rows.append(order[nearest[order] >= 0])
            targets.append(nearest)
        total = sum(map(len, rows))
        if total > settings.samples:
            share = settings.samples / total
            rows = [r[np.sort(rng.permutation(len(r))[: max(1, int(share * len(r)))])] for r in rows]
        target = np.concatenate([t[r] for t, r in zip(targets, rows, strict=True)])
        return cls(examples=examples, rows=tuple(rows), target=target, cell=cell[target], eigenfunctions=count)

    def values(self, tests: HeatTests) -> Answers:
        """Return the answers of all points to all tests."""
        blocks = []
        for example, rows in zip(self.examples, self.rows, strict=True):
            part = example.pair.part
            spectrum = part.spectrum(min(self.eigenfunctions, len(part.mesh.vertices) - 1))
            blocks.append(tests.values(spectrum)[rows])
        return np.vstack(blocks)


def _tree(
    data: _Data, tests: HeatTests, template: Template, settings: ForestSettings, rng: np.random.Generator
) -> Tree:
    """Grow one tree on a bag of the points, and count the labels of its leaves."""
    try:
        from sklearn.tree import ExtraTreeClassifier
    except ImportError as error:
        raise InputError("training a forest needs scikit-learn", remedy="pip install scikit-learn") from error
    bag = np.sort(rng.permutation(len(data.target))[: max(1, round(settings.bag * len(data.target)))])
    values = data.values(tests)[bag]
    grower = ExtraTreeClassifier(
        criterion="entropy",
        max_depth=settings.depth,
        min_samples_leaf=min(settings.leaf_samples, len(bag)),
        max_features=min(settings.tries, len(tests)),
        random_state=int(rng.integers(2**31)),
    )
    grown = grower.fit(values, data.cell[bag]).tree_
    left, right = np.asarray(grown.children_left, np.int64), np.asarray(grown.children_right, np.int64)
    tree = Tree(
        tests=tests,
        test=np.maximum(np.asarray(grown.feature, np.int64), 0),
        threshold=np.asarray(grown.threshold, np.float64),
        left=left,
        right=right,
        votes=None,
    )
    return replace(tree, votes=_votes(tree.descend(values), template.cell[data.target[bag]], len(left), template))


def _votes(leaves: IntArray, labels: IntArray, nodes: int, template: Template) -> Any:
    shape = (nodes, len(template.labels))
    counts = csr_array(coo_array((np.ones(len(leaves), dtype=np.float32), (leaves, labels)), shape=shape))
    totals = np.asarray(counts.sum(axis=1), dtype=np.float32).ravel()
    return csr_array(diags_array(np.float32(1.0) / np.maximum(totals, np.float32(1.0))) @ counts)
