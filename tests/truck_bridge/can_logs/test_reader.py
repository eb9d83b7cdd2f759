"""Nothing of a CAN log is lost, merged or misread in silence: buses, clocks, other lines."""

from __future__ import annotations

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from deeptruck_core.account import Account
from deeptruck_model.recordings import import_table, read
from truck_bridge import can_logs, vehicles
from truck_bridge.can_logs.frames import Kind
from truck_bridge.can_logs.reader import every
from truck_bridge.errors import InputError
from truck_bridge.j1939 import load

URGENT = 0x00000003  # TSC1 of priority 0 from the transmission to the engine: its value would fit 11 bits
TORQUE = bytes.fromhex("FDFFFFFFFFFFFFFF")
EEC1 = bytes.fromhex("219B9BDD2F000F9B")
SUFFIXES = ["log", "asc", "blf", "trc", "mcap"]


def written(tmp_path, text, name="drive.log"):
    path = tmp_path / name
    path.write_text(text)
    return path


def taken(path, **options):
    """What is read of one bus, and its account, which must balance."""
    account = Account(str(path), "frames")
    frames = list(can_logs.read(path, account, **options))
    assert account.balanced, list(account.lines())
    return frames, account


def reasons(account):
    return {reason: entry.count for reason, entry in account.total.aside.items()}


def recorded(tmp_path, suffix, messages):
    """A log by the writer of its kind."""
    if suffix == "mcap":
        from truck_bridge.can_logs.rosbag import RosbagWriter

        log = RosbagWriter(tmp_path / "drive.mcap")
        for message in messages:
            log.on_message_received(message)
        log.stop()
    else:
        with can.Logger(str(tmp_path / f"drive.{suffix}")) as logger:
            for message in messages:
                logger.on_message_received(message)
    return tmp_path / f"drive.{suffix}"


def message(k, can_id=URGENT, data=TORQUE, **fields):
    return can.Message(
        **{"timestamp": 1.6e9 + 0.01 * k, "arbitration_id": can_id, "data": data, "channel": "can0", **fields}
    )


def test_the_most_urgent_demand_is_seen_by_every_command(tmp_path):
    """`decode`, `check`, and `convert` into each form and back see what priority 0 demands of the engine."""
    lines = [f"({k / 100:.6f}) can0 {URGENT:08X}#{TORQUE.hex().upper()}\n" for k in range(100)]
    log = written(tmp_path, "".join(lines))
    truck = vehicles.load("trucksim")
    for suffix in SUFFIXES:
        if suffix != "log":
            can_logs.convert(log, tmp_path / f"out.{suffix}")
        path = log if suffix == "log" else tmp_path / f"out.{suffix}"
        found = can_logs.decode(path)
        assert len(found.series["TSC1", "OverrideControlModePriority", 3][0]) == 100, suffix
        assert can_logs.check(path, truck).frames == 100, suffix


def two_trucks(seconds=3.0):
    """Frames of two buses with other speeds, as (time, bus, identifier, data)."""
    codec = load()
    for k in range(round(10 * seconds)):
        for bus, speed in (("can0", 36.0), ("can1", 72.0)):
            for sent, values in (
                ("CCVS1", {"WheelBasedVehicleSpeed": speed}),
                ("EEC1", {"DriversDemandPercentTorque": 41.0}),
            ):
                yield k / 10, bus, codec[sent].can_id(0), codec[sent].encode(values)


@pytest.fixture
def both(tmp_path):
    lines = (f"({t:.6f}) {bus} {i:08X}#{d.hex().upper()}\n" for t, bus, i, d in two_trucks())
    return written(tmp_path, "".join(lines))


def test_two_buses_are_said_and_one_is_chosen(both, tmp_path):
    with pytest.raises(InputError, match=r"can0 with 60 frames, can1 with 60 frames.*--channel"):
        can_logs.decode(both)
    frames, account = taken(both, channel="can1")
    assert (len(frames), reasons(account)) == (60, {"frames of other buses": 60})
    with pytest.raises(InputError, match=r"on can2.*can0 with 60"):
        can_logs.decode(both, channel="can2")
    with pytest.raises(InputError, match="'channel: NAME' in the columns file"):
        import_table(both, {}, tmp_path / "none")
    imported = import_table(both, {"channel": "can1"}, tmp_path / "bag").recordings
    assert imported[0].channels["speed"] == pytest.approx(20.0, abs=0.01)


def drive(start=0.0, seconds=20.0, speed=36.0):
    """Lines of candump, ten a second and signal."""
    codec, lines = load(), []
    for k in range(round(10 * seconds)):
        for sent, values in (
            ("CCVS1", {"WheelBasedVehicleSpeed": speed + 0.01 * k}),
            ("EEC1", {"DriversDemandPercentTorque": 41.0}),
        ):
            data = codec[sent].encode(values).hex().upper()
            lines.append(f"({start + k / 10:.6f}) can0 {codec[sent].can_id(0):08X}#{data}\n")
    return lines


