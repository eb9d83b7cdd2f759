"""Node of the vehicle ahead and the radar: answers every truck speed with a radar sample."""

from __future__ import annotations

import dataclasses
import math

from geometry_msgs.msg import TwistStamped

from deeptruck_nodes import leaders, messages
from deeptruck_nodes.messages import SECOND, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run, say
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from deeptruck_nodes.topics import LEADER_STATE, RADAR_RANGE, RADAR_TWIST, TWIST


class LeaderNode(DeeptruckNode):
    """Simulates the leader and the radar. A radar sample has the stamp of the truck speed from which it was
    computed."""

    def __init__(self) -> None:
        super().__init__("leader")
        leader = leaders.parse(self.p["profile"])
        self._gap = Gap(leader, self.p["initial_gap"], self.p["initial_time_gap"])
        names = [field.name for field in dataclasses.fields(RadarErrors)]
        self._radar = Radar(RadarErrors(**{name: self.p[name] for name in names}), self.p["seed"])
        self._first: int | None = None
        self._smallest = math.inf
        self._state = self.publish_on(LEADER_STATE)
        self._range, self._twist = self.publish_on(RADAR_RANGE), self.publish_on(RADAR_TWIST)
        self.listen_to(TWIST, self._on_twist)

    def _on_twist(self, message: TwistStamped) -> None:
        stamp = nanoseconds(message.header.stamp)
        self._first = stamp if self._first is None else self._first
        t = (stamp - self._first) / SECOND
        self._gap.update(t, message.twist.linear.x)
        gap, speed = self._radar.sense(t, self._gap.gap, self._gap.leader_speed)
        self._range.publish(messages.radar_range(stamp, gap, self.p["reach"]))
        self._twist.publish(messages.twist(stamp, speed, "radar"))
        true = {"true_gap": self._gap.gap, "true_leader_speed": self._gap.leader_speed}
        self._state.publish(messages.scalars(stamp, LEADER_STATE.fields, true))
        self._report(stamp)

    def _report(self, stamp: int) -> None:
        self._smallest = min(self._smallest, self._gap.gap)
        level, says = "ok", "driving ahead"
        if self._smallest <= 0:
            level, says = "error", "the truck has hit the leader"
        self.diagnose(stamp, level, says, {"smallest_gap_m": self._smallest})

    def close(self) -> None:
        if math.isfinite(self._smallest):
            hit = ": the truck hit the leader" if self._smallest <= 0.0 else ""
            say(f"smallest gap {max(0.0, self._smallest):.1f} m{hit}")


def main() -> None:
    """Entry point of the process."""
    run(LeaderNode)


if __name__ == "__main__":
    main()
