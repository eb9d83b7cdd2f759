"""How a run begins, or does not."""

from __future__ import annotations

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
