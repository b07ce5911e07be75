"""Split a data set for learning: by the pose that a part was cut from, never by file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Fold:
    """Name one fold of a data set, and the pairs that are tested with it or learned from.

    Parts of one pose hold the same surface, so that a method which has seen one of them has seen part of the answer.

    Parameters
    ----------
    number, count
        Which of how many folds is set apart for testing, from 1.
    training
        Whether to take the pairs to learn from, all others, in place of those to test.
    seed
        Of the order in which poses are dealt to folds.
    """

    number: int
    count: int
    training: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count or self.count < 2:
            raise InputError(
                f"fold {self.number} of {self.count}", remedy="give at least 2 folds, and number them from 1"
            )

    @classmethod
    def parse(cls, text: str) -> Fold:
        """Read "2/5", "not 2/5" (what is learned from when 2/5 is tested) or "2/5 seed 3"."""
        words = text.split()
        training = words[:1] == ["not"]
        head, *rest = words[training:] or [""]
        number, _, count = head.partition("/")
        seeded = len(rest) == 2 and rest[0] == "seed" and rest[1].isdecimal()
        if not (number.isdecimal() and count.isdecimal()) or (rest and not seeded):
            raise InputError(f"{text!r} names no fold", remedy="write 2/5, not 2/5 or 2/5 seed 3")
        return cls(number=int(number), count=int(count), training=training, seed=int(rest[1]) if rest else 0)

    def __str__(self) -> str:
        seed = f" seed {self.seed}" if self.seed else ""
        return f"{'not ' if self.training else ''}{self.number}/{self.count}{seed}"


def select_fold(specs: Sequence[PairSpec], fold: Fold) -> list[PairSpec]:
    """Return the pairs of a fold in their order.

    Poses are dealt to the folds one by one, class by class and in random order within a class, so that every fold gets
    its share of each class. The answer does not depend on the order of the pairs.

    Raises
    ------
    InputError
        If the source pose of a pair is not known, or there are fewer poses than folds.

    Examples
    --------
    >>> from nonrigid.benchmark.datasets.creatures import Creatures
    >>> specs = Creatures(vertices=600).pairs()
    >>> tested = select_fold(specs, Fold(number=1, count=2))
    >>> learned = select_fold(specs, Fold.parse("not 1/2"))
    >>> {spec.source_pose for spec in tested} & {spec.source_pose for spec in learned}
    set()
    """
    unknown = [spec.name for spec in specs if spec.source_pose is None]
    if unknown:
        raise InputError(
            f"the source pose of {len(unknown)} pairs is not known, such as {unknown[0]}",
            remedy="add source_poses.csv with the columns shape and source_pose beside the folder null",
        )
    poses = sorted({(spec.class_name, str(spec.source_pose)) for spec in specs})
    if len(poses) < fold.count:
        raise InputError(f"{len(poses)} source poses for {fold.count} folds", remedy="ask for fewer folds")
    order = np.random.default_rng(fold.seed).permutation(len(poses))
    dealt = sorted(range(len(poses)), key=lambda place: (poses[place][0], order[place]))
    number = {poses[place]: turn % fold.count + 1 for turn, place in enumerate(dealt)}
    return [spec for spec in specs if (number[spec.class_name, str(spec.source_pose)] == fold.number) != fold.training]
