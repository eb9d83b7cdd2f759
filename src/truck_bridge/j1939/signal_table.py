"""The signals of the DBC as a table: `python -m truck_bridge.j1939.signal_table > docs/j1939_signals.csv`."""

from __future__ import annotations

from truck_bridge.j1939.codec import Codec, Layout, Signal, load

HEAD = "message,PGN,period,signal,SPN,position,bits,unit,resolution,offset,lowest,highest"


def table(codec: Codec) -> str:
    """The table, as CSV: a row a signal."""
    rows = (_row(layout, signal) for layout in codec.by_name.values() for signal in layout.signals.values())
    return "\n".join([HEAD, *rows]) + "\n"


def _row(layout: Layout, signal: Signal) -> str:
    byte, bit = divmod(signal.start, 8)
    position = f"{byte + 1}.{bit + 1}" if signal.bits < 8 else f"{byte + 1}"
    if signal.bits > 8:
        position += f"-{byte + signal.bits // 8}"
    period = f"{layout.period_s * 1e3:g} ms" if layout.period_s else "on request or change"
    number = (f"{signal.scale:.8g}", f"{signal.offset:g}", f"{signal.offset:g}")
    highest = f"{signal.offset + signal.scale * signal.last:.7g}"
    where = (signal.name, str(signal.spn or "own"), position, str(signal.bits), signal.unit or "-")
    return ",".join((layout.name, str(layout.pgn), period, *where, *number, highest))


if __name__ == "__main__":
    print(table(load()), end="")
