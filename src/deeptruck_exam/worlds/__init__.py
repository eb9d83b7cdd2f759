"""Worlds: trucks, roads, traffic, drivers and loggers that a case is made of, as tables of one `World`.

In: a generator of random numbers. Out: parameters of a truck, roads, speeds to follow, a driver, recordings.
Each family of effects came with a world of its own; that of the sealed one is not among `WORLDS`. A deep
simulator's cases keep the plain one, because it has learned from drives there.
"""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.planting import FAMILIES, SEALED
from deeptruck_exam.worlds.by_land import BY_LAND
from deeptruck_exam.worlds.by_people import BY_PEOPLE
from deeptruck_exam.worlds.by_river import BY_RIVER
from deeptruck_exam.worlds.by_rock import BY_ROCK
from deeptruck_exam.worlds.by_trade import BY_TRADE
from deeptruck_exam.worlds.by_water import BY_WATER
from deeptruck_exam.worlds.sealed_world import SEALED_WORLD
from deeptruck_exam.worlds.world import World

WORLDS = {
    **BY_TRADE,
    **BY_LAND,
    **BY_WATER,
    **BY_ROCK,
    **BY_PEOPLE,
    **BY_RIVER,
}  # in the order of the families
OF_FAMILY = dict(zip(FAMILIES, ("plain", *WORLDS), strict=True))


def of(forms: str, simulator: str, seed: int = 0) -> World:
    """The world a case plays in: the family's own; of all families together, any by the seed."""
    if simulator != "physics":
        return WORLDS["plain"]
    if forms == SEALED:
        return SEALED_WORLD
    any_one = list(WORLDS)[np.random.default_rng([seed, 6]).integers(len(WORLDS))]
    return WORLDS[OF_FAMILY.get(forms, any_one)]
