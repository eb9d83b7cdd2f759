"""Base of the nodes: parameters, readiness, diagnostics, and an orderly end."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidParameterTypeException, ParameterException
from rclpy.executors import SingleThreadedExecutor, TimeoutObject
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from deeptruck_core.errors import InputError
from deeptruck_nodes import messages, parameters
from deeptruck_nodes.lifeline import Lifeline
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.topics import CONTROL_QOS, DIAGNOSTICS, Topic, expected_subscribers, quality

IDLE = 0.1  # s; the longest a node sleeps before it looks at its stop flag
HAND_OVER = 1.0  # s; the longest a node waits for a listener that is slow, or dead and not yet missed
LINGER = 5.0  # s; the longest a node keeps listening for what was sent before the end


class Publishers:
    """Finds two live publishers of a topic by the numbers that DDS gives the messages of each.

    Messages of two publishers alternate between two series. A node that was restarted begins a new series and
    never continues the old one, although the graph lists its old publisher for up to 20 s.
    """

    LOST = 100  # messages of a series that may be lost in a row
    RETURNS = 2  # to an earlier series: once could be a restarted node whose first messages were missed

    def __init__(self) -> None:
        self._series = deque[int](maxlen=4)  # newest number of each, the present one last
        self._returns = 0

    def are_two(self, number: int | None) -> bool:
        """Process a message's number (None: the middleware has none). True if two publishers are alive."""
        if number is None:
            return False
        places = [n for n, last in enumerate(self._series) if 0 < number - last <= self.LOST]
        if places:
            place = max(places, key=lambda n: (self._series[n], n))
            self._returns += place < len(self._series) - 1
            del self._series[place]
        self._series.append(number)
        return self._returns >= self.RETURNS


class DeeptruckNode(Node):
    """Base of the nodes. A subclass overrides `begin`, `tick` and `close` as needed.

    A subclass that sets `lingers_on` and counts messages in `received` also processes messages that arrive
    after the stop.
    """

    lingers_on = False

    def __init__(self, name: str) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, enable_rosout=False)
        self.p: dict[str, Any] = parameters.declare(self)
        self.lockstep: bool = self.p["lockstep"]
        self.finished = False
        self.received = 0
        self._counted = self._diagnosed = -1
        self._stopping: float | None = None
        self._outgoing: list[tuple[Topic, Publisher]] = []
        self._diagnostics = self.publish_on(DIAGNOSTICS)

    def publish_on(self, topic: Topic) -> Publisher:
        quiet = PublisherEventCallbacks(use_default_callbacks=False)  # each would be waited on at every turn
        publisher = self.create_publisher(topic.message, topic.name, CONTROL_QOS, event_callbacks=quiet)
        self._outgoing.append((topic, publisher))
        return publisher

    def listen_to(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        """Subscribe to a topic. Raises InputError, which ends the node in order, if two publishers of it are
        heard."""
        heard = Publishers()

        def take(message: Any, info: Mapping[str, Any]) -> None:
            if heard.are_two(info["publication_sequence_number"]):
                raise InputError(self._two_publishers(topic.name))
            callback(message)

        qos = quality(topic, CONTROL_QOS, tuple(self.p["peers"]))
        self.create_subscription(topic.message, topic.name, take, qos)

    def _two_publishers(self, topic: str) -> str:
        known = [one.node_namespace.rstrip("/") + "/" + one.node_name for one in
                 self.get_publishers_info_by_topic(topic)]  # fmt: skip
        return f"{topic} has two publishers: {' and '.join(sorted(known))}; only one may drive, end the other"

    def connected(self) -> bool:
        """Whether every node that listens to this one has been matched."""
        peers = tuple(self.p["peers"])
        return all(
            out.get_subscription_count() >= expected_subscribers(topic, peers)
            for topic, out in self._outgoing
        )

    def begin(self) -> None:
        """Called once, when every node of the run is ready."""

    def tick(self) -> float:
        """Do what is due now; returns the time until the next call, s."""
        return IDLE

    def lingers(self) -> bool:
        """After a stop: whether messages still arrive and must be handled."""
        self._stopping = self._stopping or time.monotonic()
        came, self._counted = self.received > self._counted, self.received
        return self.lingers_on and came and time.monotonic() - self._stopping < LINGER

    def hand_over(self) -> None:
        """Wait until all subscribers have received what was sent, since nothing is resent after the publisher
        has ended."""
        until = time.monotonic() + HAND_OVER
        for _, publisher in self._outgoing:
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, until - time.monotonic())))

    def close(self) -> None:
        """Shut down; called once, while messages can still be sent."""

    def diagnose(
        self, stamp: int, level: str, says: str, values: Mapping[str, object], *, at_once: bool = False
    ) -> None:
        """Publish the status of this node at most once per second of stamp time, so that lock-step runs are
        repeatable; `at_once` publishes now, for an event."""
        if at_once or self.diagnosis_is_due(stamp):
            self._diagnosed = stamp // SECOND
            self._diagnostics.publish(messages.diagnostics(stamp, self.get_name(), level, says, values))

    def diagnosis_is_due(self, stamp: int) -> bool:
        """Whether `diagnose` would publish now; saves collecting a status that is costly to determine."""
        return stamp // SECOND != self._diagnosed

    def now(self) -> int:
        """System time in ns, the stamp of everything measured in real time."""
        return time.time_ns()


