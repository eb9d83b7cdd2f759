"""Live page: receives every topic and shows the run in a browser on this machine.

It publishes only /replay/control, during a replay, when its buttons are used. It polls ten times a second
instead of waking up for every message, and subscribes as best effort, so that a slow or stopped page delays
no publisher.
"""

from __future__ import annotations

import json
import os
import queue
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.callback_groups import CallbackGroup
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState, Range

from deeptruck_core.pages import local
from deeptruck_core.signals import TruckInterface
from deeptruck_nodes import messages
from deeptruck_nodes.environment import ENDED
from deeptruck_nodes.messages import LEVELS, SECOND, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run
from deeptruck_nodes.page import assets, place
from deeptruck_nodes.page.live import Link, Live
from deeptruck_nodes.page.server import Server, Stream
from deeptruck_nodes.topics import (
    BEST_EFFORT_QOS,
    CLOCK,
    COMMAND,
    DIAGNOSTICS,
    ENGAGED,
    MISMATCH_BUDGET,
    MISMATCH_NAMES,
    MISMATCH_RESIDUAL,
    RADAR_RANGE,
    RADAR_TWIST,
    REPLAY_CONTROL,
    REPLAY_STATE,
    TOPICS,
    TWIST,
    Topic,
)

PARAMETERS_FILE = "parameters.yaml"  # in the folder of a run
EVERY = 0.1  # s between two batches
KNOWN = tuple(sorted({name for topic in TOPICS.values() for name in (*topic.publishers, *topic.subscribers)}))
LEVEL_NAMES = {value: name for name, value in LEVELS.items()}


class _Unwatched(CallbackGroup):
    """Subscriptions that the executor ignores; their messages are polled."""

    def can_execute(self, entity: object) -> bool:
        return False


