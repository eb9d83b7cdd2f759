"""Who makes trucks, roads, traffic, drivers and sensors: a world for each family.

The first and second forms share the old world; the later ones have each their own. A deep simulator
always keeps the old one, because it has learned from drives there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_exam import drivers, routes, sensors, trucks
from deeptruck_exam.hidden import Array

DrawParameters = Callable[[str, np.random.Generator], dict[str, float]]
DrawRoads = Callable[[np.random.Generator, list[str], bool], routes.Roads]
SpeedProfile = Callable[[np.random.Generator, str, int, float], Array]


@dataclass(frozen=True)
class World:
    """What a case is made of. `record` is called with what `draw_sensors` made, None for perfect ones."""

    draw_parameters: DrawParameters
    draw_roads: DrawRoads
    speed_profile: SpeedProfile
    driver: type[drivers.Driver]
    draw_sensors: Callable[[np.random.Generator], Any]
    record: Callable[..., dict[str, Array]]


OLD = World(
    trucks.draw_parameters,
    routes.draw_roads,
    drivers.speed_profile,
    drivers.Driver,
    sensors.Sensors.draw,
    sensors.record,
)


def of(forms: str, simulator: str) -> World:
    """The world a case plays in."""
    # imported here, because these worlds are made of the class above
    from deeptruck_exam.breakdown_records.world import WORLD as SIXTH
    from deeptruck_exam.field_reports.world import WORLD as FOURTH
    from deeptruck_exam.fleet_trials.world import WORLD as FIFTH
    from deeptruck_exam.other_makers.world import WORLD as THIRD
    from deeptruck_exam.proving_ground.world import WORLD as SEVENTH

    own = {"third": THIRD, "fourth": FOURTH, "fifth": FIFTH, "sixth": SIXTH, "seventh": SEVENTH}
    return own.get(forms, OLD) if simulator == "physics" else OLD
