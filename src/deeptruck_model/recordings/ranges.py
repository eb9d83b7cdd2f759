"""Sets aside what is out of range for any truck, impossible, or reversing, and questions a unit by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from deeptruck_core.account import Tally, moment
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface, channel_of
from deeptruck_model.recordings.consistency.impossible import impossible, lost_decimals, zero_changes
from deeptruck_model.recordings.units import known_units

NEEDED = ("speed", "engine_command", "brake_command")
_OF_UNITS = (*NEEDED, "grade")  # channels whose unit is questioned
REVERSE_LOW = -15.0 / 3.6  # m/s: faster backward is no reversing but a wrong sign or a fault
REVERSING = "reversing"
_DEAD_BAND = 2.0  # m/s: slower than this many sensors show zero, so that reversing begins with a jump
RAW_TORQUE = (125.0, 250.0)  # zero and largest of J1939's percent torque where its offset is not applied
_SUSPECT_SHARE = 0.01  # of the samples that are not zero
_KEPT = 10_000  # samples that are looked at for a factor
NEAR_UNIT = 0.04  # relative, as tyres differ

# (channel, unit) -> what it reaches in a drive at least and at most, and how much larger it is in other units
_OTHER_UNITS: dict[tuple[str, str], tuple[float, float, dict[str, float]]] = {
    ("speed", "m/s"): (
        2.0,
        40.0,
        {"km/h": 3.6, "mph": 1 / 0.44704, "cm/s": 100.0, "mm/s": 1000.0, "counts of 1/256 km/h": 921.6},
    ),
    ("engine_command", "N m"): (250.0, 5000.0, {"N cm": 100.0, "N mm": 1000.0}),
    ("engine_command", "percent"): (6.5, 130.0, {"0.01 percent": 100.0, "0.001 percent": 1000.0}),
    ("engine_command", "g/s"): (2.0, 40.0, {"mg/s": 1000.0, "g/h": 3600.0}),
    ("engine_command", "cm^3/s"): (2.5, 50.0, {"mm^3/s": 1000.0, "ml/h": 3600.0}),
    ("brake_command", "percent"): (5.0, 105.0, {"per mille": 10.0, "0.01 percent": 100.0}),
    ("brake_command", "m/s^2"): (0.6, 12.0, {"cm/s^2": 100.0, "mm/s^2": 1000.0}),
    ("brake_command", "bar"): (0.75, 15.0, {"kPa": 100.0, "mbar": 1000.0, "Pa": 1e5}),
    ("grade", "ratio"): (0.004, 0.4, {"percent": 100.0}),
}

LIMITS = {  # of commands, by unit; the codes of J1939 for 'error' and 'not available' lie above
    ("engine_command", "percent"): (-125.0, 125.0),
    ("brake_command", "percent"): (-0.5, 100.5),
}


class Seen(NamedTuple):
    """A channel is `factor` times what `by`, such as 'latitude and longitude give'."""

    by: str
    factor: float


Measured = Callable[[str], Seen | None]


class Range:
    """Removes out-of-range samples of a channel, and collects evidence for a wrong unit."""

    def __init__(self, channel: str, tally: Tally, unit: str = "", cuts: Array | None = None) -> None:
        self.channel, self.tally, self.unit = channel, tally, unit
        self.cuts = np.zeros(0) if cuts is None else cuts
        known = channel_of(channel)
        self.low, self.high = LIMITS.get((channel, unit), (known.low, known.high))
        self.reason = f"outside {self.low:g}..{self.high:g} {known.unit}"
        if known.unit in ("1", "interface"):
            self.reason = f"outside {self.low:g}..{self.high:g} {unit}".strip()
        self.measured = self.outside = self.none = 0  # samples, those out of range, those that are no values
        self._nonzero = self._negative = 0
        self._size_below = self._size_above = 0.0  # sums of magnitudes below zero and above
        self._crossings = self._gradual = 0
        self._values = np.zeros(0)  # magnitudes of those outside, the first _KEPT
        self.head = np.zeros(0), np.zeros(0)  # times and numbers as they came, the first _KEPT
        self.remarks: list[str] = []

    def masked(self, time: Array, values: Array) -> Array:
        """The values (n,) with NaN for those out of range. Negative speeds of reversing are kept: see
        `reversing`."""
        low = REVERSE_LOW if self.channel == "speed" else self.low
        valid = ~np.isnan(values)
        with np.errstate(invalid="ignore"):
            outside = (values < low) | (values > self.high)
        self.measured = int(valid.sum())
        self.head = time[valid][:_KEPT], values[valid][:_KEPT]
        if self.channel in _OF_UNITS:
            self._look(values[valid], outside[valid], low)
        if outside.any():
            self.set_aside(self.reason, time, values, outside)
            values = np.where(outside, np.nan, values)
        for reason, none in impossible(self.channel, self.unit, time, values):
            self.set_aside(reason, time, values, none)
            self.none += int(none.sum())
            values = np.where(none, np.nan, values)
        return self._on_one_zero(time, values) if self.channel == "elevation" else values

    def _on_one_zero(self, time: Array, height: Array) -> Array:
        """The height (n,) without changes of its zero, which are remarked."""
        for at, by in zero_changes(time, height, self.cuts):
            height = np.where(np.arange(len(height)) >= at, height - by, height)
            self.remarks.append(
                f"elevation changes its zero by {by:+.1f} m at {moment(time[at])}: the step is set aside, "
                "and what follows is given above the zero before"
            )
        return height

    def set_aside(self, reason: str, time: Array, values: Array, these: Mask) -> None:
        """Count samples that are not used, with the time and value of the first one."""
        self.outside += int(these.sum()) if reason == self.reason else 0
        if these.any():
            k = int(np.argmax(these))
            self.tally.set_aside(reason, f"at {moment(time[k])} ({values[k]:.6g})", int(these.sum()))

    def _look(self, values: Array, outside: Mask, low: float) -> None:
        size = np.minimum(np.abs(values), self.high)
        self._nonzero = int((values != 0.0).sum())
        self._negative = int((values < low).sum())
        self._size_below = float(size[values < 0.0].sum())
        self._size_above = float(size[values > 0.0].sum())
        if not outside.any():
            return
        self._values = np.abs(values[outside & (values != 0.0)])[:_KEPT]
        steps = np.abs(np.diff(np.clip(values, -1e12, 1e12)))  # infinities have no difference
        inside = ~(outside[1:] | outside[:-1])
        across = outside[1:] != outside[:-1]
        usual = 2.0 * float(np.quantile(steps[inside], 0.9)) if inside.sum() >= 20 else 0.0
        self._crossings = int(across.sum())
        self._gradual = int((steps[across] <= usual).sum())

    def check(self, name: str, interface: TruckInterface, measured: Measured) -> None:
        """Raises InputError if numbers are none of the channel in any unit, or if one factor would make most
        samples of a required channel or grade plausible.

        `measured` gives the factor of a channel to what the others say, which decides between units.
        """
        if self.channel == "speed" and (says := lost_decimals(self.head[1])):
            raise InputError(f"'{name}': {self.channel}: {says}")
        if self.channel not in _OF_UNITS or not self.outside:
            return
        first = self.tally.aside[self.reason].first
        count = f"{self.outside} of {self.measured} samples of '{self.channel}'"
        what = f"'{name}': {count} are {self.reason}, first {first}"
        signed = self.channel in ("speed", "brake_command")  # a negative engine command retards
        if signed and self._negative > 0.5 * self._nonzero and self._size_below > self._size_above:
            meaning = CHANNELS[self.channel].meaning
            raise InputError(f"{what}: {self.channel} has the wrong sign ({meaning}): give it 'scale: -1'")
        values = self._values
        if not self._is_of_other_unit(values):
            return
        if says := lost_decimals(self.head[1]):
            raise InputError(f"{what}: {says}")
        unit = interface.unit(self.channel)
        if (self.channel, unit) == ("engine_command", "percent") and values.max() <= RAW_TORQUE[1]:
            raise InputError(
                f"{what}: percent torque of J1939 without its offset. Give it 'offset: {-RAW_TORQUE[0]:g}'"
            )
        least, largest, units = _OTHER_UNITS.get((self.channel, unit), (0.0, 0.0, {}))
        usual = float(np.quantile(values, 0.9))
        fits = {other: factor for other, factor in units.items() if least <= usual / factor <= largest}
        seen = measured(self.channel)
        if fits and seen is not None:
            near = {other: f for other, f in fits.items() if abs(f / seen.factor - 1.0) < NEAR_UNIT}
            fits = near or {"another unit": seen.factor}
            what = f"{what} ({seen.factor:.4g} times what {seen.by})"
        if len(fits) == 1:
            ((other, factor),) = fits.items()
            raise InputError(
                f"{what}: {self.channel} is {factor:.3g} times too large: {other}? "
                f"Give it its unit, or 'scale: {1 / factor:.6g}'"
            )
        if fits:
            accepted = known_units(self.channel)
            known = " or ".join(
                f"'unit: {other}'" if other.lower() in accepted else f"'scale: {1 / factor:.6g}' ({other})"
                for other, factor in fits.items()
            )
            raise InputError(f"{what}: its numbers may be in one of several units. Give it {known}")

    def _is_of_other_unit(self, values: Array) -> bool:
        """Whether most samples are wrong: most nonzero ones are out of range, or they leave the range as
        gradually as they change within it, so that those within are wrong too. A fault leaves it by a
        jump."""
        if not len(values) or self.outside <= _SUSPECT_SHARE * self._nonzero:
            return False
        same = bool(values.min() == values.max())
        code = same and (self.outside < self._nonzero or _is_code(float(values[0])))
        most = self.outside > 0.5 * self._nonzero and not code
        return most or self._gradual > 0.5 * self._crossings


def _is_code(value: float) -> bool:
    """Whether a value is infinite, or a raw 'not available': all bits set, times a power of ten."""
    if np.isinf(value):
        return True
    exponents = np.log10(value / np.array([2.0**8 - 1, 2.0**15 - 1, 2.0**16 - 1, 2.0**32 - 1]))
    return bool((np.abs(exponents - np.round(exponents)) < 1e-4).any())


def reversing(time: Array, speed: Array, gear: Array) -> Mask:
    """Samples (n,) of reversing: backward from standstill to standstill, faster than creeping.

    A sensor without a sign reverses while `gear` (n,), NaN where unknown, is negative. A drop below zero that
    is faster than a truck can brake is a fault and not reversing.
    """
    with np.errstate(invalid="ignore"):
        signed = np.where((gear < 0.0) & (speed <= -REVERSE_LOW), -np.abs(speed), speed)
    found = np.zeros(len(speed), dtype=bool)
    valid = np.flatnonzero(~np.isnan(signed))
    t, v = time[valid], signed[valid]
    if not len(v) or not (v < CHANNELS["speed"].low).any():
        return found
    starts = np.flatnonzero(np.diff(v < 0.0, prepend=not v[0] < 0.0))
    ends = np.append(starts[1:], len(v))
    lowest = np.minimum.reduceat(v, starts)
    for k in np.flatnonzero(lowest < CHANNELS["speed"].low):
        i, j = int(starts[k]), int(ends[k])
        edges = [(e - 1, e) for e in (i, j) if 0 < e < len(v)]
        if all(
            abs(v[b] - v[a]) <= _DEAD_BAND - CHANNELS["acceleration"].low * (t[b] - t[a]) for a, b in edges
        ):
            found[valid[i:j]] = True
    return found
