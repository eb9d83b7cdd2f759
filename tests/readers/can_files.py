"""CAN logs and vehicle files that a user may give: how small valid ones are made, and how they are read."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can

from truck_bridge import can_logs, j1939, vehicles
from truck_bridge.can_logs.rosbag import RosbagWriter


def _frames() -> Iterator[can.Message]:
    for k in range(30):
        for can_id, data in (
            (0x0CF00400, bytes([0xF1, 125 + k, 125 + k, 0x40, 0x1F, 0, 0xFF, 0xFF])),
            (0x18FEF100, bytes([0xFF, k, 40, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF])),
        ):
            yield can.Message(timestamp=1.6e9 + 0.1 * k, arbitration_id=can_id, data=data, channel="can0")


def can_log(suffix: str) -> Callable[[Path], Path]:
    """A log by python-can."""

    def made(folder: Path) -> Path:
        with can.Logger(str(folder / f"log.{suffix}")) as log:
            for message in _frames():
                log.on_message_received(message)
        return folder / f"log.{suffix}"

    return made


def candump_console(folder: Path) -> Path:
    """As candump prints it."""
    lines = (
        f" ({m.timestamp:.6f})  can0  {m.arbitration_id:08X}   [8]  {bytes(m.data).hex(' ').upper()}\n"
        for m in _frames()
    )
    (folder / "console.log").write_text("".join(lines))
    return folder / "console.log"


def can_rosbag(folder: Path) -> Path:
    """Raw frames in a rosbag."""
    writer = RosbagWriter(folder / "log.mcap")
    for message in _frames():
        writer.on_message_received(message)
    writer.stop()
    return folder / "log.mcap"


def read_can(file: Path) -> Any:
    """The frames, and what an import makes of them; not its account, which says what was damaged."""
    channels, interface = can_logs.import_can_log(file, {})
    interface.pop("account")
    return list(map(tuple, can_logs.read(file))), (channels, interface)


def read_blf(file: Path) -> Any:
    """As read_can, but of times only the differences: those of the file's head have no checksum."""
    frames = list(can_logs.read(file))
    return [(round(f.time - frames[0].time, 3), f.can_id, f.data) for f in frames]


def vehicle_yaml(folder: Path) -> Path:
    """A vehicle file of the package."""
    return Path(shutil.copy(Path(vehicles.__file__).parent / "trucksim.yaml", folder / "mine.yaml"))


def read_vehicle(file: Path) -> Any:
    """All of a vehicle but its DBC."""
    vehicle = vehicles.load(file)
    return vehicle.table, vehicle.interface, vehicle.reference_torque, vehicle.transmitted


def dbc(folder: Path) -> Path:
    """A vehicle's own DBC file."""
    text = vehicle_yaml(folder).read_text()
    (folder / "mine.yaml").write_text(text + "\ndbc: [own.dbc]\n")
    (folder / "own.dbc").write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: ECU\nBO_ 2566834943 Own: 8 ECU\n'
        ' SG_ Level : 0|8@1+ (0.4,0) [0|100] "%" ECU\n'
        ' SG_ Heat : 8|16@1+ (0.03125,-273) [-273|1735] "degC" ECU\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566834943 3;\n'
    )
    return folder / "own.dbc"


def read_dbc(file: Path) -> Any:
    """The vehicle beside it."""
    j1939.load.cache_clear()
    return repr(vehicles.load(file.with_name("mine.yaml")).codec["Own"])
