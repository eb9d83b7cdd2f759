"""Recorder node: writes raw messages into an MCAP bag, of which a kill loses at most the last second."""

from __future__ import annotations

import functools
import importlib
import json
import time
from contextlib import ExitStack
from pathlib import Path

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.subscription import Subscription

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_model.recordings.bag_source import INTERFACE_KEY, BagSource
from deeptruck_nodes import bag_place
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.node import IDLE, DeeptruckNode, run
from deeptruck_nodes.topics import RECORD_QOS, RECORDED, TOPICS, quality

BURST = 500  # messages of one topic taken before the others get their turn


class Recorder(DeeptruckNode):
    """Records messages at their arrival times, in lock-step at their stamps, so that equal runs give equal
    bags."""

    lingers_on = True

    def __init__(self) -> None:
        super().__init__("recorder")
        if not self.p["bag"]:
            raise InputError("recorder: say where to record with the parameter bag")
        self._custom = _stored_with(self.p["copy_of"])
        if _is_json(self.p["interface"]):
            self._custom[INTERFACE_KEY] = self.p["interface"]
        self._opened: CrashSafeWriter | None = None
        self._stack = ExitStack()
        self._subscribed: dict[str, Subscription] = {}
        self._undiscovered = list(self.p["topics"] or RECORDED)
        self._lost = 0
        self._find_topics()

    def begin(self) -> None:
        """Create the bag, when all nodes are ready."""
        _ = self._writer

    @property
    def _writer(self) -> CrashSafeWriter:
        if self._opened is None:  # a message may overtake the word to go
            bag = Path(self.p["bag"])
            self._opened = CrashSafeWriter(bag, custom_data=self._custom)
            self._stack.enter_context(bag_place.claimed(bag))
        return self._opened

    def _find_topics(self) -> None:
        """Subscribe to topics with known types: our own at once, others when they have a publisher."""
        graph = {name: types[0] for name, types in self.get_topic_names_and_types() if types}
        graph |= {name: topic.type_name for name, topic in TOPICS.items()}
        for name in [name for name in self._undiscovered if name in graph]:
            self._undiscovered.remove(name)
            self._subscribe(name, graph[name])

    def _subscribe(self, name: str, type_name: str) -> None:
        self._subscribed[name] = self.create_subscription(
            message_class(type_name),
            name,
            functools.partial(self._on_message, name, type_name),
            quality(TOPICS[name], RECORD_QOS, tuple(self.p["peers"])) if name in TOPICS else RECORD_QOS,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(message_lost=self._on_lost),
        )

    def _on_message(self, topic: str, type_name: str, cdr: bytes) -> None:
        """Write this message and those waiting after it, because an executor cycle costs as much as ten
        reads."""
        self._write(topic, type_name, cdr)
        subscription = self._subscribed[topic]
        with subscription.handle:
            for _ in range(BURST):
                taken = subscription.handle.take_message(subscription.msg_type, True)
                if taken is None:
                    return
                self._write(topic, type_name, taken[0])

    def _write(self, topic: str, type_name: str, cdr: bytes) -> None:
        stamp = header_stamp(cdr) if self.lockstep else time.time_ns()
        self._writer.write(topic, type_name, cdr, stamp)
        self.received += 1

    def _on_lost(self, event: object) -> None:
        self._lost += event.total_count_change  # type: ignore[attr-defined]

    def tick(self) -> float:
        if self._undiscovered:
            self._find_topics()
        self._writer.flush_if_due()
        if not self.lockstep:  # what it counts depends on timing: no part of a run that repeats itself
            level, says = ("warn", "messages were lost") if self._lost else ("ok", "recording")
            self.diagnose(self.now(), level, says, {"messages": self.received, "lost": self._lost})
        return IDLE

    def close(self) -> None:
        if self._opened is not None:
            self._opened.close()
            self._stack.close()
            print(f"recorded {self.received} messages in {self.p['bag']}, {self._lost} lost", flush=True)


def message_class(type_name: str) -> type:
    """The class of 'package/msg/Name'. Raises InputError if it is not installed."""
    package, _, name = type_name.partition("/msg/")
    try:
        found: type = getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise InputError(f"message type {type_name} is not installed here") from None
    return found


def header_stamp(cdr: bytes) -> int:
    """The stamp, ns, of a serialised message that begins with a std_msgs/Header."""
    order = "little" if cdr[1] & 1 else "big"
    return int.from_bytes(cdr[4:8], order) * SECOND + int.from_bytes(cdr[8:12], order)  # type: ignore[arg-type]


def _stored_with(bag: str) -> dict[str, str]:
    """Interface, notes and other data stored in the bag that is copied, by key; empty without a bag."""
    if not bag:
        return {}
    with BagSource(Path(bag)) as source:
        return source.stored()


def _is_json(text: str) -> bool:
    if not text:
        return False
    try:
        json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"recorder: interface is not JSON ({error})") from None
    return True


def main() -> None:
    """Entry point of the process."""
    run(Recorder)


if __name__ == "__main__":
    main()
