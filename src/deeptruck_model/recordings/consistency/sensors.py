"""Sensors that contradict one another.

`doubts` compares the channels of recordings: a `Doubt` states the probable cause and the key that settles it,
and is `wrong` if training on the channel would give a different truck.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.constants import GRAVITY
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.channel_words import LEADER
from deeptruck_model.recordings.earth import metres_per_degree
from deeptruck_model.recordings.recording import FROM_SPEED, Recording
from deeptruck_model.recordings.tables.header_words import header
from deeptruck_model.signals import CHANNELS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW_S, SLOW_S = 2.0, 10.0  # over which rates of change are taken, those of heights and places
LEAST, LEAST_SLOW = 10, 8  # windows that do not overlap, of WINDOW_S and of SLOW_S
VARIED, STILL = 0.1, 0.1  # m/s^2, standard deviation of dv/dt that shows an accelerometer; share of it
CORRELATED, SCALE = 0.7, (0.67, 1.5)
STEADY_MEAN_S, FILTERED_S = 30.0, 0.5  # over which a high-pass filter shows; by which one is late
TURNED = 0.9  # of dv/dt: less is more than the body's pitch and a scale error; turned by 26 degrees
CLIPPED = 0.005  # share of samples at one end of the range
HAS_GRAVITY = 0.5  # of g times the slope of the road
# m/s^2, sd of what a sensor and dv/dt differ by in means over SLOW_S: a slope of 0.3 % on a road and pitch;
# beyond an accelerometer's drift; and what no drive on a road is below if gravity is in the sensor
FELT, FLAT = 0.03, 0.005
OFFSET = 0.15  # m/s^2; 1 degree of tilt is 0.17
MOVING_M_S, DRIVING_M_S = 1.0, 3.0
COARSE = 0.1  # of the way in a window: positions of a larger step give no speed
STEADY_S, STEADY = 1.0, 0.01  # in which engine speed over speed changes by less: gear engaged, clutch closed
TURNING_M_S, TURNING_RAD_S = 3.0, 80.0  # above creeping and idling
LEAST_STEADY_S = 60.0  # of steady driving, to judge by
ALIKE, MOST_GEARS, OF_TIME = (
    0.04,
    20,
    0.7,
)  # relative width of a ratio; gears that hold this share of the time
RATIOS = (2.0, 110.0)  # rad/m, engine speed over speed: below a car's top gear, above a truck's first
LENGTHS = {"m": 1.0, "km": 1000.0, "mi": 1609.344, "ft": 0.3048}
OTHER_SPEED = "another speed"  # name of a second speed that is compared
TRAVELLED = frozenset(("distance", "odometer", "trip", "total", "mileage"))
LEAST_ENGINE_RPM = 400.0  # diesel engines idle at 500 to 800 rpm, those of trucks/pool at 600
FASTEST_TRUCK = 36.0  # m/s, 130 km/h: no truck is driven faster
AIR_BRAKE_BAR = 15.0  # compressors of trucks are set to 8 to 13 bar
PRESSED, BOTH_SHARE = 0.2, 0.1  # of a command's largest value; of the time in which the brake is pressed
NEAR_UNIT = 0.02  # relative, as tyres differ
SPEEDS = {  # what speed is multiplied by where it is read so
    3.6: "km/h read as m/s",
    1 / 3.6: "m/s read as km/h",
    2.2369: "mph read as m/s",
    1 / 2.2369: "m/s read as mph",
    1.6093: "km/h read as mph",
    1 / 1.6093: "mph read as km/h",
    1.9438: "knots read as m/s",
    1 / 1.9438: "m/s read as knots",
}
ACCELEROMETERS = {  # the same, compared with an accelerometer that is read so
    1 / 9.80665: "an accelerometer in m/s^2 read as g",
    9.80665: "an accelerometer in g read as m/s^2",
}
SLOPES = {  # what gravity has to a slope that is read so
    -1.0: "uphill is positive: give it 'scale: -1'",
    0.573: "percent read as degrees, or a speed in mph read as km/h? Give both their units",
    1.745: "degrees read as percent, or a speed in km/h read as mph? Give both their units",
}
OTHER_SLOPE = "is it of this road, on this clock and in its unit?"
NEAR_SLOPE = 0.15  # relative: wheels and engine turn with the truck
WEIGHTED = 0.25  # by which gravity may seem to differ, as engine and tyres are not known; and standard errors
LEAST_DRIVEN, DRIVEN_SD, BLOCKS = 60, 4.0, 10  # windows without brakes; parts that are left out in turn
LATEST_S = 5.0  # by which one speed may be later than another
WITHOUT = "or leave acceleration out, and it is derived from speed"


@dataclass(frozen=True)
class Doubt:
    """A contradiction between channels, with the key that settles it; `channel` is the doubtful one, `factor`
    the ratio to the expected value if that is the only error."""

    channel: str
    says: str
    wrong: bool = False
    factor: float = 1.0


def refuse(recordings: Sequence[Recording]) -> None:
    """Raise InputError if a channel contradicts the others so much that a wrong truck would be learned."""
    for doubt in doubts(recordings):
        if doubt.wrong:
            raise InputError(f"'{recordings[0].name.partition('#')[0]}': {doubt.says}")


def doubts(recordings: Sequence[Recording]) -> list[Doubt]:
    """The doubts about one source's pieces; each channel is compared with the others."""
    checks = (
        _accelerometers,
        _speed,
        _grade,
        _engine_speed,
        _ratios,
        _commands,
        _fastest,
    )
    return [doubt for check in checks for doubt in check(recordings)]


