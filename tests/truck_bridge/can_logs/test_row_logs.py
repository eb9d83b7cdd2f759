"""Frames in the rows of a table, as other programs write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_core.account import Account
from deeptruck_model.recordings import importing
from truck_bridge import can_logs
from truck_bridge.can_logs.frames import Kind
from truck_bridge.can_logs.reader import every
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import Identifier

FRAMES = [
    (1777885200.0 + 0.01 * k, can_id, bytes([k % 256, 54 + k % 20, 0, 255, 1, 2, 3, 4]))
    for k in range(60)
    for can_id in (0x0CF00400, 0x18FEF100, 0x18FEBF0B)
]


def cabana() -> str:
    return "time,addr,bus,data\n" + "".join(f"{t:.6f},{i},0,{d.hex()}\n" for t, i, d in FRAMES)


def kvaser() -> str:
    rows = (f"{t:.6f},0,{i},X,8,{','.join(map(str, d))},{k}" for k, (t, i, d) in enumerate(FRAMES))
    return (
        "Time,Channel,ID,Flags,DLC," + ",".join(f"Data{k}" for k in range(8)) + ",Counter\n" + "\n".join(rows)
    )


def savvycan(sign: str = "", start: int = 0) -> str:
    rows = (
        f"{sign}{start + round((t - 1777885200) * 1e6)},{i:08X},true,Rx,0,8,{d.hex(',').upper()},"
        for t, i, d in FRAMES
    )
    head = "Time Stamp,ID,Extended,Dir,Bus,LEN," + ",".join(f"D{k}" for k in range(1, 9)) + "\n"
    return head + "\n".join(rows) + "\n"


def clx000() -> str:
    """As loggers of the CLX000 series write: comments, and times of day behind the day of the month."""
    head = '# Logger type: CL2000\n# Value separator: ";"\n# Time format: 4\nTimestamp;Type;ID;Data\n'
    return head + "".join(
        f"31T235959{round(1000 * (t - FRAMES[0][0])):03d};1;{i:x};{d.hex()}\n" for t, i, d in FRAMES
    )


def epoch_decimal() -> str:
    """Decimal identifiers and bytes, one after another in a cell."""
    return "epoch;frame id;dlc;data\n" + "".join(
        f"{t:.6f};{i};8;{' '.join(map(str, d))}\n" for t, i, d in FRAMES
    )


def by_group(form: str) -> str:
    """PGN and addresses in place of the identifier, as J1939 tools write it."""
    rows = ((t, Identifier.of(i), d) for t, i, d in FRAMES)
    return "Time (s),Priority,PGN,DA,SA,Data\n" + "".join(
        f"{t:.6f},{k.priority:{form}},{k.pgn:{form}},{k.destination:{form}},{k.source:{form}},{d.hex()}\n"
        for t, k, d in rows
    )


def rows(head: str, row: Callable[[float, int, bytes], str]) -> str:
    return head + "".join(f"{row(t - 1777885200.0, i, d)}\n" for t, i, d in FRAMES)


VEHICLE_SPY = (
    "Vehicle Spy 3\nVersion,301\nData,Column,Meaning\n,Line,Number\n\n"
    "Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Arb ID,Remote,Xtd,"
    "B1,B2,B3,B4,B5,B6,B7,B8,Value\n"
)


LOGS: dict[str, str] = {
    "cabana.csv": cabana(), "kvaser.csv": kvaser(), "savvycan.csv": savvycan(),
    "falling.csv": savvycan("-", 1_769_872_318_000_000), "rising.csv": savvycan(start=-1_769_872_318_000_000),
    "clx.txt": clx000(), "decimal.csv": epoch_decimal(),
    "pgn.csv": by_group("d"), "pgn_hex.csv": by_group("X"),
    "flagged.csv": rows("time,id,length,data\n", lambda t, i, d: f"{t:.3f},{i | 1 << 31},8,{d.hex()}"),
    "flagged.tsv": rows("t\tcan_id\tdata\n", lambda t, i, d: f"{t:.3f}\t0x{i | 1 << 31:X}\t{d.hex()}"),
    "spy.csv": rows(VEHICLE_SPY, lambda t, i, d:
                    f"1,{t:.6f},0.01,67,F,F,HS CAN ${i:X},HS CAN,{i:X},F,T,{d.hex(',').upper()},"),
    "tshark.csv": rows('"frame.time_epoch","can.id","can.flags.xtd","can.len","data.data"\n', lambda t, i, d:
                       f'"{t:.6f}","{i}","1","8","{d.hex(":")}"'),
    "bytes.csv": rows("Time;Identifier;DLC;" + ";".join(f"Byte{k}" for k in range(8)) + "\n", lambda t, i, d:
                      f"{t:.3f};{i};8;" + ";".join(map(str, d))),
    "view.csv": rows("Time (ms);ID;Length;Data\n", lambda t, i, d:
                     f"{1000 * t:.1f};{i:08X}h;8;{d.hex(' ').upper()}"),
    "date.csv": rows("Timestamp,ID,Data\n", lambda t, i, d:
                     f"2026-05-04 23:59:{59 + t:09.6f},{i:08X},{d.hex()}"),
    "bare.csv": rows("", lambda t, i, d: f"{t:.4f},{i:08X},8,{d.hex().upper()}"),
    "text.txt": rows("My logger, v1\nkey on; depot\n\nTime,ID,DLC,Data\n", lambda t, i, d:
                     f"{t:.4f},{i:08X},8,{d.hex()}"),
}  # fmt: skip


@pytest.mark.parametrize("name", LOGS)
def test_frames_of_other_programs(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text(LOGS[name])
    account = Account(name, "frames")
    frames = list(can_logs.read(path, account))
    assert [(f.can_id, f.data, f.extended) for f in frames] == [(i, d, True) for _, i, d in FRAMES]
    assert frames[-1].time - frames[0].time == pytest.approx(0.59, abs=1e-4)
    assert account.balanced and account.total.used == len(FRAMES)
    assert not account.total.left_out
    assert importing.is_can_log(path)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.pcap", "a capture", "is no CAN log that can be read here: .* Wireshark convert"),
        ("a.csv", "time,addr,bus,data\n1.0,217056256,0,f0c0zz\n", "line 2: '1.0,217056256,0,f0c0zz'"),
        ("b.csv", "time,addr,dlc,data\n1.0,217056256,8,f0c0\n", "line 2: '1.0,217056256,8,f0c0'"),
        ("long.log", "(1.0) can0 18FEF100#FF\n" + 70_000 * "x", "line 2: longer than 65536"),
        ("long.trc", ";$FILEVERSION=1.1\n" + 70_000 * "x", "line 2: longer than 65536"),
        ("long.csv", "time,addr,bus,data\n" + 70_000 * "x", "line 2: longer than 65536"),
        ("e.csv", "ID,DLC,B1,B2,B3,B4,B5,B6,B7,B8\n18FEF100,8,1,2,3,4,5,6,7,8\n", "a column of times"),
        ("f.csv", "Time,DLC,B1,B2,B3,B4,B5,B6,B7,B8\n1.0,8,1,2,3,4,5,6,7,8\n", "a column of identifiers"),
        ("g.csv", "Time,CAN ID,DLC\n1.0,18FEF100,8\n", "without a column of bytes"),
        ("h.csv", '"No.","Time","Source","Protocol","Length","Info"\n"1","0.0","","CAN","16","ID: 1"\n',
         "without a column of identifiers and bytes"),
    ],
)  # fmt: skip
def test_damage_is_refused_with_its_place(tmp_path: Path, name: str, content: str, says: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=says):
        list(can_logs.read(tmp_path / name))


def test_can_fd_rows_of_a_table_are_counted_apart_by_length_code_or_mark(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;EDL;DataBytes\n"
        "1.00;1;18FEF100;1;8;8;0;FF0036CFFFFFFFFF\n"
        "1.01;1;18EF0A0B;1;9;12;1;ABABABABABABABABABABABAB\n"
        "1.02;1;18FEF100;1;8;8;1;FF0036CFFFFFFFFF\n"
    )
    (tmp_path / "code.csv").write_text("time,id,dlc,data\n1.0,18FEF10A,9,ABABABABABABABABABABABAB\n")
    account = Account("a.csv", "frames")
    assert len(list(can_logs.read(tmp_path / "a.csv", account))) == 1
    assert {reason: one.count for reason, one in account.total.aside.items()} == {"CAN FD frames": 2}
    assert [frame.kind for frame in every(tmp_path / "code.csv", Account("", "frames"))] == [Kind.FD]
