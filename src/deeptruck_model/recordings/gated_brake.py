"""Derived brake command of trucks whose brake can neither be commanded nor read: the deceleration while the
brake switch is on, as the paper defines it for its Volvo.

The switch is read as `brake_command` and held between its samples like any command; in the recording it then
multiplies the deceleration of the same sample.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.recording import Recording

COMMAND, SWITCH, UNIT = "brake_command", "brake_switch", "m/s^2"
ENTRY = {"derive": "deceleration", "gate": SWITCH}
NOTE = f"{COMMAND} is the deceleration while {SWITCH} is on, for want of a command"


def is_asked(channels: Any, implied: Collection[str] = ()) -> bool:
    """Whether the channels of a topic map or COLUMNS derive the brake command. Raises InputError if they
    derive it in another way, or from a switch that is neither among them nor in `implied`."""
    entry = channels.get(COMMAND) if isinstance(channels, Mapping) else None
    if not isinstance(entry, Mapping) or not set(entry) & set(ENTRY):
        return False
    if dict(entry) != ENTRY:
        says = ", ".join(f"{key}: {value}" for key, value in entry.items())
        known = ", ".join(f"{key}: {value}" for key, value in ENTRY.items())
        raise InputError(f"{COMMAND} can be derived by {{{known}}} alone, not by {{{says}}}")
    if SWITCH not in (*channels, *implied):
        raise InputError(f"{COMMAND} is derived where {SWITCH} is on: name that channel too")
    return True


def on(switch: Array) -> Array:
    """1 on, 0 off; NaN for other codes, such as 2 (error) and 3 (not available)."""
    return np.where((switch == 0.0) | (switch == 1.0), switch, np.nan)


def substituted(recording: Recording) -> Recording:
    """The recording with the derived command in place of the switch, (n,) 0 to 1, that
    `brake_command` holds."""
    switch = recording.channels.get(COMMAND, np.full(len(recording), np.nan))
    slowing = np.maximum(-recording.channels["acceleration"], 0.0)
    command = np.where(switch == 0.0, 0.0, switch * slowing)
    return replace(
        recording,
        channels={**recording.channels, COMMAND: command},
        interface=replace(recording.interface, brake_unit=UNIT),
        notes=tuple(dict.fromkeys((*recording.notes, NOTE))),
    )
