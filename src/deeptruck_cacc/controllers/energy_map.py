"""Acceleration and fuel rate for each pedal at steady speed, measured on a simulator of the truck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.controllers.signed_pedal import pedal_commands
from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.imports.compiler import numba
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED
from deeptruck_model.simulators import Simulator

SPEEDS: Array = np.arange(3.0, 33.5, 1.0, dtype=float)  # m/s
GRADES: Array = np.arange(-0.08, 0.085, 0.02, dtype=float)  # rise over run
# Signed pedals: 1 full engine, -1 full brake; closer where trucks cruise.
PEDALS = np.array(
    [-1.0, -0.5, -0.25, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0]
)
SETTLE_S, MEASURE_S = 4.0, 2.0
PRICE_SPAN = 2.0  # m/s to either side, over which a gear change does not count
PRICE_PEDALS = (0.1, 0.4)

compiled: Any = numba.njit(cache=True, error_model="numpy")


@dataclass(frozen=True)
class EnergyMap:
    """Tables (grade, speed, pedal) over GRADES, SPEEDS and PEDALS of the settled acceleration (m/s^2), which
    increases with the pedal, and of the fuel rate (cm^3/s)."""

    acceleration: Array
    fuel: Array

    @classmethod
    def measure(cls, simulator: Simulator) -> EnergyMap:
        """Hold each pedal at each speed and grade until gear and boost have settled.

        A simulator without grade input is measured on the flat, and the effect of slopes is added by gravity.
        Raises InputError for one without fuel.
        """
        interface = simulator.interface
        if not interface.fuel:
            raise InputError(
                f"the simulator of {interface.name} has no fuel, so that none can be saved by it; "
                "train one with recordings of the fuel rate, or leave out ?economy"
            )
        scale = ActionScale.of(simulator)
        grades = GRADES if interface.grade else np.zeros(1)
        grade, speed, pedal = (x.ravel() for x in np.meshgrid(grades, SPEEDS, PEDALS, indexing="ij"))
        u = pedal_commands(scale, pedal)[:, : len(interface.u)]
        w = np.full((len(u), len(interface.w)), np.nan)
        if interface.grade:
            w[:, interface.w.index("grade")] = grade
        y = np.full((len(u), len(interface.y)), np.nan)
        y[:, ACCELERATION], y[:, SPEED], y[:, FUEL] = 0.0, speed, 0.0
        held = np.full_like(y, np.nan)
        held[:, SPEED] = speed
        state, seen = simulator.reset(y), []
        for _ in range(round((SETTLE_S + MEASURE_S) / simulator.dt)):
            state, y = simulator.step(state, u, w)
            state = simulator.force(state, held)
            seen.append(y)
        mean = np.mean(seen[round(SETTLE_S / simulator.dt) :], axis=0)
        shape = (len(grades), len(SPEEDS), len(PEDALS))
        acceleration, fuel = mean[:, ACCELERATION].reshape(shape), mean[:, FUEL].reshape(shape)
        if not interface.grade:
            acceleration = acceleration - ROUNDED_GRAVITY * GRADES[:, None, None]
            fuel = np.repeat(fuel, len(GRADES), axis=0)
        # Where more pedal gives less, as in a learned truck or for another gear, it counts as giving nothing;
        # nor does less pedal take more fuel: a learned truck may say so of brakes that it was never held by.
        rising = np.maximum.accumulate(acceleration, axis=2) + 1e-6 * np.arange(len(PEDALS))
        least = np.minimum.accumulate(np.maximum(fuel, 0.0)[:, :, ::-1], axis=2)[:, :, ::-1]
        return cls(rising, _convex(rising, least))

    def rows(self, speed: Array, grade: Array) -> tuple[Array, Array]:
        """Acceleration (m/s^2) and fuel rate (cm^3/s) for each of PEDALS, (batch, pedals), at speed (m/s) and
        grade (batch,)."""
        return _rows(self.acceleration, speed, grade), _rows(self.fuel, speed, grade)

    def prices(self, speed: Array) -> tuple[Array, Array]:
        """Fuel values of one second (cm^3/s) and of 1 m/s (cm^3), (batch,), for which cruising on the flat at
        the given speed (batch,) would be optimal."""
        fuel_per_m = []
        for near in (speed - PRICE_SPAN, speed + PRICE_SPAN):
            acceleration, fuel = self.rows(near, np.zeros(len(near)))
            holding = [np.interp(0.0, a, f) for a, f in zip(acceleration, fuel, strict=True)]
            fuel_per_m.append(np.array(holding) / near)
        time = speed**2 * (fuel_per_m[1] - fuel_per_m[0]) / (2 * PRICE_SPAN)
        acceleration, fuel = self.rows(speed, np.zeros(len(speed)))
        low, high = np.searchsorted(PEDALS, PRICE_PEDALS)
        momentum = (fuel[:, high] - fuel[:, low]) / (acceleration[:, high] - acceleration[:, low])
        return np.maximum(time, 0.0), momentum


def _convex(acceleration: Array, fuel: Array) -> Array:
    """The lower convex hull of fuel over acceleration, (grade, speed, pedal).

    The gear at a pedal position depends on the past; the hull assumes the better one, because a programme
    with steps in fuel would alternate across them.
    """
    hull = np.empty_like(fuel)
    for index in np.ndindex(fuel.shape[:2]):
        x, y = acceleration[index], fuel[index]
        on: list[int] = []
        for k in range(len(x)):
            while len(on) > 1 and _above(x, y, on[-2], on[-1], k):
                on.pop()
            on.append(k)
        hull[index] = np.interp(x, x[on], y[on])
    return hull


def _above(x: Array, y: Array, before: int, between: int, after: int) -> bool:
    """Whether a point lies on or above the line through its neighbours."""
    rise = (y[between] - y[before]) * (x[after] - x[before])
    return bool(rise >= (y[after] - y[before]) * (x[between] - x[before]))


@compiled
def at(table: Array, grade: float, speed: float, pedal: int) -> float:
    """A table interpolated linearly in grade and speed, constant beyond their ends, for the pedal of an
    index."""
    a = min(max((grade - GRADES[0]) / (GRADES[1] - GRADES[0]), 0.0), len(GRADES) - 1.0)
    b = min(max((speed - SPEEDS[0]) / (SPEEDS[1] - SPEEDS[0]), 0.0), len(SPEEDS) - 1.0)
    i, j = min(int(a), len(GRADES) - 2), min(int(b), len(SPEEDS) - 2)
    a, b = a - i, b - j
    flatter = (1.0 - b) * table[i, j, pedal] + b * table[i, j + 1, pedal]
    return float(
        (1.0 - a) * flatter + a * ((1.0 - b) * table[i + 1, j, pedal] + b * table[i + 1, j + 1, pedal])
    )


@compiled
def _rows(table: Array, speed: Array, grade: Array) -> Array:
    found = np.empty((len(speed), len(PEDALS)))
    for row in range(len(speed)):
        for pedal in range(len(PEDALS)):
            found[row, pedal] = at(table, grade[row], speed[row], pedal)
    return found
