"""What a log's signals are, and which of them become channels."""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.recordings import import_table, read
from truck_bridge import can_logs
from truck_bridge.can_logs import convert, import_can_log
from truck_bridge.errors import InputError
from truck_bridge.j1939 import load

REAL = Path(os.environ.get("DEEPTRUCK_REAL_DATA", "../shared/data")) / "j1939_csu" / "normal.log"
real = pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there (set DEEPTRUCK_REAL_DATA)")
CONSOLE = " (000.010000)  can0  0CF00400   [8]  21 9B 9B DD 2F 00 0F 9B\n"
LOGGED = "(1436509052.249713) can0 0CF00400#219B9BDD2F000F9B\n"
FRAME = bytes.fromhex("219B9BDD2F000F9B")


def written(tmp_path, text, name="a.log"):
    path = tmp_path / name
    path.write_text(text)
    return path


def j1939_drive(speed, torque=lambda k: 150, senders=(0xEE,), pgn=0xFE6C):
    """TCO1, or another message with a speed in km/h in its last two bytes, and EEC1, at 10 Hz."""
    lines = []
    for k in range(200):
        for sender in senders:
            raw = round(speed(k, sender) * 256).to_bytes(2, "little").hex()
            data = "FFFFFFFFFFFF" + raw if pgn == 0xFE6C else "FF" + raw + "FFFFFFFFFF"
            lines.append(f"({k / 10:.3f}) can0 0C{pgn:04X}{sender:02X}#{data}\n")
        lines.append(f"({k / 10 + 0.001:.3f}) can0 0CF00400#F1{torque(k):02X}{torque(k):02X}000FFFFFFF\n")
    return "".join(lines)


def test_the_speed_of_a_tachograph(tmp_path):
    log = written(tmp_path, j1939_drive(lambda k, _: 50 + k / 10))
    (r,) = import_table(log, {}, tmp_path / "bag").recordings
    np.testing.assert_allclose(r.channels["speed"], (50 + np.arange(200) / 10) / 3.6, atol=0.01)


def test_a_sender_that_says_zero_all_along_is_not_taken(tmp_path):
    log = written(
        tmp_path, j1939_drive(lambda k, s: 50 + k / 10 if s else 0.0, senders=(0, 0x0B), pgn=0xFEF1)
    )
    (r,) = import_table(log, {}, tmp_path / "bag").recordings
    assert r.channels["speed"].min() > 13 and any("all 0" in note for note in r.notes)


def test_a_torque_byte_of_zero_is_no_torque(tmp_path):
    """As an engine controller sends that ends: -125 %."""
    log = written(tmp_path, j1939_drive(lambda k, _: 50 + k / 10, lambda k: 150 if k < 190 else 0))
    (r,) = import_table(log, {"reference_torque": 2000}, tmp_path / "bag").recordings
    assert np.nanmin(r.channels["engine_command"]) == pytest.approx(25.0)
    assert np.nanmin(r.channels["engine_torque"]) == pytest.approx(500.0)
    assert np.isnan(r.channels["engine_command"][195:]).all()
    assert any("Torque of -125 %, a byte of zero, left out" in note for note in r.notes)


def test_signals_that_no_channel_needs_are_not_kept(tmp_path):
    path = written(tmp_path, LOGGED * 3)
    every = can_logs.decode(path)
    some = can_logs.decode(path, only=frozenset({("EEC1", "EngineSpeed")}))
    key = ("EEC1", "EngineSpeed", 0)
    assert len(every.series) > 3 and [*some.series] == [key] and some.frames == 3
    assert some.series[key] == every.series[key] and not some.invalid


def drive(tmp_path, pedal=math.nan, seconds=2.0):
    """A log of 10 Hz frames: speed rises by 0.36 km/h a frame, torque 40 %, friction 10 %."""
    codec, lines = load(), []
    for k in range(round(seconds * 10)):
        frames = {
            "CCVS1": {"WheelBasedVehicleSpeed": 36 + 0.36 * k},
            "EEC1": {"EngineSpeed": 1200.0, "ActualPercentTorque": 40.0, "DriversDemandPercentTorque": 41.0},
            "EEC3": {"NominalFrictionPercentTorque": 10.0},
            "EBC1": {"BrakePedalPosition": pedal},
            "LFE1": {"EngineFuelRate": 36.0},
            "VDS": {"Pitch": 1.0},
        }
        for name, values in frames.items():
            layout = codec[name]
            lines.append(
                f"({k / 10:.6f}) can0 {layout.can_id(0):08X}#{layout.encode(values).hex().upper()}\n"
            )
    return written(tmp_path, "".join(lines))


