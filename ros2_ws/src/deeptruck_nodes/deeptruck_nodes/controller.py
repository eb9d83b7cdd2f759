"""The controller: a policy fed by radar and truck, answering every radar sample with a command."""

from __future__ import annotations

import json
import math
import time

import numpy as np
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState, Range

from deeptruck_cacc import load_policy
from deeptruck_model.signals import TruckInterface
from deeptruck_nodes import messages
from deeptruck_nodes.messages import SECOND, nanoseconds
from deeptruck_nodes.node import IDLE, DeeptruckNode, run
from deeptruck_nodes.observation import Alignment, Observation
from deeptruck_nodes.topics import COMMAND, RADAR_RANGE, RADAR_TWIST, ROAD, TWIST


class Controller(DeeptruckNode):
    """The policy acts every `dt` of stamps; in between its command is repeated. Stale inputs: silence."""

    def __init__(self) -> None:
        super().__init__("controller")
        interface = TruckInterface.from_dict(json.loads(self.p["interface"])) if self.p["interface"] else None
        self._policy = load_policy(self.p["policy"], interface)
        self._policy.reset()
        self._samples = Alignment(self.lockstep, self.p["uses_grade"], self.p["bridge_dropouts_s"])
        self._period = round(self._policy.dt * SECOND)
        self._acts_from = 0
        self._held = (0.0, 0.0)
        self._heard = {"radar": -math.inf, "speed": -math.inf}  # monotonic, s
        self._refused = 0
        self._command = self.publish_on(COMMAND)
        self.listen_to(ROAD, self._on_road)
        self.listen_to(RADAR_RANGE, self._on_range)
        self.listen_to(RADAR_TWIST, self._on_radar_twist)
        self.listen_to(TWIST, self._on_twist)

    def tick(self) -> float:
        silent = [name for name in self._heard if self._is_stale(name)]
        if silent and not self.lockstep:
            says = f"no {' and '.join(silent)}: no command is sent"
            self.diagnose(self.now(), "error", says, {"refused": self._refused})
        return IDLE

    def _is_stale(self, name: str) -> bool:
        return time.monotonic() - self._heard[name] > self.p["stale_after_s"]

    def _on_road(self, message: JointState) -> None:
        grade = messages.read_scalars(message).get("grade", math.nan)
        self._take("grade", nanoseconds(message.header.stamp), grade)

    def _on_range(self, message: Range) -> None:
        self._take("gap", nanoseconds(message.header.stamp), message.range)

    def _on_radar_twist(self, message: TwistStamped) -> None:
        self._heard["radar"] = time.monotonic()
        self._take("leader_speed", nanoseconds(message.header.stamp), message.twist.linear.x)

    def _on_twist(self, message: TwistStamped) -> None:
        speed = message.twist.linear.x
        if math.isfinite(speed):
            self._heard["speed"] = time.monotonic()
            self._take("speed", nanoseconds(message.header.stamp), speed)

    def _take(self, name: str, stamp: int, value: float) -> None:
        observation = self._samples.put(name, stamp, value)
        if observation is None or (not self.lockstep and self._is_stale("speed")):
            return
        if observation.stamp >= self._acts_from:
            self._acts_from = observation.stamp + self._period * 9 // 10  # stamps may jitter
            self._held = self._act(observation)
        if all(map(math.isfinite, self._held)):
            values = dict(zip(COMMAND.fields, self._held, strict=True))
            self._command.publish(messages.scalars(observation.stamp, COMMAND.fields, values))
        level, says = ("ok", "following") if observation.lead else ("warn", "nothing ahead: coasting")
        self.diagnose(observation.stamp, level, says, {"refused": self._refused, "gap_m": observation.gap})

    def _act(self, seen: Observation) -> tuple[float, float]:
        """The policy's command; NaN is refused, counted and never sent. Without a lead the truck coasts."""
        if not seen.lead:
            self._policy.reset()
            return 0.0, 0.0
        numbers = {
            "leader_speed": seen.leader_speed,
            "speed": seen.speed,
            "gap": seen.gap,
            "target_time_gap": self.p["target_time_gap"],
            "grade": seen.grade,
        }
        engine, brake = self._policy.act({name: np.array([value]) for name, value in numbers.items()})
        command = float(np.ravel(engine)[0]), float(np.ravel(brake)[0])
        self._refused += not all(map(math.isfinite, command))
        return command


def main() -> None:
    """Entry point of the process."""
    run(Controller)


if __name__ == "__main__":
    main()
