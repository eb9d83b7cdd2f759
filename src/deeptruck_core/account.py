"""Accounts for everything that was read: one account for each log, bag and table.

A reader counts each item (frame, message, row) when it is read from the file, and again when it is used or
omitted for a reason. The counts are separate, so that they do not balance if a reader loses an item.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

from deeptruck_core.json_data import stored

DATES_S = 1e8, 1e11  # a clock between these counts from 1970, not from the start of a drive


def moment(time_s: float) -> str:
    """A time of a source's clock: seconds, or the date in UTC where it counts from 1970."""
    if not DATES_S[0] <= time_s <= DATES_S[1]:
        return f"{time_s:.6g} s"
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M:%S.%f}"[:-5] + " UTC"


@dataclass
class Aside:
    """Items that were omitted for one reason, and the place of the first one (line, time, message)."""

    count: int = 0
    first: str = ""


@dataclass
class Tally:
    """Items read, used and omitted."""

    read: int = 0
    used: int = 0
    aside: dict[str, Aside] = field(default_factory=dict, metadata=stored(key="set_aside"))

    def set_aside(self, reason: str, first: str = "", count: int = 1) -> None:
        """Count items that are not used. `first` is kept for the first item of a reason."""
        if count:
            entry = self.aside.setdefault(reason, Aside(first=first))
            entry.count += count

    @property
    def left_out(self) -> int:
        """Number of omitted items, for all reasons."""
        return sum(entry.count for entry in self.aside.values())

    @property
    def balanced(self) -> bool:
        """Whether every item read is used or omitted."""
        return self.read == self.used + self.left_out

    def lines(self, items: str) -> Iterator[str]:
        """Text lines: the totals, and a line for each reason."""
        yield f"{self.read} {items} read, {self.used} used, {self.left_out} set aside"
        for reason, entry in self.aside.items():
            first = f", first {entry.first}" if entry.first else ""
            yield f"  {entry.count} {reason}{first}"


@dataclass
class Account:
    """The account of one source.

    `items` names what is counted: frames, messages or rows. `sources` has the number of items by bus, topic
    or definition if there are several. `spans` are the resulting contiguous times, in s of the source's own
    clock. `channels` counts the samples of each channel from the used items. `remarks` are further notes to
    the user: a truncated file, clocks that differ, assumed units.
    """

    source: str
    items: str
    total: Tally = field(default_factory=Tally, metadata=stored(flat=True))
    sources: dict[str, int] = field(default_factory=dict)
    spans: list[tuple[float, float]] = field(default_factory=list, metadata=stored(key="spans_s"))
    channels: dict[str, Tally] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def channel(self, name: str) -> Tally:
        """The tally of a channel's samples, created on first use."""
        return self.channels.setdefault(name, Tally())

    @property
    def balanced(self) -> bool:
        """Whether all items of the source and all samples of each channel are accounted for."""
        return self.total.balanced and all(tally.balanced for tally in self.channels.values())

    def lines(self) -> Iterator[str]:
        """Text lines on what was read, used and omitted; channels only if samples were omitted."""
        head, *reasons = self.total.lines(self.items)
        yield f"{self.source}: {head}"
        yield from reasons
        if len(self.sources) > 1:
            yield "  of " + ", ".join(f"{name} ({count})" for name, count in self.sources.items())
        if len(self.spans) > 1:
            dated = self.spans[0][0] >= DATES_S[0]
            spans = ", ".join(
                f"{moment(start)} to {moment(end)}" if dated else f"{start:.1f} to {end:.1f} s"
                for start, end in self.spans[:6]
            )
            more = f" and {len(self.spans) - 6} more" if len(self.spans) > 6 else ""
            yield f"  in {len(self.spans)} pieces: {spans}{more}"
        yield from (f"  {line}" for line in self.channel_lines())
        yield from (f"  {remark}" for remark in _grouped(self.remarks))

    def channel_lines(self) -> Iterator[str]:
        """Text lines for each channel and reason for which samples were omitted."""
        for name, tally in self.channels.items():
            for reason, entry in tally.aside.items():
                first = f", first {entry.first}" if entry.first else ""
                yield f"{name}: {entry.count} of {tally.read} samples {reason}{first}"


def _grouped(remarks: list[str]) -> Iterator[str]:
    """Merges remarks that differ only in their numbers into one line: the first, and the number of others."""
    kinds: dict[str, list[str]] = {}
    for remark in remarks:
        kinds.setdefault(re.sub(r"\d+(\.\d+)?", "0", remark), []).append(remark)
    for first, *more in kinds.values():
        yield f"{first} (and {len(more)} more like this)" if more else first