@pytest.mark.parametrize("ahead", [3600.0, 40 * 365 * 86400.0, -50.0])
@pytest.mark.parametrize("count", [1, 5])
def test_a_frame_stamped_far_off_costs_itself_alone(tmp_path, ahead, count):
    lines = drive(start=100.0)
    for k in range(count):
        lines[200 + k] = lines[200 + k].replace(
            lines[200 + k][: lines[200 + k].index(")")], f"({150 + ahead}"
        )
    log = written(tmp_path, "".join(lines))
    frames, account = taken(log)
    assert len(frames) == 400 - count
    assert list(reasons(account).values()) == [count] and "stamped far" in next(iter(reasons(account)))
    (recording,) = import_table(log, {}, tmp_path / "bag").recordings
    assert recording.time[-1] - recording.time[0] == pytest.approx(19.9, abs=0.1)


@pytest.mark.parametrize("second", [0.0, 5.0, 3 * 365 * 86400.0])
def test_sessions_whose_clock_begins_again_are_pieces(tmp_path, second):
    """Cut, not spliced; both keep all frames, and `import` keeps both."""
    log = written(tmp_path, "".join(drive(start=1000.0) + drive(start=second, speed=72.0)))
    frames, account = taken(log)
    assert (len(frames), reasons(account)) == (800, {})
    assert len(account.spans) == 2 and any("time jumps" in remark for remark in account.remarks)
    found = import_table(log, {}, tmp_path / "bag").recordings
    assert [len(r.time) for r in found] == [200, 200]
    assert [r.channels["speed"][0] for r in found] == pytest.approx([10.0, 20.0], abs=0.01)
    assert any("time jumps" in note for note in read(tmp_path / "bag")[0].notes)


def test_a_log_cut_off_is_said_by_import_too(tmp_path):
    log = written(tmp_path, "".join(drive())[:-9])
    imported = import_table(log, {}, tmp_path / "bag")
    assert reasons(imported.recordings[0].account) == {"frame cut off at the end of the log": 1}
    assert any("cut off in its last line" in note for note in read(tmp_path / "bag")[0].notes)


ASC = "date Fri Jan 2 03:04:05.000 am 2026\nbase hex  timestamps {base}\ninternal events logged\n{lines}"


def asc(*lines, base="absolute"):
    return ASC.format(base=base, lines="".join(f"{line}\n" for line in lines))


CONSOLE = [
    " (010.000000)  can0  0CF00400   [8]  21 9B 9B DD 2F 00 0F 9B",
    " (010.010000)  can0  RX - -  0CF00400   [8]  21 9B 9B DD 2F 00 0F 9B",
    " (010.020000)  can0  TX B E  0CF00400   [8]  21 9B 9B DD 2F 00 0F 9B   '!../.../'",
    " (2026-01-02 03:04:05.030000)  can0  0CF00400   [8]  21 9B 9B DD 2F 00 0F 9B",
    " (010.000000)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME",
    "\tcontroller-problem{rx-error-warning}",
    " (010.040000)  can0  18EAFF00   [3]  remote request",
    " (010.050000)  can0  123   [2]  01 02",
    " (010.060000)  can0  0CF00400  [08]  21 9B 9B DD 2F 00 0F 9B",
]


@pytest.mark.parametrize(
    ("digits", "kind", "can_id"),
    [
        ("8CF00400", Kind.DATA, 0x0CF00400),
        ("D8EAFF00", Kind.REMOTE, 0x18EAFF00),
        ("20000004", Kind.ERROR, 4),
    ],
)
def test_flags_of_socketcan_are_no_part_of_an_identifier(tmp_path, digits, kind, can_id):
    log = written(tmp_path, f"(10.0) can0 {digits}#0102030405060708\n")
    (frame,) = every(log, Account(str(log), "frames"))
    assert (frame.kind, frame.can_id) == (kind, can_id)


def classes():
    """One frame of each class."""
    return [
        message(0, 0x0CF00400, EEC1),
        message(1, 0x123, b"\x01", is_extended_id=False),
        message(2, 0x18EAFF00, None, is_remote_frame=True, dlc=3),
        message(3, 0x0CF00400, EEC1 * 2, is_fd=True, bitrate_switch=True),
        message(4, 0x040, bytes(8), is_error_frame=True),
    ]


