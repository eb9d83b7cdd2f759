"""The data of the comparison, stacked over the recordings with one sample period."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, printed
from deeptruck_core.vehicle_kinds import CLUTCH_CLOSED, UNSTATED, VehicleKind
from deeptruck_model.mismatch.prepare.prepared import Prepared, forced
from deeptruck_model.mismatch.residual.noise import Series
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.simulators import Simulator

MOST_TURNS = 150.0  # rad/m: a crawler gear
BIN, WIDTH = 0.02, 0.06  # of the logarithm; gears of a truck are at least 0.15 apart
SELDOM = 0.005  # share of the time below which a ratio is no gear
SLOW_NOISE_S = 10.0  # length of the means whose sd is the slow noise


def turns(engine_speed: Array, speed: Array) -> Array:
    """Engine angle per distance, rad/m, (n,); NaN if the engine speed is not known."""
    ratio = engine_speed / np.maximum(speed, 0.5)
    out: Array = np.where(np.isfinite(ratio), np.clip(ratio, 0.0, MOST_TURNS), np.nan)
    return out


def gears(ratio: Array, speed: Array) -> tuple[float, ...]:
    """The engine angles per distance (rad/m) around which driving clusters, ascending; none without
    driving."""
    left = np.log(ratio[np.isfinite(ratio) & (ratio > 0.1) & (speed > CLUTCH_CLOSED)])
    count, found = len(left), []
    while len(left) > max(SELDOM * count, 20):
        bins, edges = np.histogram(left, np.arange(left.min() - BIN, left.max() + 2 * BIN, BIN))
        most = edges[int(np.argmax(bins))] + BIN / 2
        near = np.abs(left - most) < WIDTH
        if near.sum() < SELDOM * count:
            break
        found.append(float(np.exp(np.median(left[near]))))
        left = left[~(np.abs(left - np.log(found[-1])) < 2 * WIDTH)]
    return tuple(sorted(found))


def overall_ratio(ratio: Array, known: Sequence[float], in_gear: Array | None = None) -> Array:
    """The engine angle per distance (rad/m) of the gear, near one of the `known` values.

    While a clutch slips it is `in_gear`, if a simulator reports that, or the measured ratio, at most that of
    the lowest gear.
    """
    if not known:
        return ratio
    centres = np.log(np.asarray(known))
    x = np.log(np.maximum(np.nan_to_num(ratio, nan=0.1), 0.1))
    nearest = np.argmin(np.abs(x[:, None] - centres), axis=1)
    near = np.abs(x - centres[nearest]) < WIDTH
    slipping = np.minimum(ratio, known[-1]) if in_gear is None else in_gear
    out: Array = np.where(near, np.asarray(known)[nearest], slipping)
    return out


UNITS = {
    "speed": "m/s",
    "engine": "m/s²",
    "brake": "m/s²",
    "simulated": "m/s²",
    "grade": "rise/run",
    "ratio": "rad/m",
    "overall_ratio": "rad/m",
    "engine_speed": "rad/s",
    "gap": "m",
    "elapsed": "s",
    "elevation": "m",
    "ambient_temperature": "°C",
    "engine speed": "rad/s",
    "engine force": "m/s²",
    "engine power": "W/kg",
    "torque": "N m/kg",
    "time": "s",
}
UNITS_OF = {  # of names that begin so
    "time since ": "s",
    "braking power over ": "W/kg",
    "engine over ": "m/s²",
    "engine power over ": "W/kg",
    "speed over ": "m/s",
    "acceleration over ": "m/s²",
}


def unit(name: str, commands: Mapping[str, str]) -> str:
    """The unit of a signal; `commands` maps the truck's commands to their units. Empty if dimensionless."""
    starts = (u for start, u in UNITS_OF.items() if name.startswith(start))
    return printed(commands.get(name.removeprefix("change of "), "")) or UNITS.get(name) or next(starts, "")


@dataclass(frozen=True)
class ForceUnit:
    """Unit in which forces are reported: `scale` units are one m/s^2. Without a mass forces are per
    kilogram."""

    name: str
    scale: float

    def of(self, unit: str) -> str:
        """The unit in which a size is reported whose `unit` is given in newtons."""
        return unit if self.scale > 1.0 else self.name if unit == "N" else f"{unit}/kg"


PER_KILOGRAM = ForceUnit("m/s^2", 1.0)
DOUBT_ROWS = 5  # a doubtful sample also marks those it is whitened with
BLOCK_LEARNED_S = 1.0  # a learned simulator's timing is not good enough for more
BLOCK_S = 0.2  # long enough to average sensor noise, short enough for a driveline


@dataclass(frozen=True)
class DriveRows:
    """Position of one recording in the stacked arrays: rows start..stop, its name, its start in the bag."""

    name: str
    start: int
    stop: int
    start_s: float
    held_out: bool

    @property
    def rows(self) -> slice:
        return slice(self.start, self.stop)


