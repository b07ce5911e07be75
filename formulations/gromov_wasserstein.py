"""Partial Gromov-Wasserstein matching: the area of the part is transported so that distances and looks are kept."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from nonrigid.formulations.formulation import Pair, Solved, Stages
from nonrigid.formulations.model import Problem, Variable, minimize
from nonrigid.formulations.model.terms.gromov_wasserstein import GromovWasserstein
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.transport_sets import PartialTransport
from nonrigid.formulations.partial_zoomout import GrowthSettings, growth, sample_areas
from nonrigid.formulations.ranges import COUNT, check_ranges
from nonrigid.formulations.sampled_distances import SampledDistances, sampled_distances
from nonrigid.formulations.trusted_descriptors import trusted_descriptors
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import InputError

NO_AREA = 1e-12
"""What stands for an area of 0, in units of the full area: masses and capacities have to be positive."""

LIKENESS = 0.05
"""Squared difference of unit descriptors by which a match of the start that goes by looks falls to 1/e."""


@dataclass(frozen=True, kw_only=True)
class PartialGromovWasserstein(GrowthSettings):
    """Match by the transport of the part's area into the full surface's that changes distances least.

    1. "transport": minimize sum (d_ii' - D_jj')^2 T_ij T_i'j' + look_weight * sum M_ij T_ij over plans T >= 0 between
       samples, with T 1 = p and T'1 <= q: all of the part finds a place, no place is filled twice. p and q are the
       areas around the samples over that of the part, M the squared differences of descriptors. The problem has many
       local minima and is stated several times: from an even plan, and from a plan after looks with looks counting ever
       less. The plan with the least objective wins.
    2. "first map", "map": each sample goes where most of its area went, and from there to all vertices by
       `nonrigid.formulations.partial_zoomout.growth`.

    Parameters
    ----------
    part_samples, full_samples
        Farthest-point samples of both surfaces; the plan has as many entries as their product.
    look_weight
        Squared length, in units of the full area, that a squared difference 1 of unit descriptors is worth.
    look_weights
        The same for the plans on the way from the start after looks to the last one, falling; may be empty.
    even_start
        Whether the even plan is tried as well.
    room
        Capacity over area of the full surface's samples: 1 for none to spare, more where areas are not kept.
    radii, trust_power, fitted_samples, grid_samples, first_size, steps, descriptor_weight, components, last_components,
    part_size, full_size
        See `nonrigid.formulations.partial_zoomout.GrowthSettings`.

    Source: Chapel, Alaya and Gasso, partial optimal transport with applications on positive-unlabeled learning (NeurIPS
    2020); the term for looks, Vayer, Chapel, Flamary, Tavenard and Courty, fused Gromov-Wasserstein (ICML 2019). The
    path from looks to distances and the numbers are this package's choice.

    Examples
    --------
    >>> PartialGromovWasserstein(room=1.2).room
    1.2
    """

    part_samples: int = 300
    full_samples: int = 500
    look_weight: float = 0.01
    look_weights: tuple[float, ...] = (0.3, 0.1, 0.03)
    even_start: bool = True
    room: float = 1.0

    method: ClassVar[str] = "pgw"

    def stages(self, pair: Pair) -> Stages:
        """State the transport from each start, then one map a step; return one point a vertex of the part."""
        if not self.room >= 1.0:
            raise InputError(f"room is {self.room}", remedy="give at least 1: the part must fit into the full surface")
        for weight in (self.look_weight, *self.look_weights):
            if not (np.isfinite(weight) and weight >= 0.0):
                raise InputError(f"a look weight is {weight}", remedy="give a number that is not negative")
        self.check()
        check_ranges(vars(self), {"part_samples": COUNT, "full_samples": COUNT})
        descriptors = trusted_descriptors(pair, self.radii, power=self.trust_power)
        samples = sampled_distances(
            pair,
            descriptors,
            part_samples=self.part_samples,
            placed_samples=self.part_samples,
            full_samples=self.full_samples,
        )
        plan = yield from self._transported(samples, self._plans(pair, samples))
        images = samples.grid[plan.argmax(axis=1)]
        return (yield from growth(self, pair, descriptors, samples.points, images))

    def _plans(self, pair: Pair, samples: SampledDistances) -> PartialTransport:
        areas = sample_areas(pair.part, samples.points), sample_areas(pair.full, samples.grid)
        # Of two vertices in the same place one has all the area.
        mass, capacity = (np.maximum(area, NO_AREA) for area in areas)
        kept = float(mass.sum())
        # A part may be a little larger than the whole, by noise: then there must be room for it.
        room = max(self.room, (1.0 + 1e-9) * kept / float(capacity.sum()))
        return PartialTransport(mass / kept, room * capacity / kept)

    def _transported(
        self, samples: SampledDistances, plans: PartialTransport
    ) -> Generator[Problem, Solved, FloatArray]:
        """Solve the transport from each start and return the best plan."""
        term = GromovWasserstein(symmetric(samples.between), symmetric(samples.on_full))

        def problem(look_weight: float, start: FloatArray) -> Problem:
            T = Variable("T", samples.unlike.shape)
            energy = term(T) + look_weight * Linear(samples.unlike)(T)
            return Problem("transport", minimize(energy), T @ plans, start={"T": start})

        likeness = np.exp(-(samples.unlike - samples.unlike.min(axis=1, keepdims=True)) / LIKENESS) * plans.capacity
        plan = plans.restore(likeness * (plans.mass / likeness.sum(axis=1))[:, None])
        for weight in self.look_weights:
            plan = (yield problem(weight, plan))["T"]
        best = yield problem(self.look_weight, plan)
        if self.even_start:
            other = yield problem(self.look_weight, plans.center(samples.unlike.shape))
            best = min(best, other, key=lambda solution: solution.objective)
        return best["T"]


def symmetric(distances: FloatArray) -> FloatArray:
    """Return (d + d') / 2: geodesic algorithms differ a little from one end to the other."""
    return np.asarray(0.5 * (distances + distances.T))
