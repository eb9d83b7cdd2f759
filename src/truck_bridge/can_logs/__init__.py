"""CAN logs in and out: read, decode, check, import as channels, record, replay, convert."""

from truck_bridge.can_logs.checking import Checked, check
from truck_bridge.can_logs.decoding import Decoding, decode, table, write_csv
from truck_bridge.can_logs.frames import Frame, Kind
from truck_bridge.can_logs.importing import import_can_log
from truck_bridge.can_logs.live import convert, record, replay
from truck_bridge.can_logs.reader import every, read

__all__ = [
    "Checked",
    "Decoding",
    "Frame",
    "Kind",
    "check",
    "convert",
    "decode",
    "every",
    "import_can_log",
    "read",
    "record",
    "replay",
    "table",
    "write_csv",
]
