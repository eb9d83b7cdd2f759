"""Live page: shows the run in a browser on this machine.

It publishes only /replay/control, when a viewer moves or pauses a replay. It polls ten times a second instead
of waking up for every message, and subscribes as best effort, so that a slow or stopped page delays no
publisher.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import CallbackGroup
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from deeptruck_core.signals import TruckInterface
from deeptruck_nodes import messages, page_server
from deeptruck_nodes.environment import ENDED
from deeptruck_nodes.messages import LEVELS, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run
from deeptruck_nodes.topics import (
    BEST_EFFORT_QOS,
    COMMAND,
    COUNTED,
    DIAGNOSTICS,
    ENGAGED,
    RADAR_RANGE,
    RADAR_TWIST,
    REPLAY_CONTROL,
    REPLAY_STATE,
    TWIST,
    Topic,
)

EVERY = 0.1  # s between two batches
SAMPLED: tuple[tuple[Topic, Callable[[Any], dict[str, float]]], ...] = (
    (TWIST, lambda m: {"speed": m.twist.linear.x}),
    (RADAR_TWIST, lambda m: {"leader_speed": m.twist.linear.x}),
    (RADAR_RANGE, lambda m: {"gap": messages.detected(m)}),
    (COMMAND, lambda m: dict(zip(m.name[:2], m.position[:2], strict=True))),
    (ENGAGED, lambda m: {"engaged": m.position[0]}),
)
LEVEL_NAMES = {value: name for name, value in LEVELS.items()}


class _Polled(CallbackGroup):
    """Subscriptions that the executor ignores."""

    def can_execute(self, entity: object) -> bool:
        return False


class LivePage(DeeptruckNode):
    """The node. It subscribes only once the run has started, so that publishers waiting for their listeners
    do not count the page among them."""

    def __init__(self) -> None:
        super().__init__("live_page")
        listener, token = page_server.inherited() or self._opened()
        units = {}
        if self.p["interface"]:
            interface = TruckInterface.from_dict(json.loads(self.p["interface"]))
            units = {name: interface.unit(name) for name in interface.u}
        self._view = page_server.View({"title": self.p["title"], "units": units}, COUNTED)
        self._control = self.publish_on(REPLAY_CONTROL)
        self._server = page_server.Server(listener, token, self._view, self._ask)
        self._polled: list[tuple[Subscription, Callable[[Any], None]]] = []
        self._due = 0.0
        self._server.start()

    def _opened(self) -> tuple[Any, str]:
        """An address for a page that was started by hand, printed."""
        listener, token = page_server.opened(self.p["port"])
        print(f"page: {page_server.address(listener, token)}", flush=True)
        return listener, token

    def _ask(self, asked: dict[str, float]) -> None:
        self._control.publish(messages.scalars(self.now(), REPLAY_CONTROL.fields, asked))

    def begin(self) -> None:
        group = _Polled()
        for topic, values in SAMPLED:
            self._poll(topic, partial(self._on_sample, values), group)
        self._poll(DIAGNOSTICS, self._on_diagnostics, group)
        self._poll(REPLAY_STATE, self._on_replay_state, group)

    def _poll(self, topic: Topic, read: Callable[[Any], None], group: CallbackGroup) -> None:
        subscription = self.create_subscription(
            topic.message, topic.name, lambda _: None, BEST_EFFORT_QOS, callback_group=group
        )
        self._polled.append((subscription, read))

    def tick(self) -> float:
        now = time.monotonic()
        if now >= self._due:
            self._due = now + EVERY
            self._read()
            self._view.publish()
        return self._due - time.monotonic()

    def _read(self) -> None:
        """Read every message that waits."""
        for subscription, read in self._polled:
            with subscription.handle:
                for _ in range(BEST_EFFORT_QOS.depth):
                    if (taken := subscription.handle.take_message(subscription.msg_type, False)) is None:
                        break
                    read(taken[0])

    def _on_sample(self, values: Callable[[Any], dict[str, float]], message: Any) -> None:
        self._view.sample(nanoseconds(message.header.stamp), values(message))

    def _on_replay_state(self, message: JointState) -> None:
        self._view.replay = messages.read_scalars(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        stamp = nanoseconds(message.header.stamp)
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            level = LEVEL_NAMES.get(status.level, "error")
            self._view.report(stamp, status.hardware_id, level, status.message, values)

    def close(self) -> None:
        self._read()
        self._server.close(self._why())

    def _why(self) -> str:
        """The start script's reason for the run's end; empty if there is none."""
        try:
            return (Path(os.environ.get("ROS_LOG_DIR", "")) / ENDED).read_text().strip()
        except OSError:
            return ""


def main() -> None:
    """Entry point of the process."""
    run(LivePage)


if __name__ == "__main__":
    main()
