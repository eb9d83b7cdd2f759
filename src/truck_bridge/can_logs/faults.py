"""Faults in a log, as text lines, and as channels and notes of a recording."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from deeptruck_core.arrays import Array
from truck_bridge.faults import ActiveFaults, Fault
from truck_bridge.j1939.diagnostics import GROUPS, Report
from truck_bridge.j1939.transport import OTHERS, Broken


class Said(NamedTuple):
    """One DM1 of a log: time, controller, content."""

    time: float
    source: int
    report: Report


def lines(
    said: Sequence[Said], numbers: Mapping[int, str], broken: Counter[Broken], start: float
) -> Iterator[str]:
    """Text lines: the vehicle identification number, each fault with its times since the start, and
    incomplete messages."""
    for source, number in sorted(numbers.items()):
        yield f"vehicle number (VIN) {number}, said by 0x{source:02X}"
    found = _times(said)
    counted: dict[Fault, int] = {}
    for one in said:
        for code, count in one.report.counts.items():
            fault = Fault(one.source, code)
            counted[fault] = max(count, counted.get(fault, count))
    if said:
        senders = ", ".join(f"0x{source:02X}" for source in sorted({one.source for one in said}))
        yield f"faults (DM1) of {senders}: {'active were' if found else 'none was active'}"
    for fault, times in found.items():
        often = f", occurred {counted[fault]} times" if counted.get(fault, -1) >= 0 else ""
        span = f"said {len(times)} times, {times[0] - start:.2f} to {times[-1] - start:.2f} s"
        yield f"  {fault.what} (0x{fault.source:02X}){often}: {span}"
    yield from unread(broken)


def unread(broken: Counter[Broken]) -> Iterator[str]:
    """Text lines on messages that are incomplete or have invalid content."""
    if broken:
        counted = (
            f"{GROUPS.get(b.pgn, f'{b.pgn:#06x}')} of 0x{b.source:02X}: {b.why} ({n})"
            if b.pgn != OTHERS
            else f"others ({n})"
            for b, n in sorted(broken.items())
        )
        yield f"messages of several frames left out: {', '.join(counted)}"


def _times(said: Sequence[Said]) -> dict[Fault, list[float]]:
    """Times at which each code and lamp was reported, in the order of their first times."""
    found: dict[Fault, list[float]] = {}
    for one in said:
        for what in one.report.active:
            found.setdefault(Fault(one.source, what), []).append(one.time)
    return found


def channels(said: Sequence[Said]) -> dict[str, tuple[Array, Array]]:
    """The fault channels by name, each as (times, values) with one sample per DM1; a DM1 with an earlier time
    than a previous one is dropped."""
    faults, latest = ActiveFaults(), -math.inf
    rows: dict[float, dict[str, float]] = {}
    for one in said:
        if one.time >= latest:
            faults.take(one.source, one.report, one.time)
            latest = one.time
            rows[latest] = faults.channels(latest)
    names = next(iter(rows.values()), {})
    return {name: (np.array([*rows]), np.array([row[name] for row in rows.values()])) for name in names}


def notes(said: Sequence[Said], numbers: Mapping[int, str], broken: Counter[Broken]) -> list[str]:
    """A recording's notes: the vehicle identification number, and every fault with the controller that
    reported it."""
    found = [f"VIN {number} (0x{source:02X})" for source, number in sorted(numbers.items())]
    faults = [f"{fault.what} (0x{fault.source:02X})" for fault in _times(said)]
    found += [f"active faults: {', '.join(faults)}"] if faults else []
    return [*found, *unread(broken)]
