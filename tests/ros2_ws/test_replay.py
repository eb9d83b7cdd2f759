"""A recorded replay is its source: the same samples, of the same truck."""

from __future__ import annotations

import json
import re
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, data_hash, read, write_bag
from deeptruck_model.recordings.bag_source import BagSource

TRUCK = TruckInterface("scania", "percent", "bar", vehicle="bus", mass_kg=17500.0)
NOTES = ("elevation shifted by 3 m", "vehicle number YS2R4X20001234567")


@pytest.fixture
def drive() -> Recording:
    """20 s at 10 Hz, numbers without a pattern: no sample could be mistaken for another."""
    rng, n = np.random.default_rng(5), 200
    channels = {
        "speed": 20.0 + 0.1 * rng.standard_normal(n),
        "acceleration": 0.1 * rng.standard_normal(n),
        "fuel_rate": rng.uniform(0.0, 10.0, n),
        "engine_command": rng.uniform(0.0, 100.0, n),
        "brake_command": rng.uniform(0.0, 2.0, n),
        "grade": 0.01 * rng.standard_normal(n),
        "gap": np.float32(rng.uniform(10.0, 60.0, n)).astype(np.float64),
    }
    return Recording("bag", 0.1, channels, TRUCK, notes=NOTES)


class Watched:
    """A replay with a page, watched as a browser does."""

    def __init__(self, run: Any) -> None:
        self.said = ""
        for line in run.process.stdout:
            self.said += line
            if line.startswith("ready after"):
                break
        (self.address,) = re.findall(r"^page: (http://127\.0\.0\.1:\d+/\S+/)$", self.said, re.M)
        self._states = self._read()

    def _read(self) -> Iterator[dict[str, float]]:
        with urllib.request.urlopen(f"{self.address}events", timeout=120) as stream:
            for line in stream:
                if line.startswith(b"data: {") and (state := json.loads(line[6:])["state"]["replay"]):
                    yield state

    def until(self, holds: Callable[[dict[str, float]], bool]) -> dict[str, float]:
        """The first state of which something holds."""
        return next(state for state in self._states if holds(state))

    def ask(self, **what: float) -> None:
        """What the page's button and slider do."""
        request = urllib.request.Request(f"{self.address}replay", json.dumps(what).encode(), method="POST")
        with urllib.request.urlopen(request, timeout=120) as answer:
            assert answer.status == 204


def test_it_shows_the_recorded_time_pauses_and_moves(
    start: Callable[..., Any], tmp_path: Path, drive: Recording
) -> None:
    write_bag(tmp_path / "bag", [drive], interface=TRUCK)
    run = start("replay_recording.py", tmp_path / "bag", "--page", "--speed", 0.1)
    page = Watched(run)
    begun = page.until(lambda state: state["position"] > 0)
    assert begun["duration"] == pytest.approx(19.9, abs=0.2) and begun["may_seek"] == 1
    page.ask(paused=1)
    paused = page.until(lambda state: state["paused"] == 1)
    assert [page.until(lambda _: True) for _ in range(10)] == 10 * [paused]
    page.ask(seek=18.0)
    page.until(lambda state: state == {**paused, "position": 18.0})
    page.ask(seek=2.0)
    page.until(lambda state: state == {**paused, "position": 2.0})
    page.ask(paused=0)
    page.until(lambda state: state["paused"] == 0 and 2.0 < state["position"] < 10.0)
    page.ask(seek=19.8)
    code, out, errors = run.finish()
    assert (code, errors) == (0, "") and "ended: replay has finished" in out
    for line in ("at 0.0 of 19.9 s", "paused at 18.0 of 19.9 s", "paused at 2.0 of 19.9 s"):
        assert f"replay: {line}" in out


def test_a_recorded_copy_is_its_source_though_it_paused(
    start: Callable[..., Any], tmp_path: Path, drive: Recording
) -> None:
    """The same samples, of the same truck; while it is recorded it pauses and does not move."""
    source, copy = tmp_path / "bag", tmp_path / "copies" / "bag"
    # 6 s at half its speed, so that it is paused long before its end on a busy machine too
    write_bag(source, [drive.piece(0, 60)], interface=TRUCK)
    described = yaml.safe_load((source / "metadata.yaml").read_text())
    described["rosbag2_bagfile_information"]["custom_data"]["driver"] = "Anna, second shift"
    (source / "metadata.yaml").write_text(yaml.safe_dump(described))
    copy.parent.mkdir()
    run = start("replay_recording.py", source, "--page", "--speed", 0.5, "--record", copy)
    page = Watched(run)
    page.ask(paused=1)
    paused = page.until(lambda state: state["paused"] == 1)
    assert paused["may_seek"] == 0
    page.ask(seek=1.0)
    assert [page.until(lambda _: True) for _ in range(10)] == 10 * [paused]
    page.ask(paused=0)
    code, out, errors = run.finish()
    assert (code, errors) == (0, "")
    assert "replay: not moved to 1.0 s: seeking is off while a copy is recorded" in out
    with BagSource(source) as one, BagSource(copy) as other:
        assert one.stored() == other.stored() and other.stored()["driver"] == "Anna, second shift"
    of_source, of_copy = read(source), read(copy)
    assert [r.interface for r in of_copy] == [TRUCK] and of_copy[0].notes == of_source[0].notes == NOTES
    assert data_hash(of_copy) == data_hash(of_source)
