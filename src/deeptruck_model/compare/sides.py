"""One side of a comparison: a recording, or a simulator driven by a recording's commands, on a common
clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.checks import Clock
from deeptruck_model.checks.compatibility import Taken
from deeptruck_model.compare.naming import short_names, split_name
from deeptruck_model.recordings import Recording, read
from deeptruck_model.recordings.several import check_fit
from deeptruck_model.simulators import Simulator, free_run

SHOWN = (
    "speed", "acceleration", "engine_command", "brake_command", "gap", "leader_speed", "fuel_rate", "grade",
    "elevation", "latitude", "longitude",
)  # fmt: skip
INSIDE = ("gear", "engine_speed", "engine_torque")  # channels that a simulator may show
LEAST_RUN_S = 10.0  # of valid commands in a row, for a simulator to be driven along them


@dataclass(frozen=True)
class Side:
    """`columns` (n,) by channel, in its unit of `units`, every `step_s` from the first sample; NaN if not
    recorded. `native` has every channel at its own step `native_step_s`, starting at `begin_s` of its bag.
    `simulated` is the simulator, empty for a recording."""

    name: str
    step_s: float
    columns: dict[str, Array]
    units: dict[str, str]
    native: dict[str, Array] = field(default_factory=dict)
    native_step_s: float = 0.1
    begin_s: float = 0.0
    simulated: str = ""
    bag: Path = Path()  # which it is, or is driven along

    def __len__(self) -> int:
        return len(self.columns["speed"])

    @property
    def distance(self) -> Array:
        """Distance driven since the first sample, m; constant during gaps."""
        travelled: Array = np.cumsum(np.nan_to_num(self.columns["speed"])) * self.step_s
        return travelled


def load(
    texts: Sequence[str],
    step_s: float,
    topic_map: Path | None = None,
    clock: Clock | None = None,
    msg: Sequence[Path] = (),
) -> list[Side]:
    """The sides in order, named as given. Raises InputError as `recordings.read` does."""
    out = []
    for name, text in zip(short_names(texts), texts, strict=True):
        simulator, bag = split_name(text)
        truck = None if simulator is None else simulators.load(simulator)
        rate = 10.0 if truck is None else 1.0 / truck.dt
        recordings = read(bag, topic_map=topic_map, rate_hz=rate, clock=clock, msg=msg)
        if truck is not None:
            check_fit(recordings, Taken(f"the simulator {simulator}", truck.interface, truck.dt))
            recordings = _driven(truck, recordings, text)
        out.append(replace(_side(name, recordings, step_s), simulated=simulator or "", bag=bag))
    return out


def _driven(simulator: Simulator, recordings: Sequence[Recording], text: str) -> list[Recording]:
    """Free runs of the simulator with the commands of the recordings."""
    out = []
    for r in recordings:
        inputs = np.column_stack([r.columns(simulator.interface.u), r.columns(simulator.interface.w)])
        known = np.isfinite(inputs).all(axis=1) & np.isfinite(r.channels["speed"])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
        segments = [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= LEAST_RUN_S / r.dt]
        out += [_run(simulator, r.piece(a, b)) for a, b in segments]
    if not out:
        raise InputError(f"{text}: nowhere are all commands valid for {LEAST_RUN_S:g} s; choose another bag")
    return out


def _run(simulator: Simulator, r: Recording) -> Recording:
    interface = simulator.interface
    unknown = np.zeros(len(r))  # a fuel rate that was not recorded
    begin = np.nan_to_num(np.stack([r.channels.get(name, unknown)[:1] for name in interface.y], axis=1))
    run = free_run(simulator, r.columns(interface.u)[None], r.columns(interface.w)[None], begin)
    response = {name: run.y[0, :, k].astype(float) for k, name in enumerate(interface.y)}
    given = {name: r.channels[name] for name in SHOWN if name in (*interface.u, *interface.w, "elevation")
             and name in r.channels}  # fmt: skip
    inside = {name: run.inside[name][0].astype(float) for name in INSIDE if name in run.inside}
    return Recording(r.name, r.dt, {**given, **response, **inside}, r.interface, r.start_s, r.notes)


def _side(name: str, recordings: Sequence[Recording], step_s: float) -> Side:
    """The recordings of one bag as means over `step_s`, on one clock from the first sample."""
    begin = min(r.start_s for r in recordings)
    count = max(int(np.ceil((r.start_s - begin + len(r) * r.dt) / step_s)) for r in recordings)
    columns = {c: np.full(count, np.nan) for c in SHOWN if any(c in r.channels for r in recordings)}
    for r in recordings:
        at = np.minimum(
            ((r.start_s - begin + r.dt * np.arange(len(r))) / step_s + 1e-6).astype(int), count - 1
        )
        for channel, into in columns.items():
            if channel in r.channels:
                _put_means(into, at, r.channels[channel])
    interface = recordings[0].interface
    native = _native(recordings, begin)
    units = {c: interface.unit(c) for c in (*columns, *native)}
    return Side(name, step_s, columns, units, native, recordings[0].dt, begin)


def _native(recordings: Sequence[Recording], begin: float) -> dict[str, Array]:
    """Every channel at its native step, on the clock of the first sample; NaN between pieces."""
    dt = recordings[0].dt
    at = [round((r.start_s - begin) / dt) for r in recordings]
    count = max(k + len(r) for k, r in zip(at, recordings, strict=True))
    columns = {c: np.full(count, np.nan) for c in dict.fromkeys(c for r in recordings for c in r.channels)}
    for k, r in zip(at, recordings, strict=True):
        for channel, values in r.channels.items():
            columns[channel][k : k + len(r)] = values
    return columns


def _put_means(into: Array, at: NDArray[np.intp], values: Array) -> None:
    known = np.isfinite(values)
    number = np.bincount(at[known], minlength=len(into))
    total = np.bincount(at[known], weights=values[known], minlength=len(into))
    into[number > 0] = total[number > 0] / number[number > 0]
