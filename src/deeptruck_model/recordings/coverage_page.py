"""coverage.html: what recordings hold, to read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deeptruck_model.pages.document import Picture, Table, document
from deeptruck_model.recordings.not_recorded import sentence
from deeptruck_model.signals import printed

SHOWS = "Time over speed, acceleration and slope. What is bright was driven long, what is white not at all."
SHOWN_IN = {"ratio": "%"}  # as the figure has slopes
CHANNELS_OF = "Channels of {name}, {seconds:.0f} s at {rate:g} Hz"


def page(found: Mapping[str, Any], picture: bytes) -> str:
    """The page as HTML, of what coverage.json tells and the figure of the same (PNG)."""
    number = len(found["recordings"])
    what = f"{number} recordings" if number > 1 else "one recording"
    first = f"{found['duration_s'] / 3600:.3g} h of driving in {what}."
    if found["not_recorded"]:
        first = f"Not recorded: {', '.join(m['input'] for m in found['not_recorded'])}. {first}"
    return document(
        first,
        [*(f"Not recorded: {sentence(missing)}" for missing in found["not_recorded"]), *found["warnings"]],
        [*map(_account, found["accounts"]), *map(_table, found["recordings"])],
        [Picture(picture, SHOWS)],
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
    return f"{100.0 * value if unit in SHOWN_IN else value:.4g}"
