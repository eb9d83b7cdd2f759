"""Whether speed and grade follow every other channel that says the same thing, and by which factor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings.consistency.accelerometer import UNRELATED, accelerometer
from deeptruck_model.recordings.consistency.windows import (
    CORRELATED,
    DRIVING_M_S,
    LEAST_SLOW,
    MOVING_M_S,
    SCALE,
    SLOW_S,
    WINDOW_S,
    Doubt,
    joined,
    windows,
)
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.ranges import Seen
from deeptruck_model.recordings.recording import FROM_SPEED, Recording
from deeptruck_model.recordings.units import SPEED_RATIOS, metres_per_degree
from deeptruck_model.recordings.words import LEADER, header

COARSE = 0.1  # of the way in a window: positions of a larger step give no speed
LENGTHS = {"m": 1.0, "km": 1000.0, "mi": 1609.344, "ft": 0.3048}
MEASURED = ("speed", "acceleration", "grade")  # channels that others give too
TRAVELLED = frozenset(("distance", "odometer", "trip", "total", "mileage"))
NEAR_UNIT = 0.02  # relative, as tyres differ
SPEEDS = {ratio: f"{one} read as {other}" for (one, other), ratio in SPEED_RATIOS.items()}  # times too large
ACCELEROMETERS = {  # the same, compared with an accelerometer that is read so
    1 / 9.80665: "an accelerometer in m/s^2 read as g",
    9.80665: "an accelerometer in g read as m/s^2",
}
LEAST_VARIED = 20  # windows by which one is seen not to follow the other
VARIED_M_S, STILL = (
    1.0,
    0.05,
)  # standard deviation of speeds that can be correlated; part of that of one that stands
# of differences between windows: m/s^2 of dv/dt and slope that can be correlated; correlation of a body's
# pitch, and its share of the slope that would slow a truck as much
LEAST_CHANGE, LEAST_PITCH, PITCHED, MOST_PITCH = 0.1, 0.0005, 0.8, 0.4
LEAST_SLOPE, STEPS = 0.005, 2.0  # standard deviation of slopes by heights; the same in steps of these
GRADE_OFF, OFF_SD = 0.01, 5.0  # slope, and standard errors, that a grade may be off on average
STEP_S = 0.1  # of a drive that is put together for a comparison


def factor_of(factor: float, taken: Mapping[float, str]) -> str:
    """The unit error that explains a factor, among those `taken` for others; '' for most factors."""
    return next((what for known, what in taken.items() if abs(factor / known - 1.0) < NEAR_UNIT), "")


@dataclass(frozen=True)
class Comparison:
    """A channel is `factor` times what `by` gives; `correlation` is that of the two, NaN if it was not
    looked at. `otherwise` is the cure apart from a scale or unit, `windows` the number compared."""

    by: str
    factor: float
    correlation: float = np.nan
    otherwise: str = ""
    windows: int = 0


def comparisons(recordings: Sequence[Recording], channel: str) -> Iterator[Comparison]:
    """Speed, acceleration or grade against each other channel that gives it too."""
    if channel == "grade":
        yield from _grade_by_height(recordings)
        return
    derived = any(FROM_SPEED in r.notes for r in recordings)
    found = None if derived else accelerometer(recordings)
    if found is not None and found.slope:
        factor = found.slope if channel == "acceleration" else 1.0 / found.slope
        by = "the derivative of speed gives" if channel == "acceleration" else "acceleration gives"
        yield Comparison(by, factor, found.correlation)
    if channel == "speed":
        yield from _speed_by_places(recordings)
        yield from _speed_by_distance(recordings)


def against_pose(speed: Series, time: Array, x: Array, y: Array) -> Iterator[str]:
    """What is wrong with a speed, by the pose, in m, of the same messages."""
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < 2:
        return
    (east_m,), (north_m,) = metres_per_degree(np.zeros(1))
    at = time[known]
    places = {"longitude": Series(at, x[known] / east_m), "latitude": Series(at, y[known] / north_m)}
    for one in _speed_by_places([as_drive({"speed": speed, **places})], slowest=-np.inf):
        if one.correlation < UNRELATED:
            yield (
                f"speed does not follow the pose of its messages (correlation {one.correlation:.2f}), as "
                "where a twist was frozen or never filled: take another speed"
            )


def _speed_by_places(recordings: Sequence[Recording], slowest: float = DRIVING_M_S) -> Iterator[Comparison]:
    """By latitude and longitude over SLOW_S, or in a short drive over WINDOW_S if these are fine enough."""
    places = [r.channels["latitude"] for r in recordings if "latitude" in r.channels]
    coarse = max(map(_resolution, places), default=0.0)
    for window_s in (SLOW_S, WINDOW_S):
        north, speed, latitude = windows(recordings, window_s, "latitude", "speed", "latitude")
        (east,) = windows(recordings, window_s, "longitude")
        if len(east) != len(north):
            return
        east_m, north_m = metres_per_degree(latitude)
        pace = np.hypot(north * north_m, east * east_m)
        least = np.maximum(MOVING_M_S, coarse * north_m / (COARSE * window_s))
        moving = (speed > slowest) & (pace > least)
        if moving.sum() < LEAST_SLOW:
            continue
        varied = min(speed[moving].std(), pace[moving].std()) > VARIED_M_S and moving.sum() >= LEAST_VARIED
        stands = speed[moving].std() < STILL * pace[moving].std() and pace[moving].std() > VARIED_M_S
        correlation = float(np.corrcoef(speed[moving], pace[moving])[0, 1]) if varied else np.nan
        yield Comparison(
            "latitude and longitude give",
            float(np.median(speed[moving] / pace[moving])),
            0.0 if stands else correlation,
            otherwise="leave the places out",
        )
        return


def _resolution(values: Array) -> float:
    """The smallest step between values (n,) of a channel; 0 if it is constant."""
    known = np.unique(values[np.isfinite(values)])
    return float(np.diff(known).min(initial=np.inf)) if len(known) > 1 else 0.0


def _speed_by_distance(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    """By channels under user-defined names that state a length, such as trip_km."""
    for name in dict.fromkeys(c for r in recordings for c in r.channels if c not in CHANNELS):
        if not (metres := metres_of(name)):
            continue
        rise, speed = windows(recordings, SLOW_S, name, "speed")
        moving = (speed > DRIVING_M_S) & (metres * rise > MOVING_M_S)
        if moving.sum() >= LEAST_SLOW:
            factor = float(np.sum(speed[moving]) / np.sum(metres * rise[moving]))
            yield Comparison(f"'{name}' gives", factor, otherwise=f"leave '{name}' out")


def speed_doubts(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts about a speed that does not follow places or a distance, or is a factor of what they give."""
    for one in (*_speed_by_places(recordings), *_speed_by_distance(recordings)):
        if one.correlation < UNRELATED:
            yield Doubt(
                "speed",
                f"speed does not follow what {one.by} (correlation {one.correlation:.2f}): are both of one "
                f"vehicle, on one clock? Take another speed, or {one.otherwise}",
                wrong=True,
            )
        elif not SCALE[0] ** 0.25 < one.factor < SCALE[1] ** 0.25:
            what = factor_of(one.factor, SPEEDS)
            cure = f"'scale: {1 / one.factor:.4g}'"
            why = f", as {what}: give it its unit, or {cure}" if what else f": correct it by {cure}"
            says = f"speed is {one.factor:.3f} times what {one.by}{why}, or {one.otherwise}"
            yield Doubt("speed", says, bool(what), one.factor)


