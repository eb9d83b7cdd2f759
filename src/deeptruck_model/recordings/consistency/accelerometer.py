"""Whether an accelerometer follows the derivative of speed, and whether gravity is in its reading."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.constants import GRAVITY
from deeptruck_model.recordings.consistency.windows import (
    CORRELATED,
    DRIVING_M_S,
    LEAST,
    SCALE,
    SLOW_S,
    WINDOW_S,
    Doubt,
    joined,
    late,
    windows,
)
from deeptruck_model.recordings.recording import FROM_SPEED, Recording

UNRELATED = 0.3  # correlation below which it is no acceleration along the truck
VARIED, STILL = 0.1, 0.1  # m/s^2, standard deviation of dv/dt that shows an accelerometer; share of it
STEADY_MEAN_S, FILTERED_S = 30.0, 0.5  # over which a high-pass filter shows; by which one is late
TURNED = 0.9  # of dv/dt: less is more than the body's pitch and a scale error; turned by 26 degrees
CLIPPED = 0.005  # share of samples at one end of the range
HAS_GRAVITY = 0.5  # of g times the slope of the road
# m/s^2, sd of what a sensor and dv/dt differ by in means over SLOW_S: a slope of 0.3 % on a road and pitch;
# beyond an accelerometer's drift; and what no drive on a road is below if gravity is in the sensor
FELT, FLAT = 0.03, 0.005
OFFSET = 0.15  # m/s^2; 1 degree of tilt is 0.17
WITHOUT = "or leave acceleration out, and it is derived from speed"


@dataclass(frozen=True)
class Accelerometer:
    """Least-squares fit of the accelerometer: slope * dv/dt + offset + gravity * g * sin(road slope).

    `correlation` is between dv/dt and the reading minus offset and road slope; `gravity` is NaN on a level
    road or if no grade is known. `still` is the ratio of the standard deviations of its samples and of dv/dt.
    """

    slope: float
    offset: float
    gravity: float
    correlation: float
    still: float


def accelerometer(recordings: Sequence[Recording], channel: str = "acceleration") -> Accelerometer | None:
    """Fit the accelerometer in a channel; None if it is not measured, or speed hardly changes."""
    rise, mean, slope = windows(recordings, WINDOW_S, "speed", channel, "grade")
    known = np.isfinite(rise) & np.isfinite(mean)
    if known.sum() < LEAST or rise[known].std() < VARIED:
        return None
    graded = known & np.isfinite(slope)
    road = GRAVITY * np.sin(np.arctan(slope))
    hilly = graded.sum() > 0.5 * known.sum() and road[graded].std() > VARIED
    known = graded if hilly else known
    d, a = rise[known], mean[known]
    columns = [d, np.ones_like(d), *([road[known]] if hilly else [])]
    fit = np.linalg.lstsq(np.column_stack(columns), a, rcond=None)[0]
    left = a - np.column_stack(columns[1:]) @ fit[1:]
    correlation = float(np.corrcoef(d, left)[0, 1]) if left.std() > 0.0 else 0.0
    return Accelerometer(
        float(fit[0]), float(fit[1]), float(fit[2]) if hilly else np.nan, correlation,
        float(np.nanstd(joined(recordings, channel)) / d.std()),
    )  # fmt: skip


@dataclass(frozen=True)
class Felt:
    """Whether a sensor's reading has gravity in it: `channel` is specific_force if so, acceleration if not,
    None if the drive does not show it. `by` is the evidence, as text."""

    channel: str | None
    by: str


def felt(recordings: Sequence[Recording], channel: str) -> Felt | None:
    """Whether an accelerometer's reading has gravity in it, by what it and dv/dt differ by over SLOW_S, and
    by a recorded slope. None if the channel is not measured, or does not follow the speed."""
    found = accelerometer(recordings, channel)
    if found is None or found.correlation < CORRELATED or not SCALE[0] < found.slope < SCALE[1]:
        return None
    rise, mean, speed, slope = windows(recordings, SLOW_S, "speed", channel, "speed", "grade")
    use = np.isfinite(rise) & np.isfinite(mean) & (speed > DRIVING_M_S)
    if use.sum() < LEAST:
        return None
    apart = float(np.std((mean - found.slope * rise)[use]))
    if apart < 1e-6:
        return None  # it was derived from the speed
    by = f"it and the derivative of speed differ by {apart:.3f} m/s² over {SLOW_S:g} s"
    road = GRAVITY * float(np.nan_to_num(slope)[use].std())
    if abs(found.gravity) > HAS_GRAVITY:
        return Felt("specific_force", f"it has {found.gravity:.2f} g times the recorded slope in it")
    if np.isfinite(found.gravity) and apart < HAS_GRAVITY * road:
        return Felt("acceleration", f"it has {found.gravity:.2f} g times the recorded slope in it")
    if apart > FELT:
        return Felt("specific_force", f"{by}, as a road's slope does")
    return Felt("acceleration" if apart < FLAT else None, by)


def doubts(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts about measured accelerations; those that were derived from the speed are not judged."""
    own = [r for r in recordings if FROM_SPEED not in r.notes]
    for name, pieces in (("acceleration", own), ("specific_force", recordings)):
        if measured := [r for r in pieces if name in r.channels]:
            yield from _doubts(measured, name)


