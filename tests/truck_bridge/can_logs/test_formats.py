"""Every format of CAN logs: one class of tests that each format inherits, as in python-can's own."""

from __future__ import annotations

import gzip
import importlib.util
from pathlib import Path
from typing import ClassVar

import can
import pytest

from deeptruck_core.account import Account
from deeptruck_core.formats import Kind as LogKind
from deeptruck_core.formats import kind_of
from truck_bridge import can_logs
from truck_bridge.can_logs.frames import Frame, Kind
from truck_bridge.can_logs.lines import CUT, NO_FRAME
from truck_bridge.can_logs.reader import STANDARD, every
from truck_bridge.can_logs.rosbag import RosbagWriter
from truck_bridge.errors import InputError

URGENT = 0x00000003  # TSC1 of priority 0: its value would fit 11 bits
EEC1, CCVS1 = 0x0CF00400, 0x18FEF100
START = 1777885200.0


def message(k: int, can_id: int = EEC1, data: bytes | None = None, **fields: object) -> can.Message:
    usual = {
        "timestamp": START + 0.01 * k, "arbitration_id": can_id, "channel": "can0",
        "data": bytes([k % 256, 54, 0, 255, 1, 2, 3, 4]) if data is None else data,
    }  # fmt: skip
    return can.Message(**{**usual, **fields})


DRIVE = [message(k, can_id) for k in range(30) for can_id in (EEC1, CCVS1, URGENT)]
CLASSES = [
    message(0),
    message(1, 0x123, b"\x01", is_extended_id=False),
    message(2, 0x18EAFF00, b"", is_remote_frame=True, dlc=3),
    message(3, EEC1, bytes(16), is_fd=True, bitrate_switch=True),
    message(4, 0x040, bytes(8), is_error_frame=True),
]
NAMES = {"standard": STANDARD} | {kind.name.lower(): kind.value for kind in Kind}


def taken(path: Path, **options: str) -> tuple[list[Frame], Account]:
    """What is read of one bus, and its account, which must balance."""
    account = Account(str(path), "frames")
    frames = list(can_logs.read(path, account, **options))
    assert account.balanced, list(account.lines())
    return frames, account


def reasons(account: Account) -> dict[str, int]:
    return {reason: entry.count for reason, entry in account.total.aside.items()}


class OfAFormat:
    """What holds for each format. `holds` are the classes of frames that it can hold, `buses` the names of
    can0 and can1."""

    name: ClassVar[str]
    holds: ClassVar[set[str]] = {"standard", "remote", "fd", "error"}
    buses: ClassVar[tuple[str, ...]] = ("can0", "can1")

    def write(self, path: Path, messages: list[can.Message]) -> Path:
        """By the writer of python-can."""
        with can.Logger(path / self.name) as log:
            for one in messages:
                log.on_message_received(one)
        return path / self.name

    @pytest.fixture
    def drive(self, tmp_path: Path) -> Path:
        return self.write(tmp_path, DRIVE)

    def test_frames_are_those_that_were_written(self, drive: Path) -> None:
        frames, account = taken(drive)
        assert [(f.can_id, f.data, f.extended) for f in frames] == [
            (m.arbitration_id, bytes(m.data), True) for m in DRIVE
        ]
        assert frames[-1].time - frames[0].time == pytest.approx(0.29, abs=2e-3)
        assert account.total.used == len(DRIVE) and not account.total.aside
        assert kind_of(drive) is LogKind.FRAMES or drive.suffix == ".mcap"

    def test_classes_are_counted_apart(self, tmp_path: Path) -> None:
        kept = [m for m, name in zip(CLASSES, ("data", "standard", "remote", "fd", "error"), strict=True)
                if name in {"data", *self.holds}]  # fmt: skip
        frames, account = taken(self.write(tmp_path, kept))
        assert [f.can_id for f in frames] == [EEC1]
        assert reasons(account) == {NAMES[name]: 1 for name in self.holds}

    def test_buses_keep_their_names(self, tmp_path: Path) -> None:
        both = [message(k, channel=f"can{k % 2}") for k in range(20)]
        path, account = self.write(tmp_path, both), Account("", "frames")
        assert {f.channel for f in every(path, account)} == {*self.buses}
        if len(self.buses) > 1:
            frames, account = taken(path, channel=self.buses[1])
            assert len(frames) == 10 and reasons(account) == {"frames of other buses": 10}

    def test_packed_it_is_the_same(self, drive: Path) -> None:
        packed = drive.with_name(f"packed{drive.suffix}.gz")
        packed.write_bytes(gzip.compress(drive.read_bytes()))
        assert taken(packed)[0] == taken(drive)[0]
        packed.write_bytes(packed.read_bytes()[:-40])
        with pytest.raises(InputError, match=r"packed\S+ cannot be unpacked"):
            taken(packed)

    def test_under_a_suffix_of_nothing_it_is_refused(self, drive: Path) -> None:
        with pytest.raises(InputError, match=r"renamed\.xyz is no CAN log that can be read here"):
            taken(drive.rename(drive.with_name("renamed.xyz")))

    def test_another_file_of_this_suffix_is_one_line(self, drive: Path) -> None:
        for content in (b"", b"rubbish\nof two lines\n" * 9, b"\x00\x01\xff" * 99):
            drive.write_bytes(content)
            with pytest.raises(InputError, match=drive.name) as error:
                taken(drive)
            assert "\n" not in str(error.value)


