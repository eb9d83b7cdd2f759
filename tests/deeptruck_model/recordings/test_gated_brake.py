"""The brake command of a truck whose brake is only a switch: from tables, other bags and CAN logs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import write_csv
from foreign_bags import Message, S, bag_of, number, twist

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import Recording, gated_brake, import_table, read

T = np.round(0.1 * np.arange(300), 3)
ON = (T >= 10.0) & (T < 15.0)  # the brake holds 2 m/s^2
COASTS = (T >= 20.0) & (T < 25.0)  # 0.5 m/s^2 without the brake
ACCELERATION = np.where(ON, -2.0, np.where(COASTS, -0.5, 0.3))
SPEED = 20.0 + np.concatenate([[0.0], np.cumsum(ACCELERATION[1:])]) * 0.1
DERIVED = {"derive": "deceleration", "gate": "brake_switch"}
COLUMNS: dict[str, Any] = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "speed": {"column": "v", "unit": "m/s"},
        "engine_command": {"column": "E", "unit": "percent"},
        "brake_switch": {"column": "S"},
        "brake_command": DERIVED,
    },
}


def table(path: Path, switch: Any) -> Path:
    return write_csv(path, {"t": T, "v": SPEED, "E": np.full(len(T), 20.0), "S": switch})


def check(recording: Recording) -> None:
    assert recording.interface.brake_unit == "m/s^2" and "brake_command" in recording.interface.u
    assert gated_brake.NOTE in recording.notes
    command = recording.channels["brake_command"]
    np.testing.assert_allclose(command[102:149], 2.0, atol=1e-6)
    assert not command[:99].any() and not command[152:].any()  # coasting is no braking
    assert set(recording.channels["brake_switch"]) == {0.0, 1.0}


def test_a_table_gates_the_deceleration_that_is_derived_from_speed(tmp_path: Path) -> None:
    (recording,) = import_table(
        table(tmp_path / "drive.csv", ON.astype(int)), COLUMNS, tmp_path / "bag"
    ).recordings
    check(recording)
    (again,) = read(tmp_path / "bag")
    check(again)


def test_where_the_switch_says_error_the_command_is_not_known(tmp_path: Path) -> None:
    switch = np.where(T < 5.0, 3, ON.astype(int))
    (recording,) = import_table(table(tmp_path / "drive.csv", switch), COLUMNS, tmp_path / "bag").recordings
    assert np.isnan(recording.channels["brake_command"][:49]).all()
    assert np.isnan(recording.channels["brake_switch"][:49]).all()
    assert recording.channels["brake_command"][120] == pytest.approx(2.0)


def test_a_bag_with_other_topics(tmp_path: Path) -> None:
    messages: list[Message] = []
    for t, v, on in zip(T, SPEED, ON, strict=True):
        ns = S + round(t * 1e9)
        messages += [("/speed", twist(v, ns), ns), ("/switch", number(float(on)), ns)]
        messages += [("/engine", number(20.0), ns)]
    bag = bag_of(tmp_path / "bag", messages)
    topics = {
        "speed": {"topic": "/speed", "field": "twist.linear.x"},
        "engine_command": {"topic": "/engine", "field": "data", "unit": "percent"},
        "brake_switch": {"topic": "/switch", "field": "data"},
        "brake_command": DERIVED,
    }
    (recording,) = read(bag, topic_map=topics)
    check(recording)
    (imported,) = import_table(bag, topics, tmp_path / "ours").recordings
    check(imported)


def can_log(path: Path, **switch: Any) -> Path:
    """Speed, driver's demand, and the brake switch (n,) under the name of its signal, if any."""
    codec = pytest.importorskip("truck_bridge.j1939").load()
    lines = []
    for k, (t, v) in enumerate(zip(T, SPEED, strict=True)):
        sent = {
            "CCVS1": {"WheelBasedVehicleSpeed": 3.6 * v, **{s: float(x[k]) for s, x in switch.items()}},
            "EEC1": {"DriversDemandPercentTorque": 20.0},
        }
        for name, values in sent.items():
            frame = f"{codec[name].can_id(0):08X}#{codec[name].encode(values).hex()}"
            lines.append(f"({t:.6f}) can0 {frame}\n")
    path.write_text("".join(lines))
    return path


def test_a_can_log_has_the_switch_of_its_cruise_control_message(tmp_path: Path) -> None:
    log = can_log(tmp_path / "drive.log", BrakeSwitch=ON)
    (recording,) = import_table(log, {"channels": {"brake_command": DERIVED}}, tmp_path / "bag").recordings
    assert read(tmp_path / "bag")[0].interface == recording.interface
    assert recording.interface.brake_unit == "m/s^2"
    command = recording.channels["brake_command"]
    assert np.nanmedian(command[102:148]) == pytest.approx(2.0, abs=0.1)  # 1/256 km/h on the bus
    assert not command[:99].any() and not command[152:].any()
    (plain,) = import_table(log, {}, tmp_path / "plain").recordings
    assert plain.interface.brake_unit is None and plain.channels["brake_switch"][120] == 1.0


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"derive": "deceleration"}, "can be derived by {derive: deceleration, gate: brake_switch} alone"),
        ({**DERIVED, "gate": "gear"}, "not by {derive: deceleration, gate: gear}"),
        ({**DERIVED, "unit": "bar"}, "unit: bar"),
        (DERIVED, "brake_command is derived where brake_switch is on: name that channel too"),
    ],
)
def test_another_derivation_is_refused(tmp_path: Path, entry: dict[str, str], says: str) -> None:
    channels = {k: v for k, v in COLUMNS["channels"].items() if k != "brake_switch" or entry is not DERIVED}
    csv = table(tmp_path / "drive.csv", ON.astype(int))
    with pytest.raises(InputError) as error:
        import_table(csv, {**COLUMNS, "channels": {**channels, "brake_command": entry}}, tmp_path / "bag")
    assert says in str(error.value) and not (tmp_path / "bag").exists()


def test_a_log_without_the_switch_says_so(tmp_path: Path) -> None:
    log = can_log(tmp_path / "drive.log")
    with pytest.raises(InputError, match="holds no brake_switch, by which a brake command could be derived"):
        import_table(log, {"channels": {"brake_command": DERIVED}}, tmp_path / "bag")