def _doubts(recordings: Sequence[Recording], name: str) -> Iterator[Doubt]:
    found = accelerometer(recordings, name)
    if found is None:
        return
    without = WITHOUT if name == "acceleration" else "or leave it out"
    if found.still < STILL:
        yield Doubt(
            name,
            f"{name} stands still at {found.offset:.2g} m/s² while the speed changes: it is another "
            f"axis or a sensor that failed; take another, {without}",
            wrong=True,
        )
        return
    by = f"{found.slope:.2f} times the derivative of speed (correlation {found.correlation:.2f})"
    if found.correlation < -CORRELATED:
        yield Doubt(
            name, f"{name} has the wrong sign, it is {by}: give it 'scale: -1', {without}", True, -1.0
        )
    elif found.correlation < CORRELATED:
        yield Doubt(
            name,
            f"{name} does not follow the speed, it is {by}: take another axis, {without}",
            wrong=abs(found.correlation) < UNRELATED,
        )
        return
    clipped = _clipped(recordings, name, found)
    filtered = _filtered(recordings, name, found)
    scaled = not SCALE[0] < abs(found.slope) < SCALE[1]
    if clipped is not None:
        yield Doubt(name, f"{name} {clipped}, {without}", wrong=scaled)
    if filtered is not None:
        yield Doubt(name, f"{name} {filtered}, {without}", wrong=scaled)
    if found.slope > 0.0 and scaled and clipped is None and filtered is None:
        g = (" (m/s^2 read as g)" if abs(found.slope / GRAVITY - 1) < 0.1
             else " (g read as m/s^2)" if abs(found.slope * GRAVITY - 1) < 0.1 else "")  # fmt: skip
        yield Doubt(
            name,
            f"{name} is {by}{g}: give it its unit or 'scale: {1 / found.slope:.4g}', {without}",
            True,
            found.slope,
        )
    elif SCALE[0] < found.slope < TURNED and filtered is None:
        result = (
            "the slope from it is scaled by that"
            if name == "specific_force"
            else f"take the whole, {without}"
        )
        yield Doubt(name, f"{name} is {by}, as of a sensor that is turned, or of one component: {result}")
    if abs(found.offset) > OFFSET:
        tilt = degrees_of_tilt(found.offset)
        also = ""
        if np.isnan(found.gravity):
            also = f", or of one that feels gravity on a slope of {100 * np.tan(np.radians(tilt)):.0f} %"
        yield Doubt(
            name,
            f"{name} is {found.offset:+.2f} m/s² off the derivative of speed, as of a sensor tilted by "
            f"{tilt:.1f} degrees{also}: correct it by 'offset', {without}",
        )


def _clipped(recordings: Sequence[Recording], name: str, found: Accelerometer) -> str | None:
    """That an accelerometer is at an end of its range for some time; None if it is not."""
    reading = joined(recordings, name)
    reading = reading[np.isfinite(reading)]
    for end in (reading.min(), reading.max()) if len(reading) else ():
        if (share := float(np.mean(reading == end))) > CLIPPED and abs(end) > abs(found.offset) + 2 * VARIED:
            return (
                f"is at {end:.3g} m/s² in {share:.1%} of its samples: its range is too small, and "
                "what lies beyond is not known; record it with a larger one"
            )
    return None


def _filtered(recordings: Sequence[Recording], name: str, found: Accelerometer) -> str | None:
    """That a filter has taken what is fast or what is slow from an accelerometer; None if neither."""
    rise, mean = windows(recordings, STEADY_MEAN_S, "speed", name)
    use = np.isfinite(rise) & np.isfinite(mean)
    if use.sum() > LEAST:
        d, a = rise[use] - rise[use].mean(), (mean[use] - mean[use].mean()) / found.slope
        gain = float(d @ a / (d @ d))
        error = float(np.std(a - gain * d) / np.sqrt(d @ d))
        if gain + 2.0 * error < 0.5:
            return (
                f"follows the speed over {WINDOW_S:g} s and not over {STEADY_MEAN_S:g} s: a filter has "
                "taken what is slow, the road's slope too; record it without"
            )
    longest = max(recordings, key=len)
    width = WINDOW_S / 4.0 / longest.dt
    speed, reading = (np.nan_to_num(longest.channels[c]) for c in ("speed", name))
    rate = gaussian_filter1d(np.diff(speed, prepend=speed[:1]) / longest.dt, width)
    late_s = late(rate, gaussian_filter1d((reading - found.offset) / found.slope, width), longest.dt)[0]
    if late_s > FILTERED_S:
        return f"is {late_s:.1f} s behind the derivative of speed, as by a filter: record it without"
    return None


def degrees_of_tilt(offset: float) -> float:
    """Tilt, degrees, of a sensor that reads `offset` (m/s^2) of gravity on a level road."""
    return float(np.degrees(np.arcsin(min(abs(offset) / GRAVITY, 1.0))))
