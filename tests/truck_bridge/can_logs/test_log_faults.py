"""Faults and the truck's number out of logs: told by decode, and kept by the recording that is imported."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.recordings import import_table, read
from truck_bridge import can_logs, cli
from truck_bridge.j1939 import load

REAL = Path(os.environ.get("DEEPTRUCK_REAL_DATA", "../shared/data")) / "j1939_csu" / "normal.log"
CLEAR = bytes.fromhex("00FF00000000FFFF")
HOT = bytes.fromhex("10FF6E001001")  # red stop lamp, SPN 110 FMI 16 once
NUMBER = b"1M8GDM9AXKP042788*"


def split(time, data, pgn, source=0, destination=0xFF):
    """A message of several frames, as its sender says it: BAM, or RTS of which nobody else is received."""
    count, kind = -(-len(data) // 7), 32 if destination == 0xFF else 16
    head = bytes([kind, len(data), 0, count, 0xFF, *pgn.to_bytes(3, "little")])
    yield time, 0x1CEC0000 | destination << 8 | source, head
    for k in range(count):
        part = data[7 * k : 7 * k + 7]
        yield (
            time + 0.05 * (k + 1),
            0x1CEB0000 | destination << 8 | source,
            bytes([k + 1]) + part.ljust(7, b"\xff"),
        )


def dm1(time, data, source=0):
    if len(data) > 8:
        return list(split(time, data, 0xFECA, source))
    return [(time, 0x18FECA00 | source, data.ljust(8, b"\xff"))]


def drive(seconds=30.0):
    """Speed and engine command at 10 Hz."""
    codec = load()
    sent = {"CCVS1": {"WheelBasedVehicleSpeed": 36.0}, "EEC1": {"DriversDemandPercentTorque": 41.0}}
    return [
        (k / 10, codec[name].can_id(0), codec[name].encode(values))
        for k in range(round(seconds * 10))
        for name, values in sent.items()
    ]


def log(tmp_path, *parts):
    path = tmp_path / "drive.log"
    frames = sorted(frame for part in parts for frame in part)
    path.write_text("".join(f"({t:.6f}) can0 {i:08X}#{d.hex()}\n" for t, i, d in frames))
    return path


def overheating(tmp_path):
    """No fault until 10 s; then too hot, from 15 s on derated as well; none from 20 s on."""
    two = HOT + bytes.fromhex("21061F01")
    said = [dm1(t, CLEAR if t < 10 or t >= 20 else HOT if t < 15 else two) for t in range(30)]
    number = split(3.2, NUMBER, 0xFEEC, destination=0xF9)
    return log(tmp_path, drive(), *said, number)


def test_decode_tells_faults_and_number(tmp_path):
    lines = list(can_logs.table(can_logs.decode(overheating(tmp_path))))
    assert "vehicle number (VIN) 1M8GDM9AXKP042788, said by 0x00" in lines
    assert "faults (DM1) of 0x00: active were" in lines
    assert "  SPN 110 FMI 16 (0x00), occurred 1 times: said 10 times, 10.00 to 19.10 s" in lines
    assert "  red_stop_lamp (0x00): said 10 times, 10.00 to 19.10 s" in lines
    assert "  SPN 1569 FMI 31 (0x00), occurred 1 times: said 5 times, 15.10 to 19.10 s" in lines
    assert not any("left out" in line for line in lines)
    quiet = list(can_logs.table(can_logs.decode(log(tmp_path, drive(1.0), dm1(0.5, CLEAR, 3)))))
    assert "faults (DM1) of 0x03: none was active" in quiet


def test_the_recording_has_channels_of_faults_and_keeps_the_number(tmp_path):
    imported = import_table(overheating(tmp_path), {}, tmp_path / "bag")
    (recording,) = read(imported.bag)
    time, hot = recording.time, recording.channels["fault_spn"]
    begins = {
        name: time[np.argmax(recording.channels[name] > 0)] for name in ("fault_count", "derate_active")
    }
    assert begins == pytest.approx({"fault_count": 10.0, "derate_active": 15.1})
    assert set(hot[(time > 10) & (time < 15)]) == {110.0}
    assert set(hot[(time > 15.3) & (time < 19)]) == {1569.0}
    assert set(recording.channels["fault_fmi"][(time > 10) & (time < 15)]) == {16.0}
    assert set(recording.channels["red_stop_lamp"]) == {0.0, 1.0}
    assert not recording.channels["fault_count"][time > 25.1].any()
    assert "VIN 1M8GDM9AXKP042788 (0x00)" in recording.notes
    assert any(note.startswith("active faults: SPN 110 FMI 16 (0x00), red_stop") for note in recording.notes)


def test_a_log_without_dm1_has_no_such_channels(tmp_path):
    channels, interface = can_logs.import_can_log(log(tmp_path, drive(2.0)), {})
    assert set(channels) == {"speed", "engine_command"}
    assert "notes" not in interface


@pytest.mark.parametrize("kept", [1, 2])
def test_a_dm1_that_is_cut_off_is_said_and_nothing_of_it_is_kept(monkeypatch, capsys, tmp_path, kept):
    two = dm1(1.5, HOT + bytes.fromhex("21061F01"))
    path, out = log(tmp_path, drive(2.0), dm1(0.5, CLEAR), two[:kept]), tmp_path / "out.csv"
    monkeypatch.setattr(
        sys, "argv", ["truck-bridge", "decode", str(path), "--vehicle", "volvo", "--out", str(out)]
    )
    with pytest.raises(SystemExit) as done:
        cli.main()
    told = capsys.readouterr()
    assert (done.value.code, told.err) == (0, "")
    assert "left out: DM1 of 0x00: cut off (1)" in told.out
    assert "faults (DM1) of 0x00: none was active" in told.out
    assert out.read_text().count("EngineSpeed") == 0 and out.read_text().count("\n") == 41
    channels, interface = can_logs.import_can_log(path, {})
    assert channels["fault_count"][1].tolist() == [0.0]
    assert interface["notes"] == ["messages of several frames left out: DM1 of 0x00: cut off (1)"]


def test_content_that_is_none_is_said(tmp_path):
    odd = split(0.5, bytes(13), 0xFECA)
    nothing = split(1.0, b"\xff" * 18, 0xFEEC)
    found = can_logs.decode(log(tmp_path, drive(2.0), odd, nothing))
    (said,) = [line for line in can_logs.table(found) if "left out" in line]
    assert "DM1 of 0x00: not lamps and whole codes (1)" in said
    assert "VIN of 0x00: no number (1)" in said


def test_time_that_runs_backwards_does_not_reach_the_channels(tmp_path):
    path = tmp_path / "twice.log"
    at = [(1.0, CLEAR), (2.0, HOT), (0.5, HOT), (2.0, CLEAR), (3.0, CLEAR)]
    frames = [frame for time, data in at for frame in dm1(time, data)]
    path.write_text("".join(f"({t:.6f}) can0 {i:08X}#{d.hex()}\n" for t, i, d in [*drive(0.3), *frames]))
    channels, _ = can_logs.import_can_log(path, {})
    assert channels["fault_count"][0].tolist() == [1.0, 2.0, 3.0]
    assert channels["fault_count"][1].tolist() == [0.0, 1.0, 1.0]


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there (set DEEPTRUCK_REAL_DATA)")
def test_the_faults_of_a_real_truck():
    """Its engine misses wheel speeds and lights the malfunction lamp; two controllers share one address."""
    found = can_logs.decode(REAL)
    assert not found.unreadable and {one.source for one in found.faults} == {0x00, 0x03, 0x31}
    channels, _ = can_logs.import_can_log(REAL, {})
    time, count = channels["fault_count"]
    assert len(time) == 91 and set(count) == {3.0, 5.0}
    assert set(channels["fault_spn"][1]) == {5357.0, 829.0}
    assert set(channels["red_stop_lamp"][1]) == set(channels["derate_active"][1]) == {0.0}
    late = time - time[0] > 23.0
    assert set(channels["amber_warning_lamp"][1][late]) == {1.0}  # also between the two that say so