def measured(channel: str, series: Mapping[str, Series]) -> Seen | None:
    """The factor of one of MEASURED, in whatever unit, to what another channel gives: of a speed places or a
    distance, else an accelerometer; None without any.

    `series` are the channels as they came; those of `channel` need not be possible.
    """
    if channel not in MEASURED or not {channel, "speed"} <= series.keys():
        return None
    found = comparisons([as_drive(series)], channel)
    sound = [one for one in found if one.factor > 0.0 and not one.correlation < CORRELATED]
    best = next((one for one in sound if "acceleration" not in one.by), next(iter(sound), None))
    return None if best is None else Seen(best.by, best.factor)


def as_drive(series: Mapping[str, Series]) -> Recording:
    """Channels on one clock, as one recording, whatever their numbers are; for comparisons only."""
    times = [one.valid.time for one in series.values() if len(one.valid.time) > 1]
    begin, end = max(t[0] for t in times), min(t[-1] for t in times)
    ticks = np.arange(begin, max(end, begin + 2 * STEP_S), STEP_S)
    channels = {
        c: np.interp(ticks, one.valid.time, one.valid.values)
        for c, one in series.items()
        if len(one.valid.time)
    }
    return Recording("compared", STEP_S, channels, TruckInterface("compared"))


def metres_of(name: str) -> float:
    """Unit of a column of distance travelled, in m, by its name; 0 for any other column."""
    named = header(name)
    return LENGTHS.get(named.unit, 0.0) if named.words & TRAVELLED and not named.words & LEADER else 0.0


