"""A single simulated truck on a road, with values between two of its steps."""

from __future__ import annotations

import math

import numpy as np

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.truck_limits import known
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks.accelerometer import Accelerometer
from deeptruck_nodes.roads import Road
from truck_bridge.safety.ending import SLOW_M_S, STANDS_M_S, BrakeHold

FADE_S = 1.0  # in which a command that is lost runs out, as the bridge fades the engine by 100 % a second


class Plant:
    """State, response and position of the truck. SI units; commands in the units of the truck interface."""

    def __init__(self, simulator: Simulator, road: Road, initial_speed: float) -> None:
        self._simulator, self._road = simulator, road
        self.interface, self.dt = simulator.interface, simulator.dt
        self._y = np.zeros((1, len(self.interface.y)))
        self._y[0, SPEED] = initial_speed
        self._state = simulator.reset(self._y)
        idle = np.zeros((1, len(self.interface.u))), np.zeros((1, len(self.interface.w)))
        simulator.step(self._state, *idle)  # compiles what is compiled, before anybody waits for it
        self._held, self._left = (0.0, 0.0), 1.0  # the last command, and the share of it that still counts
        limits = known(simulator.interface, simulator.parameters()) or Assumptions()
        share = float(limits.share_of(limits.yielding))  # beyond it only the shield brakes
        self._hold = BrakeHold({"brake": share * ActionScale.of(simulator).brake_high or math.inf})
        self.stopping = False  # braking to a standstill without a command
        self._time = 0.0
        self.distance = 0.0
        self.grade, self.elevation = road.at(0.0)
        self._accelerometer = Accelerometer(seed=0)
        self.specific_force = self._read_accelerometer()

    def _read_accelerometer(self) -> float:
        """What its accelerometer reads, m/s^2; a simulator that takes no slope drives on a level road."""
        return self._accelerometer.reads(self.acceleration, self.grade if self.interface.grade else 0.0)

    @property
    def speed(self) -> float:
        return float(self._y[0, SPEED])

    @property
    def acceleration(self) -> float:
        """Mean acceleration over the last step, m/s^2."""
        return float(self._y[0, ACCELERATION])

    def step(
        self,
        engine_command: float,
        brake_command: float,
        hold_brake: float = math.nan,
        hold_s: float = math.inf,
    ) -> None:
        """Advance by dt under a held command; without one (NaN) the last one fades to nothing in FADE_S.

        Braking for a hazard, by `hold_brake` or what was commanded last, goes on without a command for
        `hold_s`, and holds the truck that stands then until the next command.
        """
        before, given = self.speed, (engine_command, brake_command)
        valid = math.isfinite(engine_command + brake_command)
        needs = {"brake": hold_brake} if math.isfinite(hold_brake) else {}
        self._time += self.dt
        if valid or needs:
            self._hold.know(needs, self._time + hold_s)
        moves, known = before > STANDS_M_S, self._hold.knows(self._time)
        if self.stopping and before >= SLOW_M_S and not known:
            self._held, self._left, self.stopping = (0.0, self._hold.demands["brake"]), 1.0, False
        if valid and not (self.stopping and moves):
            self._held, self._left, self.stopping = given, 1.0, False
        else:
            if known and not self.stopping:
                self._hold.begin({"brake": self._held[1]})
                self.stopping = True
            self._left = max(self._left - self.dt / FADE_S, 0.0)
        brake = self._hold.rise("brake", brake_command) if self.stopping else self._left * self._held[1]
        u = np.array([(self._left * self._held[0], brake)[: len(self.interface.u)]])
        w = np.full((1, len(self.interface.w)), self.grade)
        self._state, self._y = self._simulator.step(self._state, u, w)
        self.distance += (before + self.speed) / 2 * self.dt
        self.grade, self.elevation = self._road.at(self.distance)
        self.specific_force = self._read_accelerometer()

    def speed_at(self, share: float) -> float:
        """Speed after `share` (0..1] of the last step, linear in time because the acceleration is its
        mean."""
        return self.speed - self.acceleration * (1.0 - share) * self.dt

    def status(self) -> dict[str, float]:
        """fuel_rate, gear, engine_speed and engine_torque, if the simulator has them."""
        seen = {name: float(values[0]) for name, values in self._simulator.inside(self._state).items()}
        seen["fuel_rate"] = float(self._y[0, FUEL]) if self.interface.fuel else math.nan
        return seen


def ticks_a_step(rate: float, dt: float) -> int:
    """Publishing ticks per simulator step. Raises InputError unless it is a whole number."""
    ticks = round(rate * dt)
    if ticks < 1 or abs(ticks - rate * dt) > 1e-9:
        raise InputError(
            f"truck_sim: rate_hz = {rate:g} is not a whole multiple of the simulator's {1 / dt:g} Hz"
        )
    return ticks
