"""coverage.html: what recordings hold, to read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deeptruck_model.pages.document import Folded, Picture, Table, document
from deeptruck_model.recordings import coverage_judgement
from deeptruck_model.recordings.not_recorded import sentence
from deeptruck_model.signals import printed, sensible

SHOWS = "Time spent over speed, acceleration and slope. Cells without colour were not driven."
SHOWS_CHANNELS = (
    "Every channel over the recorded time, the pieces one after another. Gaps are invalid samples."
)
CONDITIONS = "Time driven in each condition"
SHOWN_IN = {"ratio": "%"}  # as the figure has slopes
CHANNELS_OF = "Channels of {name}, {seconds:.0f} s at {rate:g} Hz"


def page(found: Mapping[str, Any], maps: bytes, channels: bytes) -> str:
    """The page as HTML, of coverage.json and its two pictures (PNG)."""
    seconds = np.array(found["occupancy"]["seconds"])
    conditions = Table(
        CONDITIONS, ("condition", "driven", "enough to learn it"), coverage_judgement.rows(seconds)
    )
    return document(
        found["judgement"],
        [*(f"Not recorded: {sentence(missing)}" for missing in found["not_recorded"]), *found["warnings"]],
        [
            Picture(channels, SHOWS_CHANNELS),
            conditions,
            Picture(maps, SHOWS),
            *(Folded(table.says, (table,)) for table in map(_account, found["accounts"])),
            *(Folded(table.says, (table,)) for table in map(_table, found["recordings"])),
        ],
    )


def _account(account: dict[str, Any]) -> Table:
    """What became of all that was read from one source."""
    rows = [
        (what, str(tally["read"]), str(tally["used"]), "", "")
        for what, tally in ((account["items"], account), *account["channels"].items())
    ]
    asides = [
        (f"{what}: {reason}", "", "", str(entry["count"]), entry["first"])
        for what, tally in ((account["items"], account), *account["channels"].items())
        for reason, entry in tally["set_aside"].items()
    ]
    remarks = [(remark, "", "", "", "") for remark in account["remarks"]]
    says = f"What became of {account['source']}"
    return Table(says, ("", "read", "used", "set aside", "first"), (*rows, *asides, *remarks))


def _table(recording: dict[str, Any]) -> Table:
    rows = [
        (name, SHOWN_IN.get(told["unit"], printed(told["unit"])),
         *(_cell(told[key], told["unit"]) for key in ("min", "mean", "max")),
         f"{100 * told['nan_share']:.1f}")
        for name, told in recording["channels"].items()
    ]  # fmt: skip
    says = CHANNELS_OF.format(
        name=recording["name"], seconds=recording["duration_s"], rate=1 / recording["dt"]
    )
    return Table(says, ("channel", "unit", "least", "mean", "most", "invalid, %"), tuple(rows))


def _cell(value: float | None, unit: str) -> str:
    if value is None:
        return ""
    return sensible(100.0 * value if unit in SHOWN_IN else value)