def of_inputs(recordings: Sequence[Recording], channels: Collection[str]) -> list[str]:
    """The doubts about `channels`, which a truck is driven with and judged by, with what to do: one of each
    channel, with the sources in which it is doubted if not in all, or of what all of them show together."""
    sources = {n: list(r) for n, r in groupby(recordings, lambda r: r.name.partition("#")[0])}
    found: dict[str, dict[str, str]] = {}
    for name, pieces in sources.items():
        for doubt in doubts(pieces):
            found.setdefault(doubt.channel, {}).setdefault(name, doubt.says)
    together = {doubt.channel: doubt.says for doubt in doubts(recordings)} if len(sources) > 1 else {}
    out = []
    for channel in channels:
        one = found.get(channel, {})
        if 0 < len(one) < 0.5 * len(sources):
            out.append(f"{', '.join(one)}: {next(iter(one.values()))}")
        elif one or channel in together:
            out.append(together.get(channel) or next(iter(one.values())))
    return out


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
    rise, mean, slope = _windows(recordings, WINDOW_S, "speed", channel, "grade")
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
        float(np.nanstd(np.concatenate([r.channels[channel] for r in recordings if channel in r.channels]))
              / d.std()),
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
    rise, mean, speed, slope = _windows(recordings, SLOW_S, "speed", channel, "speed", "grade")
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


