"""What installed packages register: loaders of simulators, openers of files and importers of logs."""

from __future__ import annotations

from functools import cache
from importlib import metadata


@cache
def registered(group: str) -> dict[str, metadata.EntryPoint]:
    """Entry points of a group by name, sorted; read once, since that opens a file of every package."""
    found = {entry.name: entry for entry in metadata.entry_points(group=group)}
    return dict(sorted(found.items()))
