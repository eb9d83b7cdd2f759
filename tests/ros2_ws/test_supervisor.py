"""How a run begins, or does not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_nodes.environment import DOMAIN
from deeptruck_nodes.supervisor import Program, Supervisor

READY_AS_SOMEBODY_ASKS_FOR_THE_END = """
import os, signal, sys, time
from deeptruck_nodes.lifeline import Lifeline
line = Lifeline()
os.kill(os.getppid(), signal.SIGINT)
line.ready()
while not line.may_go(): time.sleep(0.01)
open(sys.argv[1], "w")
time.sleep(60)
"""

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


def test_a_run_that_is_asked_to_end_as_the_last_gets_ready_does_not_go(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    went = tmp_path / "went"
    node = Program("node", (sys.executable, "-c", READY_AS_SOMEBODY_ASKS_FOR_THE_END, str(went)))
    with (tmp_path / "lock").open("w") as lock:
        code = Supervisor(tmp_path, [node], {DOMAIN: "1"}, lock.fileno()).run(240.0)
    said = capsys.readouterr().out
    assert code == 0 and "stopping" in said and "ready after" not in said
    assert not went.exists()


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
