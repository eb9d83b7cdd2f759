"""Pedal map: engine and brake commands for a requested acceleration; used by every classical baseline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model.simulators import Simulator


@dataclass(frozen=True)
class PedalMap:
    """Acceleration due to each command on a flat road, tabulated over speed (n,) and interpolated linearly
    between no command and full command.

    `coast` is the acceleration without commands, `full` at the highest engine command, `brake` at full brake.
    The nominal map is that of a 20 t truck of 300 kW whose gearbox keeps the engine near its best speed.
    """

    speed: Array
    coast: Array
    full: Array
    brake: Array
    scale: ActionScale

    @classmethod
    def nominal(cls, interface: TruckInterface) -> PedalMap:
        """A generic truck, for use before a simulator of the real one exists."""
        speed = np.linspace(0.0, 35.0, 36)
        mass, power, force = 20e3, 270e3, 60e3
        resistance = 0.006 * ROUNDED_GRAVITY + 0.5 * 1.2 * 6.0 * speed**2 / mass
        full = np.minimum(power / np.maximum(speed, 1.0), force) / mass - resistance
        return cls(speed, -resistance - 0.1, full, -resistance - 4.5, ActionScale.of(interface))

    @classmethod
    def calibrate(cls, simulator: Simulator, *, settle_s: float = 4.0) -> PedalMap:
        """Measure the tables: hold each pedal from each speed and use the settled acceleration."""
        scale = ActionScale.of(simulator)
        speed: Array = np.arange(2.0, 33.0, 2.0, dtype=float)
        pedals = np.array(
            [[scale.engine_low, 0.0], [scale.engine_high, 0.0], [scale.engine_low, scale.brake_high]]
        )
        u = np.repeat(pedals, len(speed), axis=0)[:, : len(simulator.interface.u)]
        y0 = np.zeros((len(u), len(simulator.interface.y)))
        y0[:, SPEED] = np.tile(speed, len(pedals))
        state, w = simulator.reset(y0), np.zeros((len(u), len(simulator.interface.w)))
        warm, count = int(1.0 / simulator.dt), int(settle_s / simulator.dt)
        speeds = [y0[:, SPEED]]
        for _ in range(count):
            state, y = simulator.step(state, u, w)
            speeds.append(y[:, SPEED])
        rate = _settled_rate(np.array(speeds), warm, simulator.dt)
        coast, full, brake = rate.reshape(len(pedals), -1)
        return cls(speed, coast, np.maximum(full, coast + 0.05), np.minimum(brake, coast - 0.05), scale)

    def commands(self, acceleration: Array, speed: Array, grade: Array) -> tuple[Array, Array]:
        """(engine_command, brake_command), each (batch,), for a requested acceleration on a grade."""
        wanted = acceleration + ROUNDED_GRAVITY * grade
        coast, full, brake = (np.interp(speed, self.speed, t) for t in (self.coast, self.full, self.brake))
        throttle = np.clip((wanted - coast) / (full - coast), 0.0, 1.0)
        braking = np.clip((wanted - coast) / (brake - coast), 0.0, 1.0)
        reach = self.scale.engine_high - self.scale.engine_low
        return self.scale.engine_low + throttle * reach, braking * self.scale.brake_high


def _settled_rate(speed: Array, warm: int, dt: float) -> Array:
    """Mean rate of each column of speed (T, n) from sample `warm` to its last moving sample.

    A column that has stopped by then gets the rate of the next faster one that has not.
    """
    moving = np.cumprod(speed > 0.5, axis=0).sum(axis=0) - 1
    rows = np.arange(speed.shape[1])
    usable = moving >= warm + 3
    last = np.where(usable, moving, warm + 1)
    rate = (speed[last, rows] - speed[warm, rows]) / ((last - warm) * dt)
    faster = np.minimum.accumulate(np.where(usable, rows, len(rows) - 1)[::-1])[::-1]
    return np.asarray(rate[faster])
