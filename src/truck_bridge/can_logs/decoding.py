"""Decodes all signals of a log to numbers, text lines and CSV."""

from __future__ import annotations

import csv
import math
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from deeptruck_core import files
from deeptruck_core.account import Account
from truck_bridge import j1939
from truck_bridge.can_logs import faults
from truck_bridge.can_logs.faults import Said
from truck_bridge.can_logs.frames import Frame
from truck_bridge.can_logs.reader import read
from truck_bridge.j1939 import diagnostics
from truck_bridge.j1939.codec import Codec, Decoded, Signal
from truck_bridge.j1939.ids import pgn_of
from truck_bridge.j1939.transport import Broken, Message, Transport, reference_torque


@dataclass
class Decoding:
    """Signals of a log: (message, signal, source) to times and values; invalid samples are only counted.

    `only` names the messages and signals to keep, so that memory does not grow with the others; None keeps
    all.
    """

    codec: Codec
    only: frozenset[tuple[str, str]] | None = None
    series: dict[tuple[str, str, int], tuple[array[float], array[float]]] = field(default_factory=dict)
    invalid: dict[tuple[str, str, int], dict[str, int]] = field(default_factory=dict)
    frames: int = 0
    start: float = 0.0  # time of the first frame
    unknown: dict[int, int] = field(
        default_factory=dict
    )  # parameter groups that are not in the DBC, by count
    reference_torque: float = math.nan  # N m, from the engine's own configuration broadcast
    account: Account = field(default_factory=lambda: Account("", "frames"))  # of the log
    faults: list[Said] = field(default_factory=list)  # every DM1, in the log's order
    numbers: dict[int, str] = field(default_factory=dict)  # VIN by the address that says it
    unreadable: Counter[Broken] = field(default_factory=Counter)  # messages not whole, or not what they say

    def add(self, frame: Frame, decoded: Decoded) -> None:
        """Add one decoded frame."""
        for name, value in decoded.values.items():
            if self.only is not None and (decoded.name, name) not in self.only:
                continue
            key = (decoded.name, name, decoded.source)
            if value == value:
                series = self.series.get(key)
                if series is None:
                    series = self.series[key] = array("d"), array("d")
                series[0].append(frame.time)
                series[1].append(value)
            else:
                reasons = self.invalid.setdefault(key, {})
                reasons[decoded.flags[name]] = reasons.get(decoded.flags[name], 0) + 1

    def take(self, message: Message, time: float) -> None:
        """Add one complete message: reference torque, faults, or the vehicle identification number."""
        torque = reference_torque(message.pgn, message.data)
        if torque is not None:
            self.reference_torque = torque
        if message.pgn == diagnostics.DM1:
            report = diagnostics.report(message.data)
            if report is None:
                self.unreadable[Broken(message.pgn, message.source, "not lamps and whole codes")] += 1
            else:
                self.faults.append(Said(time, message.source, report))
        if message.pgn == diagnostics.VIN:
            number = diagnostics.vehicle_number(message.data)
            if number is None:
                self.unreadable[Broken(message.pgn, message.source, "no number")] += 1
            else:
                self.numbers[message.source] = number

    def signal(self, key: tuple[str, str, int]) -> Signal:
        """The DBC's entry for one of the keys."""
        return self.codec[key[0]].signals[key[1]]


def decode(
    path: Path,
    codec: Codec | None = None,
    *,
    channel: str | None = None,
    ascending: bool = False,
    only: frozenset[tuple[str, str]] | None = None,
) -> Decoding:
    """The signals of a log's bus, `only` some or all. `channel` and `ascending` are those of `read`. Raises
    InputError as `read` does."""
    found = Decoding(codec or j1939.load(), only, account=Account(str(path), "frames"))
    transport = Transport()
    for frame in read(path, found.account, channel=channel, ascending=ascending):
        found.start = frame.time if not found.frames else found.start
        found.frames += 1
        message = transport.hear(frame.can_id, frame.data, frame.time)
        message = message or diagnostics.single(frame.can_id, frame.data)
        if message is not None:
            found.take(message, frame.time)
        decoded = found.codec.decode(frame.can_id, frame.data)
        if decoded is not None:
            found.add(frame, decoded)
        elif pgn_of(frame.can_id) not in diagnostics.GROUPS:
            pgn = pgn_of(frame.can_id)
            found.unknown[pgn] = found.unknown.get(pgn, 0) + 1
    found.unreadable += transport.finish()
    return found


def table(found: Decoding) -> Iterator[str]:
    """Text lines of signal, source, SPN, samples, rate, range, and invalid values."""
    keys = sorted(set(found.series) | set(found.invalid))
    yield f"{found.frames} frames, {len(found.series)} signals with values"
    yield from found.account.lines()
    if found.reference_torque == found.reference_torque:
        yield f"engine reference torque {found.reference_torque:g} N m (SPN 544)"
    yield from faults.lines(found.faults, found.numbers, found.unreadable, found.start)
    yield f"{'signal':<38}{'source':>6}{'SPN':>7}{'valid':>8}{'Hz':>7}{'from':>13}{'to':>13} unit   invalid"
    for key in keys:
        times, values = found.series.get(key, (array("d"), array("d")))
        reasons = ", ".join(f"{count} {why}" for why, count in found.invalid.get(key, {}).items())
        span = f"{min(values):>13.6g}{max(values):>13.6g}" if values else f"{'-':>13}{'-':>13}"
        rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 and times[-1] > times[0] else 0.0
        signal = found.signal(key)
        name = f"{key[0]}.{key[1]}"
        left = f"{name:<38}  0x{key[2]:02X}{signal.spn:>7}{len(times):>8}{rate:>7.1f}"
        yield f"{left}{span} {signal.unit:<6} {reasons}".rstrip()
    if found.unknown:
        most = sorted(found.unknown.items(), key=lambda item: -item[1])
        shown = ", ".join(f"{pgn:#06x} ({count})" for pgn, count in most[:12])
        yield f"not in the DBC: {len(most)} parameter groups, {sum(found.unknown.values())} frames: {shown}"


def write_csv(found: Decoding, out: Path) -> None:
    """Write every valid sample as CSV, in order of time. Raises InputError if the file exists or cannot be
    written."""
    rows = sorted(
        (t, f"0x{key[2]:02X}", f"{key[0]}.{key[1]}", v, found.signal(key).unit)
        for key, (times, values) in found.series.items()
        for t, v in zip(times, values, strict=True)
    )
    with files.new_file(out) as draft, draft.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "source", "signal", "value", "unit"])
        writer.writerows(rows)
