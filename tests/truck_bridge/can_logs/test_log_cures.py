"""Every cure that a refused CAN log names, followed as it is written, gives the values that were driven."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table
from truck_bridge import can_logs
from truck_bridge.j1939 import load

SPEED, DEMAND, PEDAL = 10.0, 41.0, 30.0  # m/s, %, %
DRIVEN = {"CCVS1": {"WheelBasedVehicleSpeed": 3.6 * SPEED}, "EEC1": {"DriversDemandPercentTorque": DEMAND}}
BY_PEDAL = {"CCVS1": DRIVEN["CCVS1"], "EEC2": {"AcceleratorPedalPosition": PEDAL}}


def frames(sent: dict[str, dict[str, float]], bus: str = "can0", seconds: float = 60.0) -> list[str]:
    """Lines of candump at 10 Hz, each behind its time."""
    codec = load()
    return [
        f"({k / 10:.6f}) {bus} {codec[name].can_id(0):08X}#{codec[name].encode(values).hex()}\n"
        for k in range(round(seconds * 10))
        for name, values in sent.items()
    ]


def written(path: Path, *parts: Sequence[str]) -> Path:
    lines = [line for part in parts for line in part]
    path.write_text("".join(sorted(lines, key=lambda line: float(line[1 : line.index(")")]))))
    return path


def imported(path: Path, meaning: dict[str, Any], out: Path) -> tuple[float, float]:
    """Mean speed and engine command of the bag."""
    (recording,) = import_table(path, meaning, out).recordings
    return (
        float(np.mean(recording.channels["speed"])),
        float(np.nanmean(recording.channels["engine_command"])),
    )


def refusal(act: Callable[[], Any]) -> str:
    with pytest.raises(InputError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_pedal_becomes_the_engine_command_as_the_message_has_it(tmp_path: Path) -> None:
    path = written(tmp_path / "pedal.log", frames(BY_PEDAL))
    says = refusal(lambda: imported(path, {}, tmp_path / "none"))
    cure = re.search(r"its pedal can be one: (channels: \{.*\})$", says)
    assert cure is not None, says
    found = imported(path, yaml.safe_load(cure[1]), tmp_path / "bag")
    assert found == pytest.approx((SPEED, PEDAL), abs=0.3)


@pytest.mark.parametrize(
    ("meaning", "says", "cured"),
    [
        ({"vehicel": "trucksim"}, r"known: .*\b(vehicle)$", lambda said: {said: "trucksim"}),
        (
            {"channels": {"engine_command": {"signal": "EEC1.DriversDemand"}}},
            r"known: .*\b(DriversDemandPercentTorque)",
            lambda said: {"channels": {"engine_command": {"signal": f"EEC1.{said}"}}},
        ),
        (
            {"channels": {"engine_command": "EEC1"}},
            r"needs (\{signal: MESSAGE\.SIGNAL), source",
            lambda said: {
                "channels": {
                    "engine_command": yaml.safe_load(
                        said.replace("MESSAGE.SIGNAL", "EEC1.DriversDemandPercentTorque") + "}"
                    )
                }
            },
        ),
    ],
)
def test_a_name_that_is_listed_is_one(
    tmp_path: Path, meaning: dict[str, Any], says: str, cured: Callable[[str], dict[str, Any]]
) -> None:
    path = written(tmp_path / "drive.log", frames(DRIVEN))
    refused = refusal(lambda: imported(path, meaning, tmp_path / "none"))
    named = re.search(says, refused)
    assert named is not None, refused
    assert imported(path, cured(named[1]), tmp_path / "bag") == pytest.approx((SPEED, DEMAND), abs=0.1)


def test_a_table_is_for_import_and_is_read_there(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("t,v,e\n" + "".join(f"{k / 10:.1f},{SPEED},{DEMAND}\n" for k in range(600)))
    says = refusal(lambda: can_logs.decode(path))
    assert f"'deeptruck-model import {path} --columns COLUMNS.yaml --out BAG' reads tables" in says
    channels = {"speed": {"column": "v", "unit": "m/s"}, "engine_command": {"column": "e", "unit": "percent"}}
    meaning = {"time": {"column": "t", "unit": "s"}, "channels": channels}
    assert imported(path, meaning, tmp_path / "bag") == pytest.approx((SPEED, DEMAND), abs=1e-3)
