"""A bag back onto its topics, with /clock."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from rclpy.publisher import Publisher

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes import messages
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.node import IDLE, DeeptruckNode, run
from deeptruck_nodes.recorder import message_class
from deeptruck_nodes.topics import CLOCK, TOPICS, Topic

Message = tuple[str, int, bytes]  # topic, log time in ns, serialised message


class Replay(DeeptruckNode):
    """Publishes every message at its log time; /clock runs with it at least ten times a second."""

    def __init__(self) -> None:
        super().__init__("replay")
        self._stack = ExitStack()
        path = Path(self.p["bag"])
        bag = self._stack.enter_context(BagSource(path))
        wanted = _wanted(path, bag.topics, self.p["topics"])
        self._publishers_of = {name: self._publisher(name, kind) for name, kind in wanted.items()}
        self._messages: Iterator[Message] = bag.messages(set(wanted))
        self._clock = self.publish_on(CLOCK)
        self._next: Message | None = next(self._messages, None)
        if self._next is None:
            raise InputError(f"{path} is empty: there is nothing to replay")
        self._log_start = self._next[1] + round(self.p["start_s"] * SECOND)
        while self._next is not None and self._next[1] < self._log_start:
            self._next = next(self._messages, None)
        if self._next is None:
            raise InputError(f"{path} ends before start_s = {self.p['start_s']:g} s")

    def _publisher(self, name: str, type_name: str) -> Publisher:
        """One that waits, as every node's do, for its listeners, and until they have its last word."""
        known = TOPICS.get(name)
        subscribers = known.subscribers if known else ()
        return self.publish_on(Topic(name, message_class(type_name), ("replay",), subscribers, "", ""))

    def begin(self) -> None:
        self._started = time.monotonic()

    def tick(self) -> float:
        log_now = self._log_start + round((time.monotonic() - self._started) * self.p["speed"] * SECOND)
        self._clock.publish(messages.clock(log_now))
        while self._next is not None and self._next[1] <= log_now:
            topic, _, data = self._next
            self._publishers_of[topic].publish(data)
            self._next = next(self._messages, None)
        if self._next is None:
            self.finished = True
            return 0.0
        return min(IDLE, (self._next[1] - log_now) / SECOND / self.p["speed"])

    def close(self) -> None:
        self._stack.close()


def _wanted(path: Path, present: dict[str, str], asked: list[str]) -> dict[str, str]:
    for name in asked:
        if name not in present:
            raise InputError(f"{path} has no topic {name}; it has: {', '.join(sorted(present))}")
    return {
        name: kind for name, kind in present.items() if name != CLOCK.name and (not asked or name in asked)
    }


def main() -> None:
    """Entry point of the process."""
    run(Replay)


if __name__ == "__main__":
    main()
