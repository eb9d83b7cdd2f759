"""Road map node: publishes the grade ahead of the truck, from a profile over the distance driven in
the run.
"""

from __future__ import annotations

from geometry_msgs.msg import TwistStamped

from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M
from deeptruck_nodes import messages, roads
from deeptruck_nodes.messages import SECOND, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run
from deeptruck_nodes.topics import ROAD_AHEAD, TWIST

EVERY = SECOND * 9 // 100  # ns of stamps between two messages, at least: they come 10 times a second


class RoadMap(DeeptruckNode):
    """Integrates the truck's speed to a position on the profile, and publishes the grades ahead of it."""

    def __init__(self) -> None:
        super().__init__("road_map")
        self._road = roads.parse_known(self.p["road"])
        self._position = self.p["start_m"]
        self._last: tuple[int, float] | None = None  # stamp and speed
        self._due = 0
        self._ahead = self.publish_on(ROAD_AHEAD)
        self.listen_to(TWIST, self._on_twist)

    def _on_twist(self, message: TwistStamped) -> None:
        stamp, speed = nanoseconds(message.header.stamp), message.twist.linear.x
        before, was = self._last or (stamp, speed)
        if stamp < before:
            return
        if speed == speed:
            self._position += 0.5 * (speed + was) * (stamp - before) / SECOND
            self._last = stamp, speed
        if stamp < self._due:
            return
        self._due = stamp + EVERY
        grades = [self._road.at(self._position + AHEAD_M * k)[0] for k in range(AHEAD)]
        self._ahead.publish(messages.road_ahead(stamp, grades, AHEAD_M))
        self.diagnose(stamp, "ok", "the road ahead is known", {"position_m": self._position})


def main() -> None:
    """Entry point of the process."""
    run(RoadMap)


if __name__ == "__main__":
    main()