def _accelerometers(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts about what was measured: an acceleration may be derived from the speed."""
    own = [r for r in recordings if FROM_SPEED not in r.notes]
    for name, pieces in (("acceleration", own), ("specific_force", recordings)):
        if measured := [r for r in pieces if name in r.channels]:
            yield from _accelerometer(measured, name)


def _accelerometer(recordings: Sequence[Recording], name: str) -> Iterator[Doubt]:
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
    elif name == "specific_force" and SCALE[0] < found.slope < TURNED and filtered is None:
        yield Doubt(
            name, f"{name} is {by}, as of a sensor that is turned: the slope from it is scaled by that"
        )
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
    reading = np.concatenate([r.channels[name] for r in recordings])
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
    rise, mean = _windows(recordings, STEADY_MEAN_S, "speed", name)
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


def late(speed: Array, other: Array, dt: float) -> tuple[float, float, float]:
    """By how much `other` is later than `speed`, s, both (n,) on one clock, and the rms difference before and
    after it is shifted back."""
    count = min(len(speed), len(other))
    most = min(round(LATEST_S / dt), count // 4)

    def rms(shift: int) -> float:
        a, b = speed[max(0, -shift) : count - max(0, shift)], other[max(0, shift) : count - max(0, -shift)]
        both = np.isfinite(a) & np.isfinite(b)
        return float(np.sqrt(np.mean((b - a)[both] ** 2))) if both.any() else np.inf

    best = min(range(-most, most + 1), key=lambda shift: (rms(shift), abs(shift)))
    return best * dt, rms(0), rms(best)


def degrees_of_tilt(offset: float) -> float:
    """Tilt, degrees, of a sensor that reads `offset` (m/s^2) of gravity on a level road."""
    return float(np.degrees(np.arcsin(min(abs(offset) / GRAVITY, 1.0))))


def _windows(recordings: Sequence[Recording], window_s: float, rising: str, *others: str) -> list[Array]:
    """The rate of change of a channel over non-overlapping windows, and the means of other channels
    in them."""
    out: list[list[Array]] = [[] for _ in range(1 + len(others))]
    for r in recordings:
        k = max(1, round(window_s / r.dt))
        if len(r) <= k or rising not in r.channels:
            continue
        at = np.arange(0, len(r) - k, k)
        x = r.channels[rising]
        out[0].append((x[at + k] - x[at]) / (k * r.dt))
        for part, name in zip(out[1:], others, strict=True):
            values = r.channels.get(name, np.full(len(r), np.nan))
            # what is stamped k + 1 is the mean of the step that ends there
            sums = np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
            gaps = np.concatenate([[0], np.cumsum(np.isnan(values))])
            mean = (sums[at + k + 1] - sums[at + 1]) / k
            part.append(np.where(gaps[at + k + 1] > gaps[at + 1], np.nan, mean))
    return [np.concatenate([np.zeros(0), *part]) for part in out]


def factor_of(factor: float, taken: Mapping[float, str]) -> str:
    """The unit error that explains a factor, among those `taken` for others; '' for most factors."""
    return next((what for known, what in taken.items() if abs(factor / known - 1.0) < NEAR_UNIT), "")


@dataclass(frozen=True)
class Comparison:
    """A channel is `factor` times what `by` gives; `correlation` is that of the two, NaN if it was not
    looked at. `otherwise` is the cure apart from a scale or unit."""

    by: str
    factor: float
    correlation: float = np.nan
    otherwise: str = ""


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
        yield from _speed_by_speed(recordings)
        yield from _speed_by_places(recordings)
        yield from _speed_by_distance(recordings)


def _speed_by_speed(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    _, speed, other = _windows(recordings, WINDOW_S, "speed", "speed", OTHER_SPEED)
    use = np.isfinite(speed) & np.isfinite(other)
    speed, other = speed[use], other[use]
    if len(speed) >= LEAST and speed.std() and other.std():
        factor = float(speed @ other / (other @ other))
        yield Comparison("another speed gives", factor, float(np.corrcoef(speed, other)[0, 1]))


def _speed_by_places(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    north, speed, latitude = _windows(recordings, SLOW_S, "latitude", "speed", "latitude")
    (east,) = _windows(recordings, SLOW_S, "longitude")
    if len(east) != len(north):
        return
    east_m, north_m = metres_per_degree(latitude)
    pace = np.hypot(north * north_m, east * east_m)
    places = [r.channels["latitude"] for r in recordings if "latitude" in r.channels]
    coarse = max(map(_resolution, places), default=0.0)
    least = np.maximum(MOVING_M_S, coarse * north_m / (COARSE * SLOW_S))
    moving = (speed > DRIVING_M_S) & (pace > least)
    if moving.sum() >= LEAST_SLOW:
        yield Comparison(
            "latitude and longitude give",
            float(np.median(speed[moving] / pace[moving])),
            otherwise="leave the places out",
        )


def _resolution(values: Array) -> float:
    """The smallest step between values (n,) of a channel; 0 if it is constant."""
    known = np.unique(values[np.isfinite(values)])
    return float(np.diff(known).min(initial=np.inf)) if len(known) > 1 else 0.0


def _speed_by_distance(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    """By channels under user-defined names that state a length, such as trip_km."""
    for name in dict.fromkeys(c for r in recordings for c in r.channels if c not in CHANNELS):
        if not (metres := metres_of(name)):
            continue
        rise, speed = _windows(recordings, SLOW_S, name, "speed")
        moving = (speed > DRIVING_M_S) & (metres * rise > MOVING_M_S)
        if moving.sum() >= LEAST_SLOW:
            factor = float(np.sum(speed[moving]) / np.sum(metres * rise[moving]))
            yield Comparison(f"'{name}' gives", factor, otherwise=f"leave '{name}' out")


def _speed(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    for one in (*_speed_by_places(recordings), *_speed_by_distance(recordings)):
        if SCALE[0] ** 0.25 < one.factor < SCALE[1] ** 0.25:
            continue
        what = factor_of(one.factor, SPEEDS)
        why = f" ({what}): give it its unit" if what else f": correct it by 'scale: {1 / one.factor:.4g}'"
        says = f"speed is {one.factor:.3f} times what {one.by}{why}, or {one.otherwise}"
        yield Doubt("speed", says, bool(what), one.factor)


def metres_of(name: str) -> float:
    """Unit of a column of distance travelled, in m, by its name; 0 for any other column."""
    named = header(name)
    return LENGTHS.get(named.unit, 0.0) if named.words & TRAVELLED and not named.words & LEADER else 0.0


def _grade(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """The doubt from heights; where there is none, that from the motion."""
    for one in _grade_by_height(recordings):
        says = f"grade is {one.factor:.3g} times what {one.by} (correlation {one.correlation:.2f})"
        if one.correlation < -CORRELATED:
            yield Doubt("grade", f"{says}: uphill is positive, give it 'scale: -1'", factor=-1.0)
            return
        if one.correlation > CORRELATED and not 0.33 < one.factor < 3.0:
            cure = f"give it its unit (ratio, percent, deg), or 'scale: {1 / one.factor:.3g}'"
            yield Doubt("grade", f"{says}: {cure}", factor=one.factor)
            return
    yield from _grade_by_motion(recordings)


def _grade_by_motion(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """The slope by its share in dv/dt, which gravity makes -g: robust least squares with engine command, its
    power, speed and its square, while no brake acts."""
    names = ("grade", "engine_command", "brake_command", "speed")
    rise, grade, engine, brake, speed = _windows(recordings, WINDOW_S, "speed", *names)
    fall = GRAVITY * np.sin(np.arctan(grade))
    use = np.isfinite(rise + fall + engine) & (speed > DRIVING_M_S) & ~(brake > 0.0)
    if use.sum() < LEAST_DRIVEN or not all(x[use].std() for x in (rise, fall, engine)):
        return
    rise, fall, engine, speed = rise[use], fall[use], engine[use], speed[use]
    X = np.stack([fall, engine, engine / speed, engine > 0.0, speed, speed**2, np.ones(len(speed))], axis=1)
    scale = float(np.abs(fall).max())
    X = X / np.abs(X).max(axis=0)
    w = np.ones(len(rise))
    for _ in range(8):  # gear changes must not decide
        e = rise - X @ _solved(X, rise, w)
        w = 1.0 / (1.0 + (e / max(2.0 * 1.4826 * float(np.median(np.abs(e))), 1e-9)) ** 2)
    blocks = np.arange(len(w)) * BLOCKS // len(w)  # windows that follow one another are not independent
    each = [-_solved(X, rise, w * (blocks != k))[0] / scale for k in range(BLOCKS)]
    factor, sd = float(-_solved(X, rise, w)[0] / scale), float(np.sqrt(BLOCKS - 1.0) * np.std(each))
    if abs(factor - 1.0) > WEIGHTED + DRIVEN_SD * sd:
        why = min(SLOPES, key=lambda known: abs(factor / known - 1.0))
        says = SLOPES[why] if abs(factor / why - 1.0) < NEAR_SLOPE + DRIVEN_SD * sd else OTHER_SLOPE
        yield Doubt(
            "grade",
            f"the truck feels {factor:.2f} (+- {2.0 * sd:.2f}) times the recorded grade in its speed: {says}",
            factor=1.0 / factor,
        )


def _solved(X: Array, y: Array, weights: Array) -> Array:
    """Weighted least squares of y (n,) on the columns of X."""
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(X * root[:, None], y * root, rcond=None)[0])


def _grade_by_height(recordings: Sequence[Recording]) -> Iterator[Comparison]:
    climb, speed, grade = _windows(recordings, SLOW_S, "elevation", "speed", "grade")
    use = np.isfinite(climb) & np.isfinite(grade) & (speed > DRIVING_M_S)
    rise, grade = climb[use] / speed[use], grade[use]
    if len(rise) >= LEAST_SLOW and rise.std() >= 0.005 and grade.std():
        factor = float(grade @ rise / (rise @ rise))
        yield Comparison("height over distance gives", factor, float(np.corrcoef(rise, grade)[0, 1]))


def _engine_speed(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    moving = [
        r.channels["engine_speed"][r.channels["speed"] > MOVING_M_S] * 30.0 / np.pi
        for r in recordings
        if "engine_speed" in r.channels
    ]
    fastest = max((float(np.nanmax(rpm)) for rpm in moving if not np.isnan(rpm).all()), default=np.inf)
    if fastest < LEAST_ENGINE_RPM:
        yield Doubt(
            "engine_speed",
            f"engine_speed: at most {fastest:.0f} rpm while moving, and a diesel engine idles at 500 to 800 "
            "rpm; is it in rad/s?",
        )


def steady_ratios(recordings: Sequence[Recording]) -> Array:
    """Engine speed over speed, rad/m, at every sample of steady driving; empty without engine speed."""
    return np.concatenate([np.zeros(0), *(_steady(r) for r in recordings if "engine_speed" in r.channels)])


def _steady(r: Recording) -> Array:
    speed, engine = r.channels["speed"], r.channels["engine_speed"]
    turning = (speed > TURNING_M_S) & (engine > TURNING_RAD_S)
    ratio = np.where(turning, engine, np.nan) / np.where(turning, speed, 1.0)
    length = max(2, round(STEADY_S / r.dt))
    if len(ratio) < length:
        return np.zeros(0)
    windows = np.lib.stride_tricks.sliding_window_view(ratio, length)
    low, high = windows.min(axis=1), windows.max(axis=1)  # NaN where one is
    middle: Array = windows[:, length // 2]
    return middle[(high - low) < STEADY * low]


def _ratios(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts from gear ratios: engine speed over speed has one value per gear, within the range of
    vehicles."""
    seen = steady_ratios(recordings)
    if not len(seen) or len(seen) * recordings[0].dt < LEAST_STEADY_S:
        return
    usual = float(np.median(seen))
    if not RATIOS[0] < usual < RATIOS[1]:
        side = "few" if usual < RATIOS[0] else "many"
        yield Doubt(
            "engine_speed",
            f"engine_speed: {usual / (2 * np.pi):.2g} turns a metre are too {side} for any gear: give speed "
            "and engine_speed their units",
        )
        return
    counts = np.bincount(np.floor((np.log(seen) - np.log(seen.min())) / ALIKE).astype(int))
    needed = 1 + int(np.searchsorted(np.cumsum(np.sort(counts)[::-1]), OF_TIME * len(seen)))
    if needed > MOST_GEARS:
        yield Doubt(
            "engine_speed",
            f"engine_speed over speed has no steady ratios, as gears have ({needed}, {100 * ALIKE:.0f} % "
            f"wide, for {OF_TIME:.0%} of steady driving): another clock (late_s), another vehicle?",
        )


def _commands(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts for ratios read as percent, both pedals at once, swapped pedals, and too much brake pressure."""
    has = [r for r in recordings if {"engine_command", "brake_command"} <= set(r.channels)]
    engine, brake = (
        np.concatenate([np.zeros(0), *(r.channels[name] for r in has)])
        for name in ("engine_command", "brake_command")
    )
    gained = np.concatenate([np.zeros(0), *(_rising(r) for r in has)])
    known = np.isfinite(engine) & np.isfinite(brake) & np.isfinite(gained)
    engine, brake, gained = engine[known], brake[known], gained[known]
    for name, values in (("engine_command", engine), ("brake_command", brake)):
        if len(values) and PRESSED <= values.max() <= 1.0 and has[0].interface.unit(name) == "percent":
            yield Doubt(name, f"{name} reaches {values.max():.2g} percent: is it a ratio? Give it its unit")
    if not len(engine) or engine.max() <= 0.0 or brake.max() <= 0.0:
        return
    if (
        has[0].interface.brake_unit == "bar"
        and AIR_BRAKE_BAR < brake.max() <= 105.0
        and not has[0].interface.vehicle
    ):
        yield Doubt(
            "brake_command",
            f"brake_command reaches {brake.max():.0f} bar, and air brakes of trucks have at most 13: is it "
            "in percent? Give it its unit, or say what drove ('vehicle: car')",
        )
    gas, braked = engine > PRESSED * engine.max(), brake > PRESSED * brake.max()
    both = (engine > 0.5 * engine.max()) & (brake > 0.5 * brake.max())
    if both.sum() * has[0].dt > 5.0 and both.sum() > BOTH_SHARE * braked.sum():
        yield Doubt(
            "brake_command",
            "engine_command and brake_command are both above half of their largest in "
            f"{both.sum() / braked.sum():.0%} of the braking: check which columns they are",
        )
    gas, braked = gas & ~braked, braked & ~gas
    seconds = min(gas.sum(), braked.sum()) * has[0].dt
    if seconds > 5.0 and gained[gas].mean() < -0.1 and gained[braked].mean() > 0.1:
        yield Doubt(
            "brake_command",
            f"the truck gains {gained[braked].mean():.2f} m/s² while brake_command is on, and "
            f"{gained[gas].mean():.2f} m/s² while engine_command is: are the two swapped?",
        )


def _rising(r: Recording) -> Array:
    """The derivative of speed, m/s^2, so that a faulty accelerometer cannot make pedals appear swapped."""
    speed = r.channels["speed"]
    return np.gradient(speed, r.dt) if len(speed) > 1 else np.full(len(speed), np.nan)


def _fastest(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    speed = np.concatenate([np.zeros(0), *(r.channels["speed"] for r in recordings)])
    speed = speed[np.isfinite(speed)]
    kind = recordings[0].interface.vehicle if recordings else None
    if kind in (None, "truck", "bus") and len(speed) and np.quantile(speed, 0.99) > FASTEST_TRUCK:
        most = float(speed.max())
        yield Doubt(
            "speed",
            f"speed reaches {most:.0f} m/s ({3.6 * most:.0f} km/h), and trucks drive at most "
            f"{3.6 * FASTEST_TRUCK:.0f} km/h: is its unit right? Give it its unit, or "
            "say what drove ('vehicle: car')",
        )
