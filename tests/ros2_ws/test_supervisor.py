"""How a run begins, or does not."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import signal
import subprocess
import sys
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from rclpy.node import Node

from deeptruck_core.errors import InputError
from deeptruck_nodes import environment, messages, node, supervisor
from deeptruck_nodes.environment import DOMAIN, ENDED
from deeptruck_nodes.supervisor import Program, Supervisor
from deeptruck_nodes.topics import CONTROL_QOS, ENGAGED, TWIST

INTERRUPTED_WHILE_IT_IS_IMPORTED = """
import os, signal, time
os.kill(os.getppid(), signal.SIGINT)
time.sleep(60)
"""


SAYS_ITS_CLASS = """
import os, threading, time
from deeptruck_nodes.lifeline import Lifeline
line, classes, go = Lifeline(), [os.sched_getscheduler(0)], threading.Event()
def late():
    go.wait()
    print(classes[0], os.sched_getscheduler(0), flush=True)
thread = threading.Thread(target=late)
thread.start()
line.ready()
while not line.may_go(): time.sleep(0.01)
go.set()
thread.join()
"""


def test_a_node_that_is_still_imported_ends_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    node = Program("node", (sys.executable, "-c", INTERRUPTED_WHILE_IT_IS_IMPORTED), speaks=True)
    with (tmp_path / "lock").open("w") as lock:
        assert Supervisor(tmp_path, [node], {DOMAIN: "1"}, lock.fileno()).run(240.0) == 0
    assert "Traceback" not in capsys.readouterr().out and not (tmp_path / "node.log").read_text()


@pytest.mark.parametrize("priority", [0, 10])
def test_what_has_a_priority_gets_it_when_the_run_goes(tmp_path: Path, priority: int) -> None:
    program = Program("node", (sys.executable, "-c", SAYS_ITS_CLASS), ends_run=True, priority=priority)
    with (tmp_path / "lock").open("w") as lock:
        assert Supervisor(tmp_path, [program], {DOMAIN: "1"}, lock.fileno()).run(240.0) == 0
    now = os.SCHED_FIFO if priority and may_hurry() else os.SCHED_OTHER
    assert (tmp_path / "node.log").read_text().split() == [str(os.SCHED_OTHER), str(now)]


def may_hurry() -> bool:
    """Whether this user may have a real-time priority."""
    asked = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))"
    return subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False).returncode == 0


# A program that only looks on: nobody waits for it, and its death is not the run's


def program(name: str, code: str, **options: Any) -> Program:
    return Program(name, (sys.executable, "-c", code), says_ready=False, **options)


def run(folder: Path, *programs: Program) -> tuple[int, Supervisor]:
    with (folder / "lock").open("w") as lock:
        over = Supervisor(folder, programs, {DOMAIN: "1"}, lock.fileno())
        return over.run(240.0), over


def test_one_that_dies_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    marks = tmp_path / "marks"
    dies = f"import os; open({str(marks)!r}, 'w').write(os.environ['WORD']); raise SystemExit('no room')"
    waits = f"import os, time\nwhile not os.path.exists({str(marks)!r}): time.sleep(0.05)\ntime.sleep(1)"
    dying = program("page", dies, spectator=True, environment={"WORD": "word"})
    code, _ = run(tmp_path, dying, program("driving", waits, ends_run=True))
    said = capsys.readouterr().err.splitlines()
    assert code == 0 and said == ["page ended (exit code 1): no room; the run goes on without it"]
    assert marks.read_text() == "word"


def test_one_that_hangs_is_not_waited_for_and_why_the_run_ended_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "PATIENCE", ((signal.SIGINT, 3600.0),))  # for which no test would wait
    hangs = "import signal, time\nfor n in (2, 15): signal.signal(n, signal.SIG_IGN)\ntime.sleep(3600)"
    driving = program("driving", "import time; time.sleep(1)", ends_run=True)
    code, over = run(tmp_path, program("page", hangs, spectator=True), driving)
    assert code == 0
    assert (tmp_path / ENDED).read_text() == f"{over.why}\n" == "driving has finished\n"


# What the processes of a run find around them


def test_unwritable_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write logs"):
        environment.run_folder(tmp_path / "file", "simulation")


def test_beside_a_sourced_ros_its_libraries_come_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wheels = f"{sys.prefix}/lib/python3.12/site-packages/ros_rcl.libs"
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{wheels}:/opt/ros/jazzy/lib")
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_other")
    ours = environment.ros_environment(tmp_path, 7)
    assert wheels in ours["LD_LIBRARY_PATH"] and "RMW_IMPLEMENTATION" not in ours
    spec = importlib.machinery.ModuleSpec(
        "rclpy", None, origin="/opt/ros/jazzy/lib/python3.12/site-packages/rclpy"
    )
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: spec)
    sourced = environment.ros_environment(tmp_path, 7)
    assert sourced["LD_LIBRARY_PATH"] == "/opt/ros/jazzy/lib"
    assert sourced["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"  # the wheels must not add them again


# What ends a node, and the order in which it takes messages


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
