"""The eight classes of creatures, in the spirit of those of SHREC'16."""

from __future__ import annotations

from nonrigid.benchmark.datasets.centaur import centaur
from nonrigid.benchmark.datasets.people import ATHLETE, SLENDER, STOUT, person
from nonrigid.benchmark.datasets.poses import CENTAURS, HORSES, PEOPLE, PREDATORS
from nonrigid.benchmark.datasets.quadrupeds import CAT, DOG, HORSE, WOLF, quadruped

ANATOMIES = (
    person("anton", ATHLETE, PEOPLE),
    person("bruno", STOUT, PEOPLE),
    quadruped("cat", *CAT, PREDATORS, blend=0.010),
    centaur(CENTAURS),
    person("clara", SLENDER, PEOPLE),
    quadruped("dog", *DOG, PREDATORS, blend=0.011),
    quadruped("horse", *HORSE, HORSES, blend=0.013),
    quadruped("wolf", *WOLF, PREDATORS, blend=0.012),
)
"""By name."""
