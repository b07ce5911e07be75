"""A trained forest: what it was trained on, and how it votes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from nonrigid.formulations.forest.template import Template
from nonrigid.formulations.forest.tree import Tree
from nonrigid.formulations.formulation import Pair
from nonrigid.geometry.cache import content_hash
from nonrigid.geometry.spectrum import Spectrum


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Forest:
    """Hold the trees of one full surface and where their training parts came from.

    Made by `nonrigid.formulations.forest.training.train_forest`; kept in files by `nonrigid.formulations.forest.store`.

    Parameters
    ----------
    template
        The full surface and its labels.
    trees
        All of equal weight.
    eigenfunctions
        Number of eigenfunctions that tests may ask for.
    class_name
        Name of the class, such as "cat".
    poses
        Source poses of the training parts: a test on a part of one of them would be a test on the training data.
    parts
        Names of the training parts.
    training
        The settings of the training, in words.
    """

    template: Template
    trees: tuple[Tree, ...]
    eigenfunctions: int
    class_name: str
    poses: tuple[str, ...]
    parts: tuple[str, ...]
    training: str = ""

    def __repr__(self) -> str:
        # A benchmark's runs are told apart by it, so that it has to follow the content.
        content: list[object] = [self.template.digest]
        for tree in self.trees:
            content += [tree.tests.cutoffs, tree.tests.times, tree.test, tree.threshold, tree.left, tree.right]
            content += [tree.votes.data, tree.votes.indices, tree.votes.indptr]
        poses = " ".join(self.poses)
        return f"Forest({self.class_name!r}, {len(self.trees)} trees, poses {poses}, {content_hash(*content)[:16]})"

    def spectrum(self, pair: Pair) -> Spectrum:
        """Return the eigenfunctions of the part that the tests ask for; a tiny part has fewer."""
        return pair.part.spectrum(min(self.eigenfunctions, len(pair.part.mesh.vertices) - 1))

    def votes(self, pair: Pair) -> Any:
        """Return the (n, L) sparse shares of the labels for every vertex of the part: the mean over trees.

        Column l stands for the vertex `template.label_vertices(pair.full)[l]`. Rows sum to 1.
        """
        spectrum = self.spectrum(pair)
        total = sum(tree.votes[tree.leaves(spectrum)] for tree in self.trees)
        return (total * (1.0 / len(self.trees))).tocsr()
