"""coverage.html: what recordings hold, to read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deeptruck_model.pages.document import Picture, Table, document
from deeptruck_model.signals import printed

SHOWS = "Time over speed, acceleration and slope. What is bright was driven long, what is white not at all."
SHOWN_IN = {"ratio": "%"}  # as the figure has slopes
CHANNELS_OF = "Channels of {name}, {seconds:.0f} s at {rate:g} Hz"


def page(found: Mapping[str, Any], picture: bytes) -> str:
    """The page as HTML, of what coverage.json tells and the figure of the same (PNG)."""
    number = len(found["recordings"])
    what = f"{number} recordings" if number > 1 else "one recording"
    first = f"{found['duration_s'] / 3600:.3g} h of driving in {what}."
    return document(
        first, found["warnings"], [_table(r) for r in found["recordings"]], [Picture(picture, SHOWS)]
    )


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
