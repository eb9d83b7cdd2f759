"""`truck-bridge`: what it prints, and that bad input is one line and exit code 2."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter

import can
import pytest

from truck_bridge import cli
from truck_bridge.bus import open_bus
from truck_bridge.can_logs import read

LINE = "({:.6f}) can0 0CF00400#219B9BDD2F000F9B\n"


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["truck-bridge", *map(str, arguments)])
    with pytest.raises(SystemExit) as done:
        cli.main()
    return done.value.code


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "drive.log"
    command = "(0.05) can0 0C00002A#E2FFFF9BFFFFFFFF\n"
    path.write_text("".join(LINE.format(k / 100) for k in range(5)) + command)
    return path


def test_decode_prints_the_table_and_writes_the_csv(monkeypatch, capsys, log, tmp_path):
    out = tmp_path / "out.csv"
    assert run(monkeypatch, "decode", log, "--vehicle", "volvo", "--out", out) == 0
    assert run(monkeypatch, "check", log, "--vehicle", "volvo") == 1
    before = out.read_text()
    assert before.startswith("time,source,signal,value,unit\n")
    assert run(monkeypatch, "decode", log, "--vehicle", "trucksim", "--out", out) == 2
    assert "exists already" in capsys.readouterr().err
    assert out.read_text() == before


@pytest.mark.parametrize("name", ["drive.csv", "DRIVE.CSV", "drive.parquet", "empty.csv"])
def test_a_table_of_signals_is_refused_by_one_line_that_names_the_import(monkeypatch, capsys, tmp_path, name):
    table = tmp_path / name
    table.write_text("" if name == "empty.csv" else "time,speed\n0,1\n")
    for command in ("decode", "check"):
        assert run(monkeypatch, command, table, "--vehicle", "volvo") == 2
        says = capsys.readouterr().err
        assert says.count("\n") == 1 and f"'deeptruck-model import {table} --columns" in says


def test_what_is_replayed_can_be_recorded_and_commands_stay_off(monkeypatch, capsys, log, tmp_path):
    channel, out = f"{os.getpid()}-replay", tmp_path / "copy.asc"
    bus = ("--interface", "loopback", "--channel", channel)
    main = "from truck_bridge.cli import main; main()"
    program = [sys.executable, "-c", main, "record", str(out), *bus]
    with subprocess.Popen(program) as recorder, open_bus("loopback", channel) as probe:

        def spoken_until(identifier, count):
            """Frames of another identifier keep the bus busy, so that the recorder writes what it has."""
            while not out.exists() or out.read_text().count(f" {identifier}x ") < count:
                assert recorder.poll() is None
                probe.send(can.Message(arbitration_id=0x18FEF100, data=[0]))
                time.sleep(0.02)

        try:
            spoken_until("18FEF100", 1)
            assert run(monkeypatch, "replay", log, *bus) == 0
            assert run(monkeypatch, "replay", log, *bus, "--commands") == 0
            spoken_until("C00002A", 1)  # the last that was sent
            recorder.send_signal(signal.SIGTERM)
            assert recorder.wait() == 0
        finally:
            recorder.kill()  # else a failure above waits for it for ever
    frames = Counter(frame.can_id for frame in read(out))
    assert frames.pop(0x18FEF100) > 0
    assert frames == {0x0CF00400: 10, 0x0C00002A: 1}


@pytest.mark.parametrize("suffix", [".log", ".mcap", ".blf"])
def test_a_silent_bus_is_no_recording(monkeypatch, capsys, tmp_path, suffix):
    out, channel = tmp_path / f"silent{suffix}", f"{os.getpid()}-silent"
    options = ("--interface", "loopback", "--channel", channel, "--duration", "0.3")
    assert run(monkeypatch, "record", out, *options) == 2
    assert f"nothing was received on loopback {channel}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["decode", "none.log", "--vehicle", "volvo"], "does not exist"),
        (["decode", "LOG", "--vehicle", "tram"], "no vehicle 'tram'"),
        (["decode", "LOG", "--vehicle", "volvo", "--out", "LOG/out.csv"], "cannot write"),
        (["replay", "LOG", "--interface", "warp", "--channel", "x"], "cannot open CAN interface"),
        (["replay", "LOG", "--interface", "loopback", "--channel", "x", "--speed", "inf"], "--speed"),
        (["convert", "LOG", "a.xyz"], "ends in .log"),
        (["record", "a.log", "--interface", "loopback", "--channel", "x", "--duration", "-1"], "--duration"),
        (["record", "a.log", "--interface", "socketcan", "--channel", "none9"], "cannot open CAN interface"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(monkeypatch, capsys, log, arguments, says):
    assert run(monkeypatch, *[a.replace("LOG", str(log)) for a in arguments]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.startswith("truck-bridge: ")
    assert err.count("\n") == 1


def test_convert_makes_a_rosbag_and_overwrites_nothing(monkeypatch, capsys, log):
    bag = log.with_suffix(".mcap")
    assert run(monkeypatch, "convert", log, bag) == 0
    assert len(list(read(bag))) == 6
    assert run(monkeypatch, "convert", log, bag) == 2
