"""Inputs that affect the truck's motion and were not recorded: the consequence, and the signal to record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import PERSON
from deeptruck_core.vehicle_kinds import NO_COASTING, SURELY_BRAKING
from deeptruck_model.recordings.recording import Recording


@dataclass(frozen=True)
class Input:
    """An input of the truck: the consequence if it is missing, and where it is found.

    `column` replaces, for tables, what follows '; ' in `signal`.
    """

    name: str
    hides: str
    signal: str
    column: str
    known: Callable[[Recording], bool]


def unrecorded_braking(r: Recording, speed: Array) -> Mask:
    """Samples (n,) at which the truck brakes although its brake command never changes; `speed` (n,)
    in m/s."""
    command = r.channels["brake_command"]
    slowing = uniform_filter1d(
        np.nan_to_num(np.diff(speed, prepend=speed[:1]) / r.dt), max(round(1.0 / r.dt), 1)
    )
    never_moves = np.isfinite(command).any() and np.nanmin(command) == np.nanmax(command)
    braked: Mask = (slowing < NO_COASTING) & bool(never_moves and (slowing < SURELY_BRAKING).any())
    return braked


def _brake(r: Recording) -> bool:
    """Whether the brake command was recorded and is not constant while the truck brakes."""
    if not _measured("brake_command")(r):
        return False
    return not (_measured("speed")(r) and unrecorded_braking(r, r.channels["speed"]).any())


def _measured(*channels: str) -> Callable[[Recording], bool]:
    """A function that says whether one of the channels has a valid sample."""
    return lambda r: any(c in r.channels and not np.isnan(r.channels[c]).all() for c in channels)


INPUTS = (
    Input(
        "brake",
        "Braking counts as drag, slope or retarder, and no effect of the brakes can be named.",
        "brake pedal position, SPN 521 in EBC1 (PGN 61441); `brake_command` on `/truck/command`",
        "`brake_command` in COLUMNS.yaml",
        _brake,
    ),
    Input(
        "gear",
        "Losses and inertia that differ by gear, and the pauses of gear changes, are averaged.",
        "current gear, SPN 523 in ETC2 (PGN 61445); `gear` on `/truck/status`",
        "`gear` in COLUMNS.yaml",
        _measured("gear"),
    ),
    Input(
        "slope",
        "The force of a slope, 1 % of the weight for each percent, counts as engine, drag or brake.",
        "pitch or altitude, SPN 583 or 580 in VDS (PGN 65256); `grade` or `elevation` on `/road`",
        "`grade` or `elevation` in COLUMNS.yaml",
        _measured("grade", "elevation"),
    ),
    Input(
        "mass",
        "Unless the simulator states it, forces are known in m/s² only, and a change of load is taken for "
        "other physics.",
        "gross combination weight, SPN 1760 in CVW (PGN 65136); `mass_kg` in COLUMNS.yaml, or `--mass-kg`",
        "`mass_kg` in COLUMNS.yaml, or `--mass-kg`",
        lambda r: r.interface.mass_kg is not None,
    ),
    Input(
        "gap",
        "The wake of a vehicle ahead lowers the air drag, which counts as tail wind or a smaller drag area.",
        "distance to the vehicle ahead, SPN 1587 in ACC1 (PGN 65135); `gap` on `/radar/range`, or "
        "`--no-vehicle-ahead`",
        "`gap` in COLUMNS.yaml, or `--no-vehicle-ahead`",
        lambda r: r.no_vehicle_ahead or _measured("gap")(r),
    ),
    Input(
        "commands obeyed",
        "Commands that the truck did not follow, as without engagement, are compared as if it had.",
        "actual engine torque, SPN 513 in EEC1 (PGN 61444); `engaged` on `/truck/engaged`, or "
        "`driven_by: person` where a person drove",
        "`engine_torque`, or `driven_by`, in COLUMNS.yaml",
        lambda r: r.obeyed or r.interface.driven_by == PERSON or _measured("engine_torque")(r),
    ),
)


@dataclass(frozen=True)
class Missing:
    """An input that was not recorded in any bag, or not in `sources`, the names of the bags without it.

    `in_tables`: the bags without it were imported from tables.
    """

    input: Input
    sources: tuple[str, ...]
    in_tables: bool = False

    @property
    def signal(self) -> str:
        """The signal to record, with its topic, or with its name in COLUMNS.yaml if tables lack it."""
        if not self.in_tables:
            return self.input.signal
        return f"{self.input.signal.partition('; ')[0]}; {self.input.column}"

    def to_dict(self) -> dict[str, object]:
        """Plain data for JSON."""
        found: dict[str, object] = {
            "input": self.input.name,
            "hides": self.input.hides,
            "signal": self.signal,
        }
        return found | ({"sources": list(self.sources)} if self.sources else {})


def not_recorded(recordings: Sequence[Recording]) -> list[Missing]:
    """Inputs that at least one bag lacks in all its pieces, in the order of INPUTS."""
    bags: dict[str, list[Recording]] = {}
    for recording in recordings:
        bags.setdefault(recording.name.partition("#")[0], []).append(recording)
    missing = []
    for one in INPUTS:
        without = tuple(name for name, pieces in bags.items() if not any(map(one.known, pieces)))
        if without:
            in_tables = all(bags[name][0].from_table for name in without)
            missing.append(Missing(one, without if len(without) < len(bags) else (), in_tables))
    return missing


def sentence(missing: dict[str, object]) -> str:
    """An entry of `not_recorded` in coverage.json as a sentence."""
    sources = missing.get("sources")
    where = f" in {', '.join(map(str, sources))}" if isinstance(sources, list) else ""
    signal = str(missing["signal"]).replace("`", "")
    return f"{missing['input']}{where}. {missing['hides']} Record: {signal}."
