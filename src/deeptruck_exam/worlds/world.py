"""What a world is made of, and the roads and drivers it draws."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds import roads, traffic
from deeptruck_exam.worlds.drivers import Driver, Habits, Machine
from deeptruck_exam.worlds.loggers import Logger
from deeptruck_exam.worlds.roads import Roads
from deeptruck_exam.worlds.trucks import Fleet


@dataclass(frozen=True)
class World:
    """One way of making cases."""

    fleet: Fleet
    profile: roads.Profile
    way_down: roads.WayDown
    speed_profile: traffic.SpeedProfile
    people: tuple[Habits, ...]
    logger: Logger
    machine: Machine = field(default_factory=Machine)

    def draw_roads(self, rng: np.random.Generator, scenarios: list[str], flat: bool) -> Roads:
        return roads.draw_roads(rng, scenarios, flat, self.profile, self.way_down)

    def driver(
        self,
        truck: SimpleNamespace,
        style: NDArray[np.str_],
        target: Array,
        headway_s: float,
        dt: float,
        rng: np.random.Generator,
    ) -> Driver:
        return Driver(truck, style, target, headway_s, dt, rng, self.people, self.machine)