class OfLines(OfAFormat):
    """What holds for each format of lines, of which a killed recorder leaves half a one."""

    def test_a_last_line_that_was_cut_off_is_counted(self, drive: Path) -> None:
        text = drive.read_text().rstrip("\n")
        for kept in (4, 9, 20):  # characters that lack
            drive.write_text(text[:-kept])
            frames, account = taken(drive)
            assert len(frames) == len(DRIVE) - 1 and reasons(account) == {CUT: 1}

    def test_what_is_no_frame_is_counted_or_refused_with_its_line(self, drive: Path) -> None:
        lines = drive.read_text().splitlines(keepends=True)
        drive.write_text("".join([*lines[:-10], lines[-10][:-8] + "\n", *lines[-9:]]))
        try:
            frames, account = taken(drive)
        except InputError as error:
            assert f"line {len(lines) - 9}" in str(error) and "\n" not in str(error)
        else:
            assert len(frames) == len(DRIVE) - 1 and sum(reasons(account).values()) == 1


class TestCandump(OfLines):
    name = "drive.log"

    def write(self, path: Path, messages: list[can.Message]) -> Path:
        """With error frames as candump has them; python-can's writer leaves out their identifier."""
        flags = {m.timestamp: 0x2000_0000 for m in messages if m.is_error_frame}
        lines = (_logged(m, flags.get(m.timestamp, 0)) for m in messages)
        (path / self.name).write_text("".join(lines))
        return path / self.name


def _logged(m: can.Message, flags: int) -> str:
    digits = f"{m.arbitration_id | flags:0{8 if m.is_extended_id else 3}X}"
    data = f"R{m.dlc}" if m.is_remote_frame else ("#1" if m.is_fd else "") + bytes(m.data).hex().upper()
    return f"({m.timestamp:.6f}) {m.channel} {digits}#{data}\n"


class TestConsole(OfLines):
    """candump on a terminal, with all columns, and text decoded below."""

    name = "drive.log"

    def write(self, path: Path, messages: list[can.Message]) -> Path:
        (path / self.name).write_text("".join(map(_printed, messages)))
        return path / self.name


def _printed(m: can.Message) -> str:
    flag = 0x2000_0000 if m.is_error_frame else 0
    digits = f"{m.arbitration_id | flag:0{8 if m.is_extended_id else 3}X}"
    size = f"[{len(m.data):02d}]" if m.is_fd else f" [{m.dlc}]"
    data = "remote request" if m.is_remote_frame else bytes(m.data).hex(" ").upper()
    behind = "   ERRORFRAME" if m.is_error_frame else ""
    return f" ({m.timestamp:.6f})  {m.channel}  RX - -  {digits}  {size}  {data}{behind}\n"


class TestAsc(OfLines):
    name, buses = "drive.asc", ("1", "2")

    def write(self, path: Path, messages: list[can.Message]) -> Path:
        super().write(path, messages)
        lines = (path / self.name).read_text().splitlines(keepends=True)
        (path / self.name).write_text("".join(line for line in lines if "End Trigger" not in line))
        return path / self.name


class TestTrc(OfLines):
    name, holds, buses = "drive.trc", {"standard"}, ("1", "2")


class TestBlf(OfAFormat):
    name, buses = "drive.blf", ("1", "2")

    def test_a_copy_that_is_not_whole_is_refused(self, drive: Path) -> None:
        drive.write_bytes(drive.read_bytes()[:-9])
        with pytest.raises(InputError, match=r"has \d+ bytes, but \d+ were written"):
            taken(drive)


class TestLibraryCsv(OfAFormat):
    name, holds, buses = "drive.csv", {"standard", "remote", "error"}, ("1",)


