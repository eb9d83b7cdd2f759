"""What recordings cannot teach, as an input never varies in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

EFFECTS = {
    "engine_command": "how the truck answers the engine",
    "brake_command": "how it brakes",
    "grade": "how it takes hills",
}


def untaught(pieces: Sequence[Recording], interface: TruckInterface) -> tuple[str, ...]:
    """One line for each input that teaches nothing; none where all of them vary."""
    constant = [name for name in (*interface.u, *interface.w) if not _varies(pieces, name)]
    lines = [f"{_says(name, pieces)}: {EFFECTS[name]} is not learned from it" for name in constant]
    if interface.brake_unit is None:
        lines.append(f"braking is not recorded: {EFFECTS['brake_command']} is not learned from it")
    return tuple(lines)


def _varies(pieces: Sequence[Recording], name: str) -> bool:
    values = {float(edge(p.channels[name])) for p in pieces for edge in (np.nanmin, np.nanmax)}
    return len(values) > 1


def _says(name: str, pieces: Sequence[Recording]) -> str:
    if name == "brake_command" and not pieces[0].channels[name].any():
        return "the brake is never used"
    return f"{name.replace('_', ' ')} never varies"
