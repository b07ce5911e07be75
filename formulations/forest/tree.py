"""One tree of a forest: tests on the way down, and the labels seen at its leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nonrigid.formulations.forest.heat_tests import Answers, HeatTests
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.spectrum import Spectrum


@dataclass(frozen=True, eq=False, kw_only=True)
class Tree:
    """Hold a binary tree over m nodes; node 0 is the root.

    Parameters
    ----------
    tests
        The tests that nodes choose from.
    test, threshold
        (m,) the test of each node and the value up to which a point goes left.
    left, right
        (m,) the children of each node; -1 at a leaf.
    votes
        (m, L) sparse rows that sum to 1 at leaves and are empty elsewhere: the share of each label among the training
        points that came there.
    """

    tests: HeatTests
    test: IntArray
    threshold: FloatArray
    left: IntArray
    right: IntArray
    votes: Any

    def leaves(self, spectrum: Spectrum) -> IntArray:
        """Return the (n,) leaf that each point of a surface comes to; lengths in units of sqrt(full area)."""
        return self.descend(self.tests.values(spectrum))

    def descend(self, values: Answers) -> IntArray:
        """Return the (n,) leaves for the (n, tests) answers of points.

        Examples
        --------
        >>> tests = HeatTests(np.array([5.0]), np.array([1.0]))
        >>> children = {"left": np.array([1, -1, -1]), "right": np.array([2, -1, -1])}
        >>> stump = Tree(tests=tests, test=np.zeros(3, int), threshold=np.array([0.5, 0, 0]), votes=None, **children)
        >>> stump.descend(np.array([[0.5], [0.6]], dtype=np.float32))
        array([1, 2])
        """
        node = np.zeros(len(values), dtype=np.int64)
        moving = np.arange(len(values)) if self.left[0] >= 0 else np.empty(0, dtype=np.int64)
        while len(moving):
            at = node[moving]
            low = values[moving, self.test[at]] <= self.threshold[at]
            node[moving] = np.where(low, self.left[at], self.right[at])
            moving = moving[self.left[node[moving]] >= 0]
        return node
