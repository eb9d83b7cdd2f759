"""Truck node: any simulator that `simulators.load` can load, in real time or in lock-step with its
controller.
"""

from __future__ import annotations

import math
import time

from sensor_msgs.msg import JointState

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_nodes import messages, roads
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.node import IDLE, DeeptruckNode, run
from deeptruck_nodes.plant import Plant, ticks_a_step
from deeptruck_nodes.topics import ACCEL, CLOCK, COMMAND, ENGAGED, IMU, ROAD, STATUS, TWIST

CLOCK_SET = SECOND // 10  # a larger change of the system clock against the monotonic one was made by somebody
FIRST_STAMP = 1 * SECOND  # of a lock-step run; 0 means "no time yet" to ROS


class TruckSim(DeeptruckNode):
    """Publishes the truck at every tick; the last command received before a step drives that step."""

    def __init__(self) -> None:
        super().__init__("truck_sim")
        simulator = simulators.load(self.p["simulator"])
        self._plant = Plant(simulator, roads.parse(self.p["road"]), self.p["initial_speed"])
        self._ticks_a_step = 1 if self.lockstep else ticks_a_step(self.p["rate_hz"], self._plant.dt)
        self._period = round(self._plant.dt * SECOND / self._ticks_a_step)
        self._last_tick = round(self.p["duration_s"] * SECOND / self._period) or math.inf
        self._tick = 0
        self._command = (0.0, 0.0, math.nan, math.inf)  # engine, brake, the brake to go on with, for how long
        self._commanded_at = time.monotonic()
        self._answered = -1  # stamp of the newest command
        self._coasting = False
        self._latest_by = 0.0
        self._twist, self._accel = self.publish_on(TWIST), self.publish_on(ACCEL)
        self._imu = self.publish_on(IMU)
        self._status, self._road = self.publish_on(STATUS), self.publish_on(ROAD)
        self._engaged = self.publish_on(ENGAGED)
        self._clock = self.publish_on(CLOCK) if self.lockstep else None
        self.listen_to(COMMAND, self._on_command)

    def begin(self) -> None:
        self._first_stamp = FIRST_STAMP if self.lockstep else self.now()
        self._started = self._commanded_at = time.monotonic()
        self._publish()

    def tick(self) -> float:
        return self._await_command() if self.lockstep else self._keep_time()

    def _await_command(self) -> float:
        """Lock-step: the next step is taken when the command for this one has arrived."""
        if self._answered == self._stamp:
            self._advance()
            return 0.0 if self._answered == self._stamp else IDLE
        patience = 20 * self.p["command_timeout_s"]
        if time.monotonic() - self._published_at > patience:
            raise InputError(
                f"no command for the step at {self._seconds:.1f} s within {patience:g} s; ask the controller"
            )
        return IDLE

    def _keep_time(self) -> float:
        due = self._started + (self._tick + 1) * self._period / SECOND
        late = time.monotonic() - due
        if late < 0:
            return -late
        self._latest_by = max(self._latest_by, late)
        if time.monotonic() - self._commanded_at > self.p["command_timeout_s"]:
            self._command, self._coasting = (math.nan, math.nan, math.nan, math.inf), True
        self._follow_clock()
        self._advance()
        return 0.0

    def _follow_clock(self) -> None:
        """Move the stamps with the system clock if it was set, as those of real sensors do."""
        set_by = self.now() - self._first_stamp - round((time.monotonic() - self._started) * SECOND)
        if abs(set_by) > CLOCK_SET:
            self._first_stamp += set_by

    def _advance(self) -> None:
        if self._tick % self._ticks_a_step == 0:
            self._plant.step(*self._command)
        self._tick += 1
        self._publish()
        self.finished = self._tick >= self._last_tick

    @property
    def _stamp(self) -> int:
        return self._first_stamp + self._tick * self._period

    @property
    def _seconds(self) -> float:
        return self._tick * self._period / SECOND

    def _publish(self) -> None:
        self._published_at = time.monotonic()
        stamp, within = self._stamp, self._tick % self._ticks_a_step
        if self._clock is not None:
            self._clock.publish(messages.clock(stamp))
        speed = self._plant.speed_at(within / self._ticks_a_step) if within else self._plant.speed
        self._twist.publish(messages.twist(stamp, speed, "truck"))  # first: the radar waits for it
        self._engaged.publish(messages.scalars(stamp, ENGAGED.fields, {"engaged": 1.0}))
        if within == 0:
            road = {"elevation": self._plant.elevation}
            if self._plant.interface.grade:
                road["grade"] = self._plant.grade
            self._road.publish(messages.scalars(stamp, ROAD.fields, road))
            self._status.publish(messages.scalars(stamp, STATUS.fields, self._plant.status()))
        self._accel.publish(messages.accel(stamp, self._plant.acceleration))
        self._imu.publish(messages.imu(stamp, self._plant.specific_force))
        self._report(stamp)

    def _report(self, stamp: int) -> None:
        level, says = ("warn", "no command: coasting") if self._coasting else ("ok", "driving")
        if self._plant.stopping:
            level, says = "error", "no command while it braked for a hazard: braking to a standstill"
        worst = {} if self.lockstep else {"worst_lateness_s": self._latest_by}
        values = {"time_s": self._seconds, "distance_m": self._plant.distance, **worst}
        self.diagnose(stamp, level, says, values)

    def _on_command(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        engine, brake = values.get("engine_command", math.nan), values.get("brake_command", 0.0)
        self._coasting = not (math.isfinite(engine) and math.isfinite(brake))  # NaN: the controller has none
        self._command = (engine, brake, values.get("hold_brake", math.nan), values.get("hold_s", math.inf))
        self._answered = messages.nanoseconds(message.header.stamp)
        self._commanded_at = time.monotonic()


def main() -> None:
    """Entry point of the process."""
    run(TruckSim)


if __name__ == "__main__":
    main()
