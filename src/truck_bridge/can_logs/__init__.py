"""CAN logs in and out: read, decode, import as channels, record, replay."""

from truck_bridge.can_logs.decoding import Decoding, decode, table, write_csv
from truck_bridge.can_logs.importing import import_can_log
from truck_bridge.can_logs.live import record, replay
from truck_bridge.can_logs.reader import Frame, read

__all__ = ["Decoding", "Frame", "decode", "import_can_log", "read", "record", "replay", "table", "write_csv"]