def test_import_gives_si_channels_and_the_interface(tmp_path):
    channels, interface = import_can_log(drive(tmp_path, pedal=12.0), {"reference_torque": 2000})
    account = interface.pop("account")
    assert (account.total.read, account.total.used, account.sources) == (120, 120, {"can0": 120})
    assert interface == {
        "name": "a",
        "engine_unit": "percent",
        "brake_unit": "percent",
        "grade": True,
        "fuel": True,
    }
    time, speed = channels["speed"]
    assert speed == pytest.approx(10 + time, abs=1e-3)
    expected = {
        "engine_speed": 1200 * math.pi / 30,
        "engine_torque": 600.0,
        "engine_command": 41.0,
        "brake_command": 12.0,
        "fuel_rate": 10.0,
        "grade": math.tan(math.radians(1.0)),
    }
    for name, value in expected.items():
        assert channels[name][1] == pytest.approx(value, rel=1e-6), name
    assert "acceleration" not in channels


def test_raw_frames_in_a_rosbag_import_as_the_log_does(tmp_path):
    log = drive(tmp_path, pedal=12.0)
    convert(log, tmp_path / "drive.mcap")
    recordings = [
        import_table(source, {"reference_torque": 2000}, tmp_path / f"bag{source.suffix}").recordings[0]
        for source in (log, tmp_path / "drive.mcap")
    ]
    assert {*recordings[0].channels} == {*recordings[1].channels} > {"speed", "engine_torque"}
    for name, values in recordings[0].channels.items():
        assert recordings[1].channels[name] == pytest.approx(values, abs=1e-6, nan_ok=True), name


def test_what_is_not_available_is_left_out(tmp_path):
    channels, interface = import_can_log(drive(tmp_path), {})
    assert interface["brake_unit"] is None
    assert "engine_torque" not in channels  # no reference torque is known


def test_columns_choose_other_signals(tmp_path):
    columns = {
        "vehicle": "volvo",
        "name": "mine",
        "channels": {"engine_command": {"signal": "EEC1.ActualPercentTorque", "source": 0}},
    }
    channels, interface = import_can_log(drive(tmp_path), columns)
    assert interface["name"] == "mine"
    assert channels["engine_command"][1] == pytest.approx(40.0)
    assert channels["engine_torque"][1] == pytest.approx(0.3 * 2600)


def test_a_chosen_command_has_the_unit_of_its_signal(tmp_path):
    """Fuel drives, and a demanded deceleration brakes; a demand to accelerate brakes by nothing."""
    codec, lines = load(), []
    for k in range(100):
        sent = {
            "CCVS1": {"WheelBasedVehicleSpeed": 36.0},
            "LFE1": {"EngineFuelRate": 36.0},
            "XBR": {"ExternalAccelerationDemand": -2.0 if k < 50 else 1.0},
        }
        frames = [(codec[name].can_id(0), codec[name].encode(values)) for name, values in sent.items()]
        lines += [f"({k / 10:.6f}) can0 {i:08X}#{data.hex()}\n" for i, data in frames]
    log = written(tmp_path, "".join(lines), "fuel.log")
    chosen = {
        "engine_command": {"signal": "LFE1.EngineFuelRate"},
        "brake_command": {"signal": "XBR.ExternalAccelerationDemand"},
    }
    channels, interface = import_can_log(log, {"channels": chosen})
    assert (interface["engine_unit"], interface["brake_unit"]) == ("cm^3/s", "m/s^2")
    assert channels["engine_command"][1] == pytest.approx(10.0, abs=0.01)
    brake = channels["brake_command"][1]
    assert brake[:50] == pytest.approx(2.0, abs=0.001) and not brake[50:].any()
    import_table(log, {"channels": chosen}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert (recording.interface.engine_unit, recording.interface.brake_unit) == ("cm^3/s", "m/s^2")
    speed = {"channels": {"brake_command": {"signal": "CCVS1.WheelBasedVehicleSpeed"}}}
    with pytest.raises(InputError, match="brake_command cannot be in 'km/h'; choose a signal in %, m/s"):
        import_can_log(log, speed)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"speed": {"column": "v"}}, "unknown key 'speed'"),
        ({"channels": {"speed": {"column": "v"}}}, "channel speed needs"),
        ({"channels": {"speed": {"signal": "CCVS1.Speed"}}}, "CCVS1 has no signal 'Speed'"),
        ({"channels": {"speed": {"signal": "XYZ.Speed"}}}, "no message 'XYZ'"),
        ({"channels": {"speed": {"signal": "ETC2.CurrentGear"}}}, "no valid sample of ETC2.CurrentGear"),
        ({"channels": {"speed": {"signal": "CCVS1.WheelBasedVehicleSpeed", "source": 5}}}, "no valid sample"),
        ({"reference_torque": "much"}, "reference_torque is 'much'"),
        ({"vehicle": "tram"}, "no vehicle 'tram'"),
    ],
)
def test_bad_columns_are_one_line(tmp_path, columns, says):
    with pytest.raises(InputError, match=says):
        import_can_log(drive(tmp_path), columns)