@dataclass(frozen=True)
class Evidence:
    """Stacked signals (n,) at period `dt`. Forces are specific (m/s^2, that is N per kg of `mass`).

    `residual` is observed minus simulated acceleration, with the simulator forced along the recording;
    `disagreement` the sd of the simulator under its own input noise; `sensitivity` the change of the
    simulated acceleration for +100 % of each simulator parameter. `signals` holds the signals in mechanisms,
    NaN or absent where unknown. `rerun(name, amount)` returns the change of the simulated acceleration under
    a changed command path.
    """

    dt: float
    drives: tuple[DriveRows, ...]
    residual: Array
    simulated: Array
    disagreement: Array
    valid: Mask
    signals: dict[str, Array]
    sensitivity: dict[str, Array]
    mass: float  # kg; a typical one where it is not known
    rerun: Callable[[str, float], Array]
    model_discrepancy: float = 0.0  # rms of what the simulator itself learned imperfectly, m/s^2
    learned_slow_noise: float | None = None  # as the rule `slow_noise`, of a simulator that learned
    reference: Evidence | None = None  # a learned simulator along the recordings it keeps
    other_gear: int = 0  # samples left out because the simulator drives in another gear than the recorded one
    moved: dict[str, float] = field(default_factory=dict)  # relative changes the parameters have already had
    command_units: dict[str, str] = field(default_factory=dict)
    sooner: Array | None = None  # (n,) m/s^2 more for deciding, as when to shift, a sample sooner
    rules: Rules = field(default_factory=Rules)  # by which all of this is judged
    mass_known: bool = True
    reports_forces: bool = False  # the simulator reports its own forces, so that none are estimated
    known_physics: bool = True  # the simulator reports parameters or forces, so that it is no learned one
    vehicle: VehicleKind = UNSTATED  # what is usual of what drove
    whole: Mask | None = None  # `valid` with held-out recordings, where it is without
    user_mechanisms: tuple[Any, ...] = ()  # mechanisms of the user, which are compared beside the library
    hidden: Mask | None = None  # rows that are left out because an unrecorded brake acts
    other_shift: Mask | None = None  # rows near which truck and simulator shift at different moments

    def __len__(self) -> int:
        return len(self.residual)

    @property
    def slow_noise(self) -> float:
        """Standard deviation of a mean over SLOW_NOISE_S that may still be noise, m/s^2."""
        return self.rules.slow_noise if self.learned_slow_noise is None else self.learned_slow_noise

    def to_fit(self) -> Evidence:
        """The same evidence without the held-out recordings."""
        return replace(self, valid=self.valid & ~self.held_out, whole=self.valid)

    def everywhere(self) -> Evidence:
        """The same evidence, with all recordings to be fitted, held-out ones included."""
        return self if self.whole is None else replace(self, valid=self.whole, whole=None)

    def adds_up(self, force: Array, horizon_s: float, *, where_it_acts: bool = False) -> float:
        """Speed error (rms, m/s) to which a force (n,), m/s^2, integrates over windows of `horizon_s`, along
        the fitted drives; over all, or those alone in which it acts."""
        steps = max(1, round(horizon_s / self.dt))
        counted = np.where(self.valid, np.nan_to_num(force), 0.0) * self.dt
        fitted = [s for s in self.drives if not s.held_out]
        parts = [counted[k : min(k + steps, s.stop)] for s in fitted for k in range(s.start, s.stop, steps)]
        parts = [x for x in parts if x.any()] if where_it_acts else parts
        return float(np.sqrt(np.mean(np.concatenate([np.cumsum(x) for x in parts]) ** 2))) if parts else 0.0

    def without(self, hidden: Mask | None) -> Evidence:
        """The same evidence without the rows (n,) in which an unrecorded brake acts."""
        return self if hidden is None else replace(self, valid=self.valid & ~hidden, hidden=hidden)

    @property
    def gears(self) -> tuple[float, ...]:
        """Engine angles per distance, rad/m, of the gears that were driven; none if not known."""
        return gears(self.signals["ratio"], self.signals["speed"]) if "ratio" in self.signals else ()

    def total_change(self, parameter: str, further: float) -> float:
        """Relative change of a parameter from the simulator as given, after a further relative change."""
        return (1.0 + self.moved.get(parameter, 0.0)) * (1.0 + further) - 1.0

    def __getitem__(self, name: str) -> Array:
        return self.signals[name]

    def has(self, *names: str) -> bool:
        """Whether every named signal is known for at least half of the valid samples, of which there are
        some."""
        if names and not self.valid.any():
            return False
        return all(
            n in self.signals and np.isfinite(self.signals[n][self.valid]).mean() >= 0.5 for n in names
        )

    @property
    def unit(self) -> ForceUnit:
        """The unit in which forces are reported."""
        return ForceUnit("N", self.mass) if self.mass_known else PER_KILOGRAM

    def newtons(self, acceleration: Array) -> Array:
        """The forces that cause these accelerations, (n,); too small where the brakes compensate them."""
        gain = self.signals.get("effective_mass_gain", np.ones(len(self)))
        out: Array = acceleration * self.mass / np.maximum(gain, Limits.least_effective_mass_gain)
        return out

    @property
    def starts(self) -> Mask:
        flags = np.zeros(len(self), dtype=bool)
        flags[[s.start for s in self.drives]] = True
        return flags

    @property
    def record(self) -> Indices:
        """Index of each row's drive, (n,)."""
        return np.repeat(np.arange(len(self.drives)), [s.stop - s.start for s in self.drives])

    @property
    def held_out(self) -> Mask:
        return np.array([s.held_out for s in self.drives])[self.record]

    def series(self, sigma: float) -> Series:
        """The regression target; segments in which the simulator is sensitive to input noise have less
        weight."""
        relative = self.doubt(sigma)
        slow = float(np.sqrt(self.dt / SLOW_NOISE_S)) / self.slow_noise
        y = np.where(self.valid, self.residual, 0.0)
        return Series(y, self.valid, self.starts, relative, slow, self.rules)

    def doubt(self, sigma: float) -> Array:
        """Factor >= 1 on the standard deviation of each sample, (n,), for the simulator's spread under input
        noise."""
        near = maximum_filter1d(self.disagreement, 2 * DOUBT_ROWS + 1)
        out: Array = np.sqrt(1.0 + (self.rules.tolerance * near / max(sigma, 1e-9)) ** 2)
        return out

    # -- filters that start afresh with every recording ---------------------------------------

    def lag(self, x: Array, tau_s: float, initial: str = "first") -> Array:
        """First-order lag of x. It starts at the first sample ('first') or at zero ('zero')."""
        keep = float(np.exp(-self.dt / max(tau_s, 1e-6)))
        out = np.empty_like(x)
        for s in self.drives:
            part = np.nan_to_num(x[s.rows])
            begin = keep * part[:1] if initial == "first" else np.zeros(1)
            out[s.rows] = lfilter([1 - keep], [1, -keep], part, zi=begin)[0]
        return out

    def since(self, event: Mask) -> Array:
        """Seconds since `event` was last true; infinite before the first time in a recording."""
        out = np.full(len(self), np.inf)
        for s in self.drives:
            index = np.arange(s.stop - s.start)
            last = np.maximum.accumulate(np.where(event[s.rows], index, -1))
            out[s.rows] = np.where(last >= 0, (index - last) * self.dt, np.inf)
        return out

    def integral(self, x: Array) -> Array:
        """Running integral of x over time within each recording."""
        out = np.empty_like(x)
        for s in self.drives:
            out[s.rows] = np.cumsum(np.nan_to_num(x[s.rows])) * self.dt
        return out

    def difference(self, x: Array) -> Array:
        """Time derivative of x within each recording; zero at the first sample."""
        out = np.zeros_like(x)
        for s in self.drives:
            out[s.start + 1 : s.stop] = np.diff(x[s.rows]) / self.dt
        return out


