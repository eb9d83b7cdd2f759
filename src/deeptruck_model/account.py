"""What became of everything that was read: one account for each log, bag and table.

A reader counts each item (frame, message, row) as it takes it from the file, and once more where it goes:
used, or set aside for a reason. The two counts are kept apart so that a reader which loses an item is seen
not to balance.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from deeptruck_model.json_data import stored


@dataclass
class Aside:
    """Items that were set aside for one reason, and where the first one stood (line, time, message)."""

    count: int = 0
    first: str = ""


@dataclass
class Tally:
    """Items read and what became of them."""

    read: int = 0
    used: int = 0
    aside: dict[str, Aside] = field(default_factory=dict, metadata=stored(key="set_aside"))

    def set_aside(self, reason: str, first: str = "", count: int = 1) -> None:
        """Count items that are not used. `first` is kept of the first of a reason."""
        if count:
            entry = self.aside.setdefault(reason, Aside(first=first))
            entry.count += count

    @property
    def left_out(self) -> int:
        """Items set aside, whatever the reason."""
        return sum(entry.count for entry in self.aside.values())

    @property
    def balanced(self) -> bool:
        """Whether each item that was read is used or set aside."""
        return self.read == self.used + self.left_out

    def lines(self, items: str) -> Iterator[str]:
        """For people: the sum, and a line for each reason."""
        yield f"{self.read} {items} read, {self.used} used, {self.left_out} set aside"
        for reason, entry in self.aside.items():
            first = f", first {entry.first}" if entry.first else ""
            yield f"  {entry.count} {reason}{first}"


@dataclass
class Account:
    """The account of one source.

    `items` says what is counted: frames, messages or rows. `sources` has the number of items by bus, topic or
    definition where there is a choice. `spans` are the contiguous times that came of it, in s of the source's
    own clock. `channels` counts the samples of each channel that came out of the used items. `remarks` are
    what else a user must know: where a file is cut off, clocks that differ, units that were assumed.
    """

    source: str
    items: str
    total: Tally = field(default_factory=Tally, metadata=stored(flat=True))
    sources: dict[str, int] = field(default_factory=dict)
    spans: list[tuple[float, float]] = field(default_factory=list, metadata=stored(key="spans_s"))
    channels: dict[str, Tally] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def channel(self, name: str) -> Tally:
        """The tally of a channel's samples, made at its first use."""
        return self.channels.setdefault(name, Tally())

    @property
    def balanced(self) -> bool:
        """Whether nothing was lost unsaid, in the source and in each channel."""
        return self.total.balanced and all(tally.balanced for tally in self.channels.values())

    def lines(self) -> Iterator[str]:
        """For people: what was read, used and set aside; channels only where samples were set aside."""
        head, *reasons = self.total.lines(self.items)
        yield f"{self.source}: {head}"
        yield from reasons
        if len(self.sources) > 1:
            yield "  of " + ", ".join(f"{name} ({count})" for name, count in self.sources.items())
        if len(self.spans) > 1:
            spans = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in self.spans[:6])
            more = f" and {len(self.spans) - 6} more" if len(self.spans) > 6 else ""
            yield f"  in {len(self.spans)} pieces: {spans}{more}"
        yield from (f"  {line}" for line in self.channel_lines())
        yield from (f"  {remark}" for remark in _grouped(self.remarks))

    def channel_lines(self) -> Iterator[str]:
        """For people: a line for each channel and reason that samples of it were set aside for."""
        for name, tally in self.channels.items():
            for reason, entry in tally.aside.items():
                first = f", first {entry.first}" if entry.first else ""
                yield f"{name}: {entry.count} of {tally.read} samples {reason}{first}"


def _grouped(remarks: list[str]) -> Iterator[str]:
    """Remarks that differ in their numbers only as one line: the first, and how many more there are."""
    kinds: dict[str, list[str]] = {}
    for remark in remarks:
        kinds.setdefault(re.sub(r"\d+(\.\d+)?", "0", remark), []).append(remark)
    for first, *more in kinds.values():
        yield f"{first} (and {len(more)} more like this)" if more else first
