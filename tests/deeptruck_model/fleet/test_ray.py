"""A fleet on Ray, whose command is killed and given again, leaves the bytes of one in this process."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from deeptruck_model.fleet import page, pool, roads
from deeptruck_model.fleet.compare import VERDICTS
from deeptruck_model.fleet.extract import INDEX, RECEIPTS
from deeptruck_model.fleet.run import Fleet, Workers, compare, extract
from deeptruck_model.fleet.statistics import LEVEL
from deeptruck_model.fleet.storage import place

LAYOUT = "{truck}/{date}/*.mcap"
COMMAND = [sys.executable, "-c", "from deeptruck_model.cli import main; main()", "fleet"]
PATIENCE_S = 120.0


@pytest.mark.long
@pytest.mark.timeout(900)
def test_killed_on_ray_and_given_again_it_has_the_bytes_of_this_process(drives, content, tmp_path):
    pytest.importorskip("ray")
    here, there = tmp_path / "here", tmp_path / "there"
    extract(Fleet.of(place(str(drives)), place(str(here)), LAYOUT, "truck:trucksim"), Workers())
    compare(place(str(here)), Workers())
    pool.pool(place(str(here)), {}, LEVEL)
    roads.roads(place(str(here)))
    page.show(place(str(here)))
    command = [
        *COMMAND, str(drives), "--layout", LAYOUT, "--simulator", "truck:trucksim", "--out", str(there),
        "--engine", "ray", "--workers", "2",
    ]  # fmt: skip
    with subprocess.Popen(command) as run:
        end = time.monotonic() + PATIENCE_S
        while not any(Path(there / RECEIPTS).glob("*.json")) and time.monotonic() < end:
            time.sleep(0.01)
        run.kill()
    assert not (there / INDEX).exists()
    for _ in range(3):  # Ray gives up where it has not started in 30 s, as on a busy machine
        if subprocess.run(command, check=False).returncode == 0:
            break
    assert content(there, VERDICTS)
    assert content(there) == content(here)
