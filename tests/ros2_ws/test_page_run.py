"""The page started by hand says where it is; that of a run is in test_node_graph."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

from deeptruck_nodes import environment


def test_started_by_hand_it_says_where_it_is_and_serves(tmp_path: Path, domain: int) -> None:
    (tmp_path / "parameters.yaml").write_text(
        "truck_sim: {ros__parameters: {simulator: 'truck:volvo'}}\n"
        "controller: {ros__parameters: {policy: 'baseline:acc'}}\n"
    )
    node = subprocess.Popen(
        [sys.executable, "-m", "deeptruck_nodes.live_page"],
        env=environment.ros_environment(tmp_path, domain), stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert node.stdout is not None
        (address,) = re.findall(r"^page: (http://127\.0\.0\.1:\d+/\S+/)\n$", node.stdout.readline())
        with urllib.request.urlopen(f"{address}events", timeout=120) as stream:
            said = [stream.readline().decode() for _ in range(6)]
            greeting = json.loads(said[2].removeprefix("data: "))
            assert greeting["run"] == f"truck:volvo, baseline:acc, {tmp_path.name}"
            assert "controller" in greeting["nodes"] and not any(x["expected"] for x in greeting["links"])
            assert said[1] == "event: hello\n" and said[4] == "event: batch\n"
            os.kill(node.pid, signal.SIGINT)
            rest = stream.read().decode()
        assert rest.endswith("event: ended\ndata: \n\n")
        assert node.wait(120) == 0
    finally:
        node.kill()
        node.wait()