class TestRosbag(OfAFormat):
    name, holds = "drive.mcap", {"standard", "remote", "error"}

    def write(self, path: Path, messages: list[can.Message]) -> Path:
        log = RosbagWriter(path / self.name)
        for one in messages:
            log.on_message_received(one)
        log.stop()
        return path / self.name

    def test_of_a_killed_recorder_whole_chunks_are_read(self, drive: Path) -> None:
        drive.write_bytes(drive.read_bytes()[:-300])
        frames, account = taken(drive)
        assert frames and "was not finished" in account.remarks[0]


if importlib.util.find_spec("asammdf"):

    class TestMf4(OfAFormat):
        name, buses = "drive.mf4", ("0", "1")


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


DATA = "21 9B 9B DD 2F 00 0F 9B"
FORMS = {  # lines of consoles, each of one frame of EEC1
    "plain": f" (000.010000)  can0  0CF00400   [8]  {DATA}\n",
    "with a date": f" (2026-01-02 03:04:05.678901)  can0  0CF00400   [8]  {DATA}\n",
    "with characters": f" (010.02)  can0  TX B E  0CF00400   [8]  {DATA}   '!../.../'\n",
    "with flags": f"(10.0) can0 8CF00400#{DATA.replace(' ', '')} R\n",
    "decoded behind": f"(1.0)  can0  0CF00400   [8]  {DATA} :: CCVS1(x: 1)\n",
    "time of day": f"08:00:00.0000 0CF00400 [8] {DATA}\n",
}
MORE = {  # and lines that are no frame
    "text above": "Truck 7, key on, depot to yard\n\nTime,ID,DLC,Data\n",
    "decoded below": "CCVS1(\n    WheelBasedVehicleSpeed: 54.0 km/h\n)\n",
    "an error explained": "\tcontroller-problem{rx-error-warning}\n",
    "half a byte": "(1.2) can0 0CF00400#219B9BD\n",
    "another length": "(1.0)  can0  0CF00400   [7]  21 9B\n",
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("more", MORE)
def test_forms_of_candump_beside_text(tmp_path: Path, form: str, more: str) -> None:
    path = written(tmp_path / "a.log", MORE[more] + FORMS[form] + MORE[more] + FORMS[form])
    frames, account = taken(path)
    assert [(f.can_id, f.data) for f in frames] == [(EEC1, bytes.fromhex(DATA))] * 2
    lines = 2 * sum(bool(line.strip()) for line in MORE[more].splitlines())
    assert reasons(account) == {NO_FRAME: lines}


def test_a_second_written_as_a_million_microseconds_is_a_second(tmp_path: Path) -> None:
    """As asc2log wrote it before 2021: can-utils, pull request 286."""
    times = ("1614188634.980000", "1614188634.1000000", "1614188635.020000")
    lines = "".join(f"({time}) can0 0CF00400#219B9BDD2F000F9B R\n" for time in times)
    frames, _ = taken(written(tmp_path / "a.log", lines))
    assert [f.time - 1614188635 for f in frames] == pytest.approx([-0.02, 0.0, 0.02], abs=1e-6)


def asc(*lines: str, base: str = "hex", stamps: str = "absolute") -> str:
    head = f"date Fri Jan 2 03:04:05.000 am 2026\nbase {base}  timestamps {stamps}\ninternal events logged\n"
    return head + "".join(f"{line}\n" for line in lines)


def test_relative_times_of_asc_add_up(tmp_path: Path) -> None:
    lines = [f"0.100000 1  CF00400x Rx   d 8 {DATA}"] * 5
    frames, _ = taken(written(tmp_path / "a.asc", asc(*lines, stamps="relative")))
    assert [f.time for f in frames] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])


def test_decimal_asc_and_its_other_lines(tmp_path: Path) -> None:
    data = " ".join(str(byte) for byte in bytes.fromhex(DATA))
    text = asc(
        "0.000000 Start of measurement",
        f"0.010000 1  {EEC1}x Rx d 8 {data}",
        "0.020000 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.03%",
        "0.030000 1  ErrorFrame",
        f"0.040000 1  {EEC1}x TxRq d 8 {data}",
        "0.060000 1 J1939TP FEE3p 6 0 0 - Rx d 39 A0 0F",
        "End TriggerBlock",
        base="dec",
    )
    frames, account = taken(written(tmp_path / "a.asc", text))
    assert [(f.can_id, f.data) for f in frames] == [(EEC1, bytes.fromhex(DATA))]
    assert reasons(account) == {NO_FRAME: 2, "error frames": 1, "requests to transmit (TxRq)": 1}


def test_status_lines_of_trc_are_counted(tmp_path: Path) -> None:
    path = TestTrc().write(tmp_path, DRIVE)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:-1], lines[-1].replace("DT", "ST"), lines[-1]]) + "\n")
    frames, account = taken(path)
    assert len(frames) == len(DRIVE) and reasons(account) == {NO_FRAME: 1}
