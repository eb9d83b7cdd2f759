"""Parses the text for a side: 'BAG', or 'SIM@BAG'. Standard library only, so that it loads fast."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def split_name(text: str) -> tuple[str | None, Path]:
    """The simulator and the bag of 'SIM@BAG'; None and the bag for 'BAG'."""
    simulator, _, bag = text.rpartition("@")
    if not (simulator and bag) or Path(text).exists():
        return None, Path(text)
    return simulator, Path(bag)


ONE_RUN = (
    "a simulator runs free to the end of the drive; 'mismatch' and 'evaluate' begin anew every 40 s, so that "
    "their errors are others"
)


def short_names(texts: Sequence[str]) -> list[str]:
    """The last parts of paths if these distinguish the sides, else the full texts."""
    last = [
        f"{Path(sim).name if Path(sim).exists() else sim}@{bag.name}" if sim else bag.name
        for sim, bag in map(split_name, texts)
    ]
    return last if len(set(last)) == len(texts) else list(texts)
