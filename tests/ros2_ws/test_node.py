"""What ends a node, and the order in which it takes messages."""

from __future__ import annotations

import time
from itertools import count
from types import SimpleNamespace

import pytest
import rclpy
from rclpy.node import Node

from deeptruck_nodes import messages, node
from deeptruck_nodes.topics import CONTROL_QOS, ENGAGED, TWIST


def alternates(numbers: list[int]) -> bool:
    heard = node.Publishers()
    return [heard.are_two(number) for number in numbers][-1]


def test_messages_of_two_publishers_alternate_between_two_series() -> None:
    assert alternates([1000, 1, 1001, 2])
    assert alternates([500, 500, 501, 501, 502, 502])  # begun together
    assert alternates([1000, 950, 1001, 951, 1002])
    assert alternates([*range(1, 60), 7, 60, 61, 62, 63, 8])  # one is slow


def test_one_publisher_may_lose_messages_and_be_restarted() -> None:
    assert not alternates([1, 2, 3, 40, 41, 200, 201])
    assert not alternates([1000, 1001, 1, 2, 3, 4])
    assert not alternates([*range(1, 50), *range(1, 30), *range(31, 200)])  # twice, its first ones missed
    assert not alternates([1000, 1001, *range(1, 1000), *range(1001, 1200)])  # past the number of the old one
    assert not node.Publishers().are_two(None)


class Busy(Node):
    """Has always a message on its first topic, and waits for another time at every turn."""

    def __init__(self, context: rclpy.Context) -> None:
        super().__init__("busy", context=context, enable_rosout=False)
        self.busy = self.create_publisher(TWIST.message, TWIST.name, CONTROL_QOS)
        self.rare = self.create_publisher(ENGAGED.message, ENGAGED.name, CONTROL_QOS)
        self.create_subscription(TWIST.message, TWIST.name, self._on_busy, CONTROL_QOS)
        self.create_subscription(ENGAGED.message, ENGAGED.name, self._on_rare, CONTROL_QOS)
        self.finished, self.taken, self._waits = False, 0, count(1)
        self._until = time.monotonic() + 30.0

    def connected(self) -> bool:
        return all(p.get_subscription_count() for p in (self.busy, self.rare))

    def begin(self) -> None:
        self.rare.publish(messages.scalars(0, ENGAGED.fields, {"engaged": 1.0}))
        for _ in range(500):
            self.busy.publish(messages.twist(0, 1.0, "truck"))

    def tick(self) -> float:
        self.finished |= time.monotonic() > self._until or self.taken == 500
        return 0.001 * (next(self._waits) % 97)

    def lingers(self) -> bool:
        return False

    def _on_busy(self, message: object) -> None:
        self.taken += 1

    def _on_rare(self, message: object) -> None:
        self.finished = True


def test_no_topic_starves_behind_one_that_always_has_a_message(
    domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    try:
        monkeypatch.setattr(
            node, "SingleThreadedExecutor", lambda: rclpy.executors.SingleThreadedExecutor(context=context)
        )
        busy = Busy(context)
        node._spin(busy, SimpleNamespace(asked=False))  # type: ignore[arg-type]
        assert busy.taken < 100  # of 500
        busy.destroy_node()
    finally:
        rclpy.shutdown(context=context)
