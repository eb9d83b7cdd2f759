"""The same package as a ROS 2 workspace."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_nodes import parameters

PACKAGE = Path(__file__).parents[2] / "ros2_ws" / "src" / "deeptruck_nodes"
COLCON = Path(sys.executable).with_name("colcon")


@pytest.mark.skipif(not COLCON.exists(), reason="colcon is not installed in this environment")
def test_colcon_builds_nodes_that_run(tmp_path: Path) -> None:
    hidden = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    shutil.copytree(PACKAGE, tmp_path / "src" / "deeptruck_nodes", ignore=hidden)
    build = subprocess.run(
        [COLCON, "build"], cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False
    )
    assert build.returncode == 0, build.stderr
    nodes = tmp_path / "install" / "deeptruck_nodes" / "lib" / "deeptruck_nodes"
    assert {node.name for node in nodes.iterdir()} == set(parameters.schema()) - {"common"}
    # Sourced, the installed copy is the one that runs; a bad parameter makes it say its name and end.
    where = f"import deeptruck_nodes as d; assert d.__file__.startswith('{tmp_path}'), d.__file__"
    leader = f"{nodes}/leader --ros-args -p profile:=none"
    script = f'. install/setup.sh && {sys.executable} -c "{where}" && exec {leader}'
    environment = {**os.environ, "ROS_LOG_DIR": str(tmp_path)}
    run = subprocess.run(
        ["sh", "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert "leader 'none': there is no 'none'" in run.stderr