@pytest.mark.parametrize(
    ("suffix", "lost"),
    [
        ("log", set()),
        ("asc", set()),
        ("blf", set()),
        ("mcap", {Kind.FD}),
        ("trc", {Kind.FD, Kind.REMOTE, Kind.ERROR}),
    ],
)
def test_convert_keeps_each_class_or_says_so(tmp_path, suffix, lost):
    source = recorded(tmp_path, "log", classes())
    out = tmp_path / f"out.{suffix}"
    account = can_logs.convert(source, out)
    assert account.balanced and account.total.read == 5
    assert reasons(account) == {f"{kind.value}, which .{suffix} cannot hold": 1 for kind in lost}
    kept = list(every(out, Account(str(out), "frames")))
    expected = [f for f in every(source, Account(str(source), "frames")) if f.kind not in lost]
    assert [f.kind for f in kept] == [f.kind for f in expected]
    for frame, wanted in zip(kept, expected, strict=True):
        if frame.kind is not Kind.ERROR:
            assert frame[1:3] + frame[4:6] == wanted[1:3] + wanted[4:6]
            assert frame.kind is not Kind.REMOTE or frame.length == wanted.length
    assert "11-bit" in " ".join(reasons(taken(out)[1]))


LINES = [
    *CONSOLE,
    "(11.5) can1 00000003#FD",
    "(9.0) can0 123#01",
    "(12.0) can0 0CF00400##1AABB",
    "(13.0) can0 18EA00FF#R3",
    "# a comment",
    "",
    "(4000000000.0) can0 0CF00400#00",
]
EVENTS = [
    "0.1 1 CF00400x Rx d 2 01 02",
    "-0.5 2 00000003x Tx d 1 FD",
    "0.2 1 123 Rx d 0",
    "9.9 1 ErrorFrame",
    "0.3 CANFD 1 Rx 18F00400x 1 0 8 8 1 2 3 4 5 6 7 8",
    "0.4 1 Statistic: D 1",
    "// none",
    "0.5 1 100 Rx r",
    "0.6 1 EngineSpeed Rx d 1 01",
]


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lines=st.lists(st.tuples(st.sampled_from(LINES), st.sampled_from(EVENTS)), max_size=40),
    data=st.data(),
)
def test_the_account_balances_on_any_log(tmp_path, lines, data):
    """Each line that is no header or comment is used, set aside for a reason, or refuses the log."""
    candump = "".join(line + "\n" for line, _ in lines)
    texts = {"any.log": candump, "any.asc": asc(*(event for _, event in lines))}
    for file, whole in texts.items():
        cut = data.draw(st.integers(0, len(whole)))
        junk = data.draw(st.sampled_from(["", "\x00", "zz", "\n", "9"]))
        damaged = whole[:cut] + junk + whole[cut:]
        for text in (whole, damaged, whole[:cut]):
            path = written(tmp_path, text, file)
            for channel in (None, "can0", "1"):
                account = Account(str(path), "frames")
                try:
                    frames = list(can_logs.read(path, account, channel=channel))
                except InputError as error:
                    assert "\n" not in str(error) and str(path) in str(error)
                    continue
                assert account.balanced, list(account.lines())
                assert account.total.used == len(frames)


def test_two_senders_of_a_signal_are_said(tmp_path):
    """The one with more samples is taken, and the import says that there is another."""
    layout, lines = load()["CCVS1"], drive()
    for k in range(400):
        data = layout.encode({"WheelBasedVehicleSpeed": 85.0}).hex().upper()
        lines.append(f"({k / 20:.6f}) can0 {layout.can_id(0x31):08X}#{data}\n")
    log = written(tmp_path, "".join(sorted(lines, key=lambda line: float(line[1 : line.index(")")]))))
    imported = import_table(log, {}, tmp_path / "bag").recordings[0]
    (remark,) = [r for r in imported.account.remarks if "WheelBasedVehicleSpeed" in r]
    assert "taken from 0x31 (400 samples), and is sent by 0x00 (200 samples) too" in remark


def test_times_that_are_differences_are_refused(tmp_path):
    """As 'candump -t d' prints them: 0.1 s between groups, little within."""
    lines = [
        line.replace(line[1 : line.index(")")], f"{0.1 if k % 2 == 0 else 0.0002:09.6f}")
        for k, line in enumerate(drive())
    ]
    with pytest.raises(InputError, match=r"times of 200 of 400 frames go back.*candump -t a") as error:
        can_logs.decode(written(tmp_path, "".join(lines)))
    assert "\n" not in str(error.value)


def test_a_clock_of_fractions_alone_is_said(tmp_path):
    """As an adapter that stamps 0 to 1 s again and again."""
    lines = [
        line.replace(line[1 : line.index(")")], f"{0.01 * k % 1:09.6f}") for k, line in enumerate(drive())
    ]
    with pytest.raises(InputError, match=r"times begin again 3 times, and none lasts longer than 0\.99 s"):
        can_logs.decode(written(tmp_path, "".join(lines)))


def test_replay_takes_one_bus_of_several(both):
    with pytest.raises(InputError, match="replay: --log-channel NAME"):
        can_logs.replay(both, "loopback", "no-bus")
    account = Account(str(both), "frames")
    assert can_logs.replay(both, "loopback", "replayed", speed=1000.0, of="can1", account=account) == 60
    assert reasons(account) == {"frames of other buses": 60}
