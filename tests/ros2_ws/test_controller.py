"""The controller's command is a heartbeat: steady between radar samples, silent soon after they stop."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

HERE = Path(__file__).parent
STALE_AFTER, REPEAT_EVERY, LATE = 0.3, 0.05, 0.3  # s; the last is what a busy machine may add


@pytest.mark.parametrize(
    "silent",
    [
        ("/truck/twist", "/road", "/radar/range", "/radar/twist"),
        pytest.param(("/truck/twist",), marks=pytest.mark.long),
    ],
)
def test_a_command_is_repeated_only_while_observations_are_whole(
    domain: int, tmp_path: Path, silent: tuple[str, ...]
) -> None:
    received, says = fed_controller(domain, tmp_path, silent)
    speed, *refused, counts = says.splitlines()
    assert speed == "set speed: 25 m/s (90 km/h)"
    assert "the shield acted 0 x, the truck was braked fully 0 x" in counts
    assert {line.partition(";")[0] for line in refused} <= {"radar newer than the truck speed"}
    samples = 2.0 / 0.2
    assert len(received["came"]) > 2 * samples  # four times as many on an idle machine
    assert max(received["came"]) < received["fed"] + STALE_AFTER + REPEAT_EVERY + LATE, received["came"][-3:]


@pytest.mark.parametrize(
    "silent", [("/radar/range", "/radar/twist"), pytest.param(("/radar/range",), marks=pytest.mark.long)]
)
def test_a_silent_radar_sees_no_vehicle_and_what_was_followed_goes_on(
    domain: int, tmp_path: Path, silent: tuple[str, ...]
) -> None:
    """For 3 s, as for readings that see nothing: commands are heard until the feed ends 2 s later."""
    received, says = fed_controller(domain, tmp_path, silent)
    assert received["came"][-1] > received["fed"] + 1.5
    assert "the radar lost the leader 1 x" in says


def test_the_engaged_bit_comes_back_until_the_bridge_dies_and_a_radar_is_heard_beyond_a_false_stamp(
    domain: int, tmp_path: Path
) -> None:
    received, says = fed_controller(domain, tmp_path, ("best_effort", "future"))
    gaps = [after - before for before, after in pairwise(received["came"])]
    assert received["came"][0] < 1.0 and received["came"][-1] > 3.5
    assert max(gaps) < STALE_AFTER + LATE
    assert "radar range stamped in the future; counted" in says
    begins, ends = received["told"]
    bits = dict(zip(received["came"], received["bits"], strict=True))
    assert {bit for at, bit in bits.items() if at < begins} == {0.0}
    assert {bit for at, bit in bits.items() if begins + LATE < at < ends} == {1.0}
    assert {bit for at, bit in bits.items() if at > ends + STALE_AFTER + LATE} == {0.0}


def test_two_publishers_of_the_speed_end_the_controller_with_both_names(domain: int, tmp_path: Path) -> None:
    received, says = fed_controller(domain, tmp_path, ("second",), code=2)
    assert "/truck/twist has two publishers: /leader and /stranger;" in says
    assert max(received["came"]) < 2.5


def fed_controller(
    domain: int, tmp_path: Path, words: tuple[str, ...], code: int = 0
) -> tuple[dict[str, list[float]], str]:
    """A controller and what feeds it, as processes; what the latter received, and the former printed."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    argv = [sys.executable, "-m", "deeptruck_nodes.controller"]
    controller = subprocess.Popen(
        argv, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        fed = subprocess.run(
            [sys.executable, HERE / "feed_controller.py", *words],
            env=environment, timeout=240, check=True, capture_output=True, text=True,
        )  # fmt: skip
    finally:
        controller.terminate()
        says, errors = controller.communicate(timeout=120)
    assert controller.returncode == code, errors
    return dict(json.loads(fed.stdout)), says + (errors if code else "")
