"""Replay node: publishes a bag on its topics, with /clock; it can be paused and moved to another recorded
time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState

from deeptruck_core.errors import InputError
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes import messages
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.node import IDLE, DeeptruckNode, run
from deeptruck_nodes.recorder import message_class
from deeptruck_nodes.topics import CLOCK, NO_SEEK, REPLAY_CONTROL, REPLAY_STATE, TOPICS, Topic

Message = tuple[str, int, bytes]  # topic, log time in ns, serialised message

OWN = (CLOCK, REPLAY_STATE, REPLAY_CONTROL)  # never played: the replay publishes its own, or obeys it
SAID_EVERY = 10.0  # s between two lines on the recorded time


class Replay(DeeptruckNode):
    """Publishes every message at its log time, and /clock at least ten times a second.

    /replay/control pauses it and moves it. It is not moved while a copy is recorded, because the copy would
    differ from the source.
    """

    def __init__(self) -> None:
        super().__init__("replay")
        self._stack = ExitStack()
        path = Path(self.p["bag"])
        self._bag = self._stack.enter_context(BagSource(path))
        wanted = _wanted(path, self._bag.topics, self.p["topics"])
        self._publishers_of = {name: self._publisher(name, kind) for name, kind in wanted.items()}
        self._clock, self._state = self.publish_on(CLOCK), self.publish_on(REPLAY_STATE)
        self.listen_to(REPLAY_CONTROL, self._on_control)
        self._may_seek = "recorder" not in self.p["peers"]
        self._paused = False
        self._state_due = self._said_due = 0.0
        first = next(self._bag.messages(set(wanted)), None)
        if first is None:
            raise InputError(f"{path} is empty: there is nothing to replay")
        self._first, self._duration = first[1], (self._bag.last_ns - first[1]) / SECOND
        self._go_to(self.p["start_s"])
        if self._next is None:
            raise InputError(f"{path} ends before start_s = {self.p['start_s']:g} s")

    def _publisher(self, name: str, type_name: str) -> Publisher:
        """A publisher that waits for its subscribers at the start and until they have its last message."""
        known = TOPICS.get(name)
        subscribers = known.subscribers if known else ()
        return self.publish_on(Topic(name, message_class(type_name), ("replay",), subscribers, "", ""))

    def begin(self) -> None:
        self._since = time.monotonic()

    def _go_to(self, position: float) -> None:
        """Continue from a recorded time, s."""
        self._since, self._log_then = time.monotonic(), self._first + round(position * SECOND)
        self._messages: Iterator[Message] = self._bag.messages(set(self._publishers_of), self._log_then)
        self._next: Message | None = next(self._messages, None)

    def _log_now(self) -> int:
        passed = 0.0 if self._paused else (time.monotonic() - self._since) * self.p["speed"]
        return self._log_then + round(passed * SECOND)

    def _on_control(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        paused, seek = values.get("paused", math.nan), values.get("seek", math.nan)
        if math.isfinite(paused) and (paused != 0.0) != self._paused:
            self._log_then, self._since = self._log_now(), time.monotonic()
            self._paused = paused != 0.0
            self._said_due = 0.0
        if math.isfinite(seek) and self._may_seek:
            self._go_to(min(max(seek, 0.0), self._duration))
            self._said_due = 0.0
        elif math.isfinite(seek):
            print(f"not moved to {seek:.1f} s: {NO_SEEK}", flush=True)
        self._state_due = 0.0

    def tick(self) -> float:
        log_now = self._log_now()
        self._clock.publish(messages.clock(log_now))
        while self._next is not None and self._next[1] <= log_now:
            topic, _, data = self._next
            self._publishers_of[topic].publish(data)
            self._next = next(self._messages, None)
        self.finished = self._next is None and not self._paused
        self._say(log_now)
        if self._next is None or self._paused:
            return IDLE
        return min(IDLE, (self._next[1] - log_now) / SECOND / self.p["speed"])

    def _say(self, log_now: int) -> None:
        """Publish the recorded time, and print it every ten seconds."""
        now, position = time.monotonic(), min((log_now - self._first) / SECOND, self._duration)
        if now >= self._state_due or self.finished:
            self._state_due = now + IDLE
            values = (position, self._duration, self._paused, self._may_seek)
            state = dict(zip(REPLAY_STATE.fields, map(float, values), strict=True))
            self._state.publish(messages.scalars(log_now, REPLAY_STATE.fields, state))
        if now >= self._said_due:
            self._said_due = math.inf if self._paused else now + SAID_EVERY
            how = "paused at" if self._paused else "at"
            print(f"{how} {position:.1f} of {self._duration:.1f} s", flush=True)

    def close(self) -> None:
        self._stack.close()


def _wanted(path: Path, present: dict[str, str], asked: list[str]) -> dict[str, str]:
    for name in asked:
        if name not in present:
            raise InputError(f"{path} has no topic {name}; it has: {', '.join(sorted(present))}")
    own = [topic.name for topic in OWN]
    return {name: kind for name, kind in present.items() if name not in own and (not asked or name in asked)}


def main() -> None:
    """Entry point of the process."""
    run(Replay)


if __name__ == "__main__":
    main()
