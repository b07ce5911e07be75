"""Make a partial-matching data set of any folder of dense meshes in several poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nonrigid.benchmark.datasets.dense import DenseClass, dense_classes
from nonrigid.benchmark.datasets.parts import part_pairs
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Offer cuts and holes of posed meshes by the recipe of SHREC'16: remesh first, cut after.

    The folder holds meshes called `<class><number>` whose vertices correspond by number inside a class, as in TOSCA;
    the lowest number is the template.

    Parameters
    ----------
    root
        The folder.
    vertices
        Vertices of each remeshed complete shape; SHREC'16 has 10 000.
    seed
        For planes, borders of holes and the numbering.

    Raises
    ------
    InputError
        If the folder holds no class with two poses, or fewer than 4 vertices are asked for.

    Source: Cosmo, Rodola, Bronstein, Torsello, Cremers, Sahillioglu, "SHREC'16: Partial Matching of Deformable Shapes",
    Eurographics Workshop on 3D Object Retrieval 2016.
    """

    root: Path
    vertices: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        if self.vertices < 4:
            raise InputError(f"{self.vertices} vertices are too few", remedy="ask for at least 4, better for thousands")

    @property
    def name(self) -> str:
        """Name of the data set with its size and seed."""
        return f"recipe {self.vertices} seed {self.seed}"

    def classes(self) -> Sequence[DenseClass]:
        """Return the classes found."""
        return dense_classes(Path(self.root), vertices=self.vertices, seed=self.seed)

    def pairs(self) -> Sequence[PairSpec]:
        """List six cuts and nine holed shapes of every pose, without making them."""
        return part_pairs(self.classes(), seed=self.seed)
