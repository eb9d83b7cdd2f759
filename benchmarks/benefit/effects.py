"""The cases: a true truck with an effect, the old simulator without it, its drives, and the scenes in which
it matters.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import HARD, settled
from deeptruck_cacc.environments.scenes import Drawer, Scene
from deeptruck_model import trucks
from deeptruck_model.constants import ROUNDED_GRAVITY
from deeptruck_model.trucks import CommandFilter, Force, PhysicsTruck, View
from deeptruck_model.trucks.driving_cycles import CycleSettings, RoadSettings, SpeedSettings

Array = NDArray[np.float64]


class UnsensedRoad:
    """A road that climbs 3 % on average, 2 to 4 %, on a truck without a grade sensor."""

    def reset(self, batch: int) -> None:
        """No state: the position of the truck determines the slope."""

    def force(self, view: View, dt: float) -> Array:
        """Force of the slope, N, positive forward."""
        x = 2 * np.pi * view.distance
        slope = 0.030 + 0.007 * np.sin(x / 900.0) + 0.003 * np.sin(x / 2300.0 + 1.0)
        return np.asarray(-view.mass * ROUNDED_GRAVITY * slope)


class SlowBrake:
    """The brakes follow their command with a time constant of 0.8 s on top of their own."""

    def reset(self, batch: int) -> None:
        """Start with the brakes off."""
        self._arrived = np.zeros(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        """Commands (batch, 2) as they take effect."""
        self._arrived += (u[:, 1] - self._arrived) * (1 - np.exp(-dt / 0.8))
        return np.column_stack([u[:, 0], self._arrived])


class LateEngine:
    """The engine gets its command 0.6 s late."""

    def reset(self, batch: int) -> None:
        """No command is in the delay line."""
        self._under_way: list[Array] = []

    def filter(self, u: Array, time: float, dt: float) -> Array:
        """Commands (batch, 2) as they take effect."""
        self._under_way.append(u[:, 0].copy())
        arrived = self._under_way[0]
        if len(self._under_way) > round(0.6 / dt):
            self._under_way.pop(0)
        return np.column_stack([arrived, u[:, 1]])


def downhill(draw: Drawer) -> Drawer:
    """The same scenes on a steady descent of 2 to 5 %."""

    def drawn(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
        scene = draw(rng, batch, steps, dt)
        return replace(scene, grade=np.tile(-rng.uniform(0.02, 0.05, (batch, 1)), (1, steps)))

    return drawn


# The trainer finds its scenes by name.
scenes.DRAWERS.update(wide_downhill=downhill(scenes.wide), moving_downhill=downhill(scenes.moving))


def hot_stop(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """Five minutes down a slope of 5 % behind a steady leader, which then brakes at -6 m/s2 to standstill."""
    scene = settled(batch, steps, rng.uniform(12.0, 18.0, batch), 2.5)
    braking = np.arange(steps) * dt >= 300.0 + rng.uniform(0.0, 10.0, (batch, 1))
    return replace(
        scene, grade=np.full((batch, steps), -0.05), leader_acceleration=np.where(braking, -6.0, 0.0)
    )


TESTS: dict[str, tuple[Drawer, float]] = {
    "moving": HARD["moving"],
    "moving_downhill": (downhill(scenes.moving), 300.0),
    "stop": HARD["stop"],
    "hot_stop": (hot_stop, 340.0),
}
STOPS = ("stop", "hot_stop")  # driven behind the shield: bare policies close up to a leader that stands


@dataclass(frozen=True)
class Case:
    """One effect. `drives` and `least_descent` say how the truck was recorded, `tests` in which scenes the
    effect matters.

    `suffix` chooses the training scenes (wide + suffix, moving + suffix), `windows` their length in windows
    of 20 s: hot brakes need minutes. Cases with the same `old_name` share the policies of one old simulator.
    """

    says: str
    truck: PhysicsTruck
    old: PhysicsTruck
    old_name: str
    tests: tuple[str, ...] = ("moving",)
    drives: CycleSettings = field(default_factory=CycleSettings)
    least_descent: float = -1.0
    suffix: str = ""
    windows: int = 2


def _with(truck: PhysicsTruck, *forces: Force, filters: tuple[CommandFilter, ...] = ()) -> PhysicsTruck:
    return truck.with_forces(forces, filters)


def _without_grade_sensor(truck: PhysicsTruck) -> PhysicsTruck:
    interface = replace(truck.interface, grade=False)
    return PhysicsTruck(replace(truck.specification, interface=interface))


_FLAT = CycleSettings(road=RoadSettings(limit=0.0))
_DESCENTS = CycleSettings(
    speed=SpeedSettings(v_min=8.0, v_max=20.0, mu_T=60.0, sigma_T=20.0, soft_limit_speed=30.0),
    road=RoadSettings(limit=0.06, step=0.0002),
    coasting_share=0.03,
    braking_share=0.1,
    engine_brake_share=0.0,
)


def _cases() -> dict[str, Case]:
    plain = trucks.load("trucksim")
    blind, cold = _without_grade_sensor(plain), plain.with_parameters({"brake_fade": 0.0})
    hot = plain.with_parameters({"brake_fade": 0.003, "fade_temperature": 80.0})
    return {
        "road_grade": Case(
            "a road that climbs 3 %, no grade sensor",
            _with(blind, UnsensedRoad()), blind, "trucksim without grade sensor", drives=_FLAT,
        ),
        "brake_fade": Case(
            "brakes that lose 0.3 % a kelvin above 80 °C",
            hot, cold, "trucksim without fade", ("moving_downhill", "hot_stop"),
            _DESCENTS, 0.015, "_downhill", 12,
        ),
        "payload": Case(
            "36 t instead of 20 t",
            plain.with_parameters({"mass": 36e3}), plain, "trucksim", ("moving", "stop"),
        ),
        "brake_lag": Case(
            "brakes that answer 0.8 s later",
            _with(plain, filters=(SlowBrake(),)), plain, "trucksim", ("moving", "stop"),
        ),
        "command_delay": Case(
            "an engine that gets its commands 0.6 s late",
            _with(plain, filters=(LateEngine(),)), plain, "trucksim", ("moving", "stop"),
        ),
    }  # fmt: skip


CASES: dict[str, Case] = _cases()
