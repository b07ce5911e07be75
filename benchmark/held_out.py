"""Keep what a method has learned from apart from what it is tested on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.formulations.forest.training import Example
from nonrigid.formulations.formulation import Formulation, Pair, Stages
from nonrigid.geometry.errors import InputError, NonrigidError


@runtime_checkable
class Learned(Protocol):
    """Offer what a method that learns has besides `stages`."""

    def stages(self, pair: Pair) -> Stages:
        """Generate the method's problems for a pair."""

    def held_out(self, class_name: str, source_pose: str | None) -> Formulation:
        """Return the method as it may be tested on a part of a pose; raise `InputError` if it has seen the pose."""

    def trained_on(self, examples: Sequence[Example], *, class_name: str = "", seed: int = 0) -> Formulation:
        """Return the method, trained."""


@dataclass(frozen=True)
class Refused:
    """Stand for a method that may not be tested on a pair; every run of it fails with the reason."""

    formulation: Formulation
    reason: str

    def stages(self, pair: Pair) -> Stages:
        """Raise `InputError` with the reason."""
        raise InputError(self.reason)


def held_out_for(formulation: Formulation, spec: PairSpec) -> Formulation:
    """Return a formulation as it may be tested on a pair: one that learns has then seen nothing of the source pose.

    Where that cannot be, the result refuses the pair with the reason, and the refusal is a row of the results.

    Examples
    --------
    >>> from nonrigid.benchmark.datasets.creatures import Creatures
    >>> from nonrigid.formulations.random_forest import RandomForest
    >>> held_out_for(RandomForest(), Creatures().pairs()[0]).reason
    'random forests need a trained forest; give forest=PATH; train one with `nonrigid train rf`'
    """
    if not isinstance(formulation, Learned):
        return formulation
    try:
        return formulation.held_out(spec.class_name, spec.source_pose)
    except (NonrigidError, OSError) as refusal:
        return Refused(formulation, str(refusal))


def trained_for(
    formulation: Formulation, spec: PairSpec, specs: Sequence[PairSpec], *, most: int = 3, seed: int = 0
) -> Formulation:
    """Return a formulation trained on pairs of the same class but of other poses; itself if it does not learn.

    It serves to try a method out: only the first `most` such pairs are learned from.

    Raises
    ------
    InputError
        If there is no such pair.
    """
    if not isinstance(formulation, Learned):
        return formulation
    chosen = [s for s in specs if s.class_name == spec.class_name and s.source_pose != spec.source_pose]
    chosen = chosen[:most]
    return formulation.trained_on([example_of(other) for other in chosen], class_name=spec.class_name, seed=seed)


def example_of(spec: PairSpec) -> Example:
    """Return a pair to learn from.

    Raises
    ------
    InputError
        If the pair has no ground truth, or its source pose is unknown.
    """
    data = spec.load()
    if data.truth is None or spec.source_pose is None:
        lost = "ground truth" if data.truth is None else "source pose"
        raise InputError(f"{spec.name} has no {lost}", remedy="train on pairs that have")
    return Example(pair=Pair.of(data.part, data.full), truth=data.truth, pose=spec.source_pose)