class LivePage(DeeptruckNode):
    """The node. It subscribes only once the run has started, so that publishers waiting for their listeners
    do not count the page among them."""

    def __init__(self) -> None:
        super().__init__("live_page")
        self._place = place.inherited() or self._own_place()
        self._live = Live(self._nodes(), self._links(), self._units(), _what_runs())
        self._stream = Stream(self._live.greeting)
        self._asked: queue.SimpleQueue[dict[str, float]] = queue.SimpleQueue()
        # Made here, so that the run is ready only when the replay hears it: an early click would be lost.
        self._control = self.publish_on(REPLAY_CONTROL)
        control = self._asked.put if "replay" in self._nodes() else None
        self._server = Server(self._place, *assets.page(), self._stream, control)
        self._subscriptions_of: dict[str, Subscription] = {}
        self._due = 0.0
        self._readers: dict[str, Callable[[Any], None]] = {
            TWIST.name: self._on_twist,
            RADAR_TWIST.name: self._on_radar_twist,
            RADAR_RANGE.name: self._on_range,
            COMMAND.name: self._on_command,
            ENGAGED.name: self._on_engaged,
            MISMATCH_RESIDUAL.name: self._on_residual,
            MISMATCH_NAMES.name: self._on_names,
            MISMATCH_BUDGET.name: self._on_budget,
            DIAGNOSTICS.name: self._on_diagnostics,
            REPLAY_STATE.name: self._on_replay_state,
        }
        self._server.start()

    def _own_place(self) -> local.Place:
        """Create and print an address, if the page was started by hand."""
        made = local.made(self.p["port"])
        print(f"page: {made.address}", flush=True)
        return made

    def _nodes(self) -> tuple[str, ...]:
        """The nodes of this run; all nodes of the topic table if the page was started by hand."""
        return tuple(self.p["peers"]) or KNOWN

    def _links(self) -> tuple[Link, ...]:
        by_hand, nodes = not self.p["peers"], self._nodes()
        links = []
        for topic in TOPICS.values():
            publishers = tuple(name for name in topic.publishers if name in nodes)
            listeners = tuple(name for name in topic.subscribers if name in nodes)
            seldom = topic.pause_s > 0.0 or (topic is CLOCK and not self.lockstep)
            expected = bool(set(publishers) - {"replay"}) and not (seldom or by_hand)
            if publishers:
                links.append(Link(topic.name, publishers, listeners, expected, topic.pause_s))
        return tuple(links)

    def _units(self) -> dict[str, str]:
        """The commands' units, if the run knows its truck."""
        if not self.p["interface"]:
            return {}
        interface = TruckInterface.from_dict(json.loads(self.p["interface"]))
        return {name: interface.unit(name) for name in interface.u}

    def begin(self) -> None:
        group = _Unwatched()
        self._subscriptions_of = {name: self._subscribe(topic, group) for name, topic in TOPICS.items()}

    def _subscribe(self, topic: Topic, group: CallbackGroup) -> Subscription:
        return self.create_subscription(
            topic.message, topic.name, lambda _: None, BEST_EFFORT_QOS, callback_group=group
        )

    def tick(self) -> float:
        now = time.monotonic()
        if now >= self._due:
            self._due = max(self._due + EVERY, now + EVERY / 2)
            self._batch()
        return self._due - time.monotonic()

    def _batch(self) -> None:
        for name, subscription in self._subscriptions_of.items():
            self._take(name, subscription)
        self._stream.send(self._live.batch(time.monotonic()))
        while not self._asked.empty():
            values = self._asked.get_nowait()
            self._control.publish(messages.scalars(self.now(), REPLAY_CONTROL.fields, values))

    def _take(self, name: str, subscription: Subscription) -> None:
        """Take the waiting messages of a topic; their content is read only if the page shows it."""
        reader, count, newest = self._readers.get(name), 0, 0
        with subscription.handle:
            while count < BEST_EFFORT_QOS.depth:
                taken = subscription.handle.take_message(subscription.msg_type, reader is None)
                if taken is None:
                    break
                count, newest = count + 1, taken[1]["received_timestamp"]
                if reader is not None:
                    reader(taken[0])
        if count:
            age = max(0.0, (time.time_ns() - newest) / SECOND) if newest else 0.0
            self._live.received(name, count, time.monotonic() - min(age, EVERY))

    def _on_twist(self, message: TwistStamped) -> None:
        self._live.sample(nanoseconds(message.header.stamp), {"speed": message.twist.linear.x})

    def _on_radar_twist(self, message: TwistStamped) -> None:
        self._live.sample(nanoseconds(message.header.stamp), {"leader_speed": message.twist.linear.x})

    def _on_range(self, message: Range) -> None:
        self._live.sample(nanoseconds(message.header.stamp), {"gap": message.range})

    def _on_command(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        commands = {name: values[name] for name in COMMAND.fields[:2] if name in values}
        self._live.sample(nanoseconds(message.header.stamp), commands)

    def _on_engaged(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        engaged = {name: values[name] for name in ENGAGED.fields if name in values}
        self._live.sample(nanoseconds(message.header.stamp), engaged)

    def _on_residual(self, message: AccelStamped) -> None:
        a = message.accel.linear
        self._live.sample(
            nanoseconds(message.header.stamp), {"residual": a.x, "smoothed": a.y, "allowed": a.z}
        )

    def _on_replay_state(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        self._live.replay = {name: round(values.get(name, 0.0), 2) for name in REPLAY_STATE.fields}

    def _on_names(self, message: JointState) -> None:
        self._live.names(messages.read_scalars(message))

    def _on_budget(self, message: JointState) -> None:
        self._live.budget(messages.read_scalars(message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        stamp, now = nanoseconds(message.header.stamp), time.monotonic()
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            level = LEVEL_NAMES.get(status.level, "error")
            if status.hardware_id in KNOWN:
                self._live.health(stamp, status.hardware_id, level, status.message, values, now)

    def close(self) -> None:
        if self._subscriptions_of:
            self._batch()
        self._server.close(self._why())

    def _why(self) -> str:
        """The start script's reason for the run's end; empty if there is none."""
        try:
            return (Path(os.environ.get("ROS_LOG_DIR", "")) / ENDED).read_text().strip()
        except OSError:
            return ""


SHOWN = (("truck_sim", "simulator"), ("can_bridge", "vehicle"), ("controller", "policy"), ("replay", "bag"))


def _what_runs() -> str:
    """Simulator or vehicle, policy and folder of the run, from its parameters; empty if started by hand."""
    folder = os.environ.get("ROS_LOG_DIR", "")
    try:
        sections = yaml.safe_load((Path(folder) / PARAMETERS_FILE).read_text()) if folder else {}
    except (OSError, yaml.YAMLError):
        return ""
    of = {node: section.get("ros__parameters", {}) for node, section in sections.items()}
    named = [str(of[node][key]) for node, key in SHOWN if of.get(node, {}).get(key)]
    said = [name if ":" in name else Path(name).name for name in named]
    return ", ".join([*said, Path(folder).name]) if said else ""


def main() -> None:
    """Entry point of the process."""
    run(LivePage)


if __name__ == "__main__":
    main()