def say(text: str) -> None:
    """Print to the terminal; a full disk of the log is ignored."""
    with contextlib.suppress(OSError):
        print(text, flush=True)


class _Stop:
    """Flag set by SIGINT, SIGTERM and, unless it is ignored, SIGHUP.

    rclpy's own handlers occasionally lose a signal, so they are switched off. A node that is still being
    created, which takes seconds, ends at once.
    """

    def __init__(self) -> None:
        self.asked = False
        self.is_made = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._ask)

    def _ask(self, number: int, frame: object) -> None:
        self.asked = True
        if not self.is_made:
            sys.exit(128 + number)


def run(make: Callable[[], DeeptruckNode]) -> None:
    """The body of every main(): one clear line and exit code 2 for bad input, 0 after a regular end."""
    stop = _Stop()
    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        node = make()
        stop.is_made = True
        try:
            _spin(node, stop)
        finally:
            node.close()
            node.hand_over()
            node.destroy_node()
    except InputError as error:
        sys.exit(_last_words(str(error)))
    except (
        ParameterException,
        InvalidParameterTypeException,
        rclpy.exceptions.ROSInterruptException,
    ) as error:
        sys.exit(_last_words(str(error)))
    except Exception as error:
        if type(error).__name__ not in ("RCLInvalidROSArgsError", "UnknownROSArgsError", "RCLError"):
            raise
        sys.exit(_last_words(" ".join(str(error).split())))
    finally:
        rclpy.try_shutdown()


def _last_words(text: str) -> int:
    print(text, file=sys.stderr, flush=True)
    return 2


def _spin(node: DeeptruckNode, stop: _Stop) -> None:
    lifeline, executor = Lifeline(), SingleThreadedExecutor()
    executor.add_node(node)
    # A new number makes the executor begin with the first subscription again, and where messages are always
    # waiting the last one starves; with one object it takes each that is ready in turn.
    going, pause = False, TimeoutObject(0.0)
    while not (stop.asked or node.finished or lifeline.is_cut()):
        if going:
            wait = node.tick()
        else:
            wait = 0.02
            if node.connected():
                lifeline.ready()
                if lifeline.may_go():
                    going, wait = True, 0.0
                    node.begin()
        pause.timeout = max(0.0, min(wait, IDLE))
        executor.spin_once(timeout_sec=pause)
    while node.lingers():
        executor.spin_once(timeout_sec=IDLE)
    executor.remove_node(node)