def grade_doubts(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """The doubt from the body's pitch or from heights."""
    without = (
        ", and it is derived from elevation" if any("elevation" in r.channels for r in recordings) else ""
    )
    pitch = _pitch(recordings)
    if pitch is not None:
        yield Doubt(
            "grade",
            f"grade follows the derivative of speed ({np.degrees(pitch.factor):+.2f} degrees per m/s², "
            f"correlation {pitch.correlation:.2f}), as the pitch of the body or of a phone does: it is no "
            f"slope of the road; leave it out{without}",
            wrong=True,
        )
        return
    for one in _grade_by_height(recordings):
        says = f"grade is {one.factor:.3g} times what {one.by} (correlation {one.correlation:.2f})"
        if one.correlation < -CORRELATED:
            yield Doubt("grade", f"{says}: uphill is positive, give it 'scale: -1'", factor=-1.0)
            return
        if one.correlation > CORRELATED and not 0.33 < one.factor < 3.0:
            cure = f"give it its unit (ratio, percent, deg), or 'scale: {1 / one.factor:.3g}'"
            yield Doubt("grade", f"{says}: {cure}", factor=one.factor)
            return
        if one.correlation < UNRELATED and one.windows >= LEAST_VARIED:
            yield Doubt(
                "grade",
                f"grade does not follow what {one.by} (correlation {one.correlation:.2f}): leave it "
                f"out{without}, or leave elevation out",
                wrong=True,
            )
            return
    off = _grade_offset(recordings)
    if off:
        follows = any(one.correlation > CORRELATED for one in _grade_by_height(recordings))
        cure = "correct it by 'offset', or " if follows else "that it follows them is not seen: "
        says = f"grade is {off:+.3f} off what height over distance gives: {cure}leave it out{without}"
        yield Doubt("grade", says)


def _pitch(recordings: Sequence[Recording]) -> Comparison | None:
    """The grade against dv/dt, by what both change by from window to window, in which no road changes as the
    speed does. A road slows a truck by g times its slope; a body pitches by a tenth of that or less."""
    rise, grade = windows(recordings, WINDOW_S, "speed", "grade")
    known = np.isfinite(rise) & np.isfinite(grade)
    d, g = np.diff(rise[known]), np.diff(grade[known])
    if len(d) < LEAST_VARIED or d.std() < LEAST_CHANGE or g.std() < LEAST_PITCH:
        return None
    correlation, factor = float(np.corrcoef(d, g)[0, 1]), float(d @ g / (d @ d))
    follows = abs(correlation) > PITCHED and abs(factor) < MOST_PITCH / GRAVITY
    return Comparison("the derivative of speed gives", factor, correlation) if follows else None


def _grade_offset(recordings: Sequence[Recording]) -> float:
    """What the mean of grade is off that of height over distance; 0 where errors of heights may explain
    it."""
    rise, grade = _slopes_of_height(recordings)
    if len(rise) < LEAST_SLOW:
        return 0.0
    apart = grade - rise
    error = float(apart.std() / np.sqrt(len(apart)))
    off = float(apart.mean())
    return off if abs(off) > max(GRADE_OFF, OFF_SD * error) else 0.0


def _grade_by_height(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    """Only where heights vary by more than their resolution, which those of a flat road in steps of 1 m do
    not."""
    rise, grade = _slopes_of_height(recordings)
    heights = [r.channels["elevation"] for r in recordings if "elevation" in r.channels]
    speed = joined(recordings, "speed")
    pace = float(np.median(speed[speed > DRIVING_M_S])) if len(rise) else 1.0
    least = max(LEAST_SLOPE, STEPS * max(map(_resolution, heights), default=0.0) / (SLOW_S * pace))
    if len(rise) >= LEAST_SLOW and rise.std() >= least and grade.std():
        factor = float(grade @ rise / (rise @ rise))
        found = float(np.corrcoef(rise, grade)[0, 1])
        yield Comparison("height over distance gives", factor, found, windows=len(rise))


def _slopes_of_height(recordings: Sequence[Recording]) -> tuple[Array, Array]:
    """Slopes by height over distance, and by the grade, in windows (n,) of SLOW_S."""
    climb, speed, grade = windows(recordings, SLOW_S, "elevation", "speed", "grade")
    use = np.isfinite(climb) & np.isfinite(grade) & (speed > DRIVING_M_S)
    return climb[use] / speed[use], grade[use]
