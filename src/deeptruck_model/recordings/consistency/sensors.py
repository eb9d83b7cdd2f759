"""Channels that contradict one another, or what a truck is.

`doubts` compares the channels of recordings: a `Doubt` states the probable cause and the key that settles it,
and is `wrong` if training on the channel would give a different truck.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import groupby

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.consistency import accelerometer, agreement
from deeptruck_model.recordings.consistency.impossible import (
    LEAST_JUMPS,
    MOST_JUMPS,
    changed_unit,
    impossible_steps,
)
from deeptruck_model.recordings.consistency.windows import MOVING_M_S, Doubt, joined
from deeptruck_model.recordings.recording import Recording

STEADY_S, STEADY = 1.0, 0.01  # in which engine speed over speed changes by less: gear engaged, clutch closed
TURNING_M_S, TURNING_RAD_S = 3.0, 80.0  # above creeping and idling
LEAST_STEADY_S = 60.0  # of steady driving, to judge by
ALIKE, MOST_GEARS, OF_TIME = (
    0.04,
    20,
    0.7,
)  # relative width of a ratio; gears that hold this share of the time
RATIOS = (2.0, 110.0)  # rad/m, engine speed over speed: below a car's top gear, above a truck's first
LEAST_ENGINE_RPM = 400.0  # diesel engines idle at 500 to 800 rpm, those of trucks/pool at 600
FASTEST_TRUCK = 36.0  # m/s, 130 km/h: no truck is driven faster
AIR_BRAKE_BAR = 15.0  # compressors of trucks are set to 8 to 13 bar
STANDING = {"percent": 25.0, "N m": 500.0}  # an engine command that moves any truck
PRESSED, BOTH_SHARE = 0.2, 0.1  # of a command's largest value; of the time in which the brake is pressed


def refuse(recordings: Sequence[Recording]) -> None:
    """Raise InputError if a channel contradicts the others so much that a wrong truck would be learned."""
    for doubt in doubts(recordings):
        if doubt.wrong:
            raise InputError(f"'{recordings[0].name.partition('#')[0]}': {doubt.says}")


def doubts(recordings: Sequence[Recording]) -> list[Doubt]:
    """The doubts about one source's pieces; each channel is compared with the others."""
    checks = (
        _steps,
        accelerometer.doubts,
        agreement.speed_doubts,
        agreement.grade_doubts,
        _engine_speed,
        _ratios,
        _commands,
        _fastest,
    )
    return [doubt for check in checks for doubt in check(recordings)]


def of_inputs(recordings: Sequence[Recording], channels: Collection[str]) -> list[str]:
    """One doubt about each of `channels`, the inputs and responses of a simulator, with its remedy. It names
    the sources if fewer than half of them show it; otherwise it is that of all sources together."""
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


def _steps(recordings: Sequence[Recording]) -> Iterator[Doubt]:
    """Doubts about a speed whose numbers are of several units, or of no truck."""
    many = jumps = 0
    for r in recordings:
        speed = r.channels["speed"]
        if says := changed_unit(r.time, speed):
            yield Doubt("speed", f"speed {says}: its unit changes within; give it in one", wrong=True)
            return
        counted = impossible_steps("speed", r.time, speed)
        many, jumps = many + counted[0], jumps + counted[1]
    if jumps >= LEAST_JUMPS and jumps > MOST_JUMPS * many:
        yield Doubt(
            "speed",
            f"speed changes faster than any truck in {jumps} of {many} steps: is it one vehicle's, in one "
            "unit? Export it anew, or take another",
            wrong=True,
        )


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
    engine, brake = joined(has, "engine_command"), joined(has, "brake_command")
    speed, pulled = joined(recordings, "speed"), joined(recordings, "engine_command")
    if len(speed) and len(pulled) and not np.nanmax(speed, initial=0.0) > 0.0:
        most = float(np.nanmax(pulled, initial=0.0))
        unit = recordings[0].interface.engine_unit
        if most > STANDING.get(unit, np.inf) and (pulled > 0.5 * most).sum() * recordings[0].dt > 5.0:
            yield Doubt(
                "speed",
                f"speed is 0 all the time while engine_command reaches {most:.0f} {unit}: it was not "
                "recorded; take another source",
                wrong=True,
            )
            return
    gained = np.concatenate([np.zeros(0), *(_rising(r) for r in has)])
    known = np.isfinite(engine) & np.isfinite(brake) & np.isfinite(gained)
    engine, brake, gained = engine[known], brake[known], gained[known]
    for name, values in (("engine_command", engine), ("brake_command", brake)):
        if len(values) and PRESSED <= values.max() <= 1.0 and has[0].interface.unit(name) == "percent":
            yield Doubt(name, f"{name} reaches {values.max():.2g} percent: is it a ratio? Give it its unit")
    if not len(engine) or engine.max() <= 0.0 or brake.max() <= 0.0:
        return
    if has[0].interface.brake_unit == "bar" and brake.max() > AIR_BRAKE_BAR and not has[0].interface.vehicle:
        yield Doubt(
            "brake_command",
            f"brake_command reaches {brake.max():.0f} bar, and air brakes of trucks have at most 13: is it "
            f"in {'percent' if brake.max() <= 105.0 else 'kPa'}? Give it its unit, or say what drove "
            "('vehicle: car')",
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
    speed = joined(recordings, "speed")
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
