"""A recorded replay is its source: the same samples, of the same truck."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from deeptruck_model import checks
from deeptruck_model.recordings import Recording, data_hash, read, write_bag
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_model.signals import TruckInterface

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


def test_the_recorded_copy_has_the_same_samples_and_names_the_truck(
    start: Callable[..., Any], tmp_path: Path, drive: Recording
) -> None:
    source, copy = tmp_path / "bag", tmp_path / "copies" / "bag"
    write_bag(source, [drive], interface=TRUCK)
    described = yaml.safe_load((source / "metadata.yaml").read_text())
    described["rosbag2_bagfile_information"]["custom_data"]["driver"] = "Anna, second shift"
    (source / "metadata.yaml").write_text(yaml.safe_dump(described))
    copy.parent.mkdir()
    code, _, errors = start("replay_recording.py", source, "--speed", 5, "--record", copy).finish()
    assert (code, errors) == (0, "")
    with BagSource(source) as one, BagSource(copy) as other:
        assert one.stored() == other.stored() and other.stored()["driver"] == "Anna, second shift"
    checks.same_truck([source, copy])
    checks.inputs(None, [copy])
    of_source, of_copy = read(source), read(copy)
    assert [r.interface for r in of_copy] == [TRUCK] and of_copy[0].notes == of_source[0].notes == NOTES
    assert data_hash(of_copy) == data_hash(of_source)