def test_a_log_without_speed_or_command_is_refused(tmp_path):
    with pytest.raises(InputError, match="no vehicle speed"):
        import_can_log(written(tmp_path, CONSOLE), {})
    speed = load()["CCVS1"].encode({"WheelBasedVehicleSpeed": 36.0}).hex()
    with pytest.raises(InputError, match="no engine command"):
        import_can_log(written(tmp_path, f"(0.0) can0 18FEF100#{speed}\n"), {})
    pedal = load()["EEC2"].encode({"AcceleratorPedalPosition": 20.0}).hex()
    with pytest.raises(InputError, match=r"its pedal can be one: .*EEC2\.AcceleratorPedalPosition"):
        import_can_log(written(tmp_path, f"(0.0) can0 18FEF100#{speed}\n(0.1) can0 0CF00300#{pedal}\n"), {})


def test_the_table_and_the_csv(tmp_path):
    found = can_logs.decode(drive(tmp_path))
    lines = list(can_logs.table(found))
    assert lines[0].startswith("120 frames")
    (speed,) = (line for line in lines if line.startswith("CCVS1.WheelBasedVehicleSpeed"))
    assert "  84 " in speed
    assert "km/h" in speed
    (brake,) = (line for line in lines if line.startswith("EBC1.BrakePedalPosition"))
    assert brake.endswith(" 20 not available")
    can_logs.write_csv(found, tmp_path / "out.csv")
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [r["value"] for r in rows if r["signal"] == "EEC1.EngineSpeed"] == ["1200.0"] * 20
    with pytest.raises(InputError, match="exists already"):
        can_logs.write_csv(found, tmp_path / "out.csv")
    with pytest.raises(InputError, match="cannot write"):
        can_logs.write_csv(found, tmp_path / "out.csv" / "out.csv")


def test_frames_that_are_not_in_the_dbc_are_counted(tmp_path):
    text = "".join(f"(1.{k}00000) can0 18FF7721#0102030405060708\n" for k in range(3))
    assert can_logs.decode(written(tmp_path, text)).unknown == {0xFF77: 3}


def test_time_that_runs_backwards_is_counted_and_said(tmp_path):
    lines = [f"({at}) can0 0CF00400#219B9BDD2F000F9B\n" for at in (1.0, 1.1, 0.5, 0.6, 0.4)]
    found = can_logs.decode(written(tmp_path, "".join(lines)))
    (said,) = [line for line in can_logs.table(found) if "time runs backwards" in line]
    assert "time runs backwards 3 times, by 0.700 s at most" in said
    forwards = can_logs.decode(written(tmp_path, "".join(lines[:2])))
    assert not forwards.account.remarks


@real
def test_the_recording_of_a_real_truck_decodes():
    found = can_logs.decode(REAL)
    assert found.frames == 19957
    assert found.reference_torque == 1109.0
    speed = found.series["CCVS1", "WheelBasedVehicleSpeed", 0]
    assert len(speed[0]) == 300
    assert found.invalid["EBC1", "BrakePedalPosition", 0x0B] == {"not available": 299}
    assert ("EBC1", "BrakePedalPosition", 0x0B) not in found.series


@real
def test_the_recording_of_a_real_truck_imports():
    channels, interface = import_can_log(REAL, {})
    assert interface["brake_unit"] is None
    speed = channels["speed"][1]
    assert (speed.min(), speed.max()) == (pytest.approx(6.445, abs=1e-3), pytest.approx(15.252, abs=1e-3))
    assert set(channels["gear"][1]) == {2.0, 3.0, 4.0}
    time, turning = channels["engine_speed"]
    assert len(time) == 1499
    assert np.all(np.diff(time) > 0)
    assert 120 < turning.min() < turning.max() < 188
    assert channels["engine_torque"][1].max() == pytest.approx(366, abs=1)