def accelerations(
    simulator: Simulator, prepared: Sequence[Prepared], grid: Grid, us: Sequence[Array]
) -> Array:
    """Simulated accelerations (n,) with the commands `us`, in blocks."""
    return grid.stack([run.y[0, :, ACCELERATION] for run in forced(simulator, prepared, us)])


class Grid:
    """Block averages of native samples, stacked over the recordings."""

    def __init__(self, prepared: Sequence[Prepared], held_out: Sequence[bool], block: int) -> None:
        self.block, self.prepared = block, prepared
        drives, start = [], 0
        for p, out in zip(prepared, held_out, strict=True):
            rows = len(p.recording) // block
            drives.append(DriveRows(p.recording.name, start, start + rows, p.recording.start_s, out))
            start += rows
        if start == 0:
            raise InputError("the recordings are shorter than one block; record at least a few minutes")
        self.drives = tuple(drives)

    def __len__(self) -> int:
        return self.drives[-1].stop

    def stack(self, parts: Sequence[Array]) -> Array:
        """Block means; NaN in a block with a NaN."""
        return np.concatenate([self._blocks(p).mean(axis=1) for p in parts])

    def last(self, parts: Sequence[Array]) -> Array:
        """Last native sample of each block, for gears and other labels."""
        return np.concatenate([self._blocks(p)[:, -1] for p in parts])

    def any(self, parts: Sequence[Mask]) -> Mask:
        """Blocks that contain a marked sample."""
        return np.concatenate([self._blocks(p).any(axis=1) for p in parts])

    def valid(self) -> Mask:
        return np.concatenate([self._blocks(p.valid).all(axis=1) for p in self.prepared])

    def _blocks(self, x: NDArray[np.generic]) -> NDArray[np.generic]:
        n = len(x) // self.block
        return x[: n * self.block].reshape(n, self.block)
