"""Learns from recordings what no data sheet has: shift speeds, the pedal curve, brakes, engine friction.

Shift speeds are straight lines of engine speed over demand, fitted to the recorded gear changes (Theil and
Sen). The pedal curve is the median share of the available torque at each constant pedal position, from the
force that moves the truck of the data sheet. Single parameters are those with the least error of free runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import savgol_filter
from scipy.stats import theilslopes

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import SPEED
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.trucks import PARAMETERS, PhysicsTruck, Specification
from deeptruck_model.trucks.specification import RECORDED_GEAR

LEAST_CHANGES = 20  # in each direction
HELD_S = 1.0  # in a gear, before a change counts
LEAST_SPEED = 2.0  # m/s: slower, the clutch slips
DEMAND_SPREAD = 0.15  # between the 10th and 90th percentile, for a slope over demand
BIN, LEAST_BIN_S, LEAST_BINS = 10.0, 5.0, 4  # % of pedal, s in a bin, bins
STEADY, STEADY_S = 8.0, 1.0  # % that a held pedal moves at most, in so many s before
SMOOTH_S = 1.0  # of the acceleration
RUN_S, EVENT_S = 40.0, 4.0  # of free runs, and of those about an event
GAIN = 0.2  # of their error, that a single parameter must save; less is saved by wrong values too
TRIALS = 12  # of values of a single parameter
ROUNDS = 3  # through the single parameters at most: what one leaves hides what another would save


BRAKING, SHIFT = "an application of the brakes", "a change of gear"


@dataclass(frozen=True)
class Single:
    """A parameter that no data sheet has: its description and the values tried.

    Parameters `in_proportion` are scaled alike. With an `event` it is judged by free runs about such events.
    """

    name: str
    says: str
    low: float
    high: float
    in_proportion: tuple[str, ...] = ()
    event: str = ""

    def values(self, given: Specification, value: float) -> dict[str, float]:
        """Its value and those of the parameters in proportion to it, by name."""
        scale = value / given.values[self.name] if self.in_proportion else 1.0
        return {self.name: value, **{name: scale * given.values[name] for name in self.in_proportion}}


SINGLES = (
    Single("brake_pushout", "the share of the brake command at which the brakes begin", 0.0, 0.3),
    Single("engine_friction", "engine friction over that of the reference truck", 0.0, 3.0),
    Single("engine_inertia", "kg m^2 that turn with the engine", 0.3, 10.0),
    Single(
        "shift_time",
        "s of a change of gear, and torque ramps in proportion",
        0.0,
        3.0,
        ("shift_ramp",),
        SHIFT,
    ),
    Single(
        "boost_lag",
        "s, time constant of the boost; that of fuelling in proportion",
        0.0,
        3.0,
        ("fuelling_lag",),
    ),
    Single(
        "brake_lag",
        "s, time constant of the front brakes; the others in proportion",
        0.0,
        0.6,
        ("brake_lag_rear", "brake_release_lag"),
        BRAKING,
    ),
)
OF_BRAKES_ALONE = Single(
    "brake_controller_gain", "a request is what the brakes add", 0.0, 0.0, ("brake_gate",)
)  # the smallest requests too


@dataclass(frozen=True)
class Learned:
    """The truck with the learned properties, and one line for each of them."""

    truck: Specification
    says: tuple[str, ...]


def learned(truck: Specification, recordings: Sequence[Recording]) -> Learned:
    """The truck with the shift speeds, pedal curve and single parameters of the recordings, each only if it
    reduces the speed error of free runs along these."""
    one_gear = len(truck.ratios) == 1
    known = (
        replace(r, channels={**r.channels, "gear": np.ones(len(r))}) if one_gear else r for r in recordings
    )
    usable = [r for r in known if {"gear", "engine_speed", "engine_command"} <= r.channels.keys()]
    before = _error(PhysicsTruck(truck), usable)
    if before is None:
        return Learned(truck, ())
    says: list[str] = []
    truck, said = _taken("pedal", _with_pedal, truck, usable, before, says)
    truck = _with_singles(truck, usable, says)
    said = _error(PhysicsTruck(truck), usable) or said
    truck, said = _taken("shift speeds", _with_shift_speeds, truck, usable, said, says)
    if one_gear:
        return Learned(truck, tuple(says))
    following = _error(PhysicsTruck(truck).with_recorded_gear(), usable)
    late_s = truck.values["shift_time"]
    earlier = _error(PhysicsTruck(truck).with_recorded_gear(), [_earlier(r, late_s) for r in usable])
    if following is not None:
        line = f"recorded gear, by {RECORDED_GEAR}: they are then off by {following:.2f} m/s"
        if earlier is not None and earlier < following:
            line += (
                f"; by {earlier:.2f} with changes {late_s:g} s earlier, as the gear is stamped where a "
                f"change ends: 'late_s: {late_s:g}' for gear in COLUMNS.yaml"
            )
        says.append(line)
    return Learned(truck, tuple(says))


def _taken(
    what: str,
    find: Callable[[Specification, Sequence[Recording]], Specification | None],
    truck: Specification,
    recordings: Sequence[Recording],
    before: float,
    says: list[str],
) -> tuple[Specification, float]:
    """The truck with the found property, if that reduces the error of its free runs, and their error; adds a
    line."""
    found = find(truck, recordings)
    after = None if found is None else _error(PhysicsTruck(found), recordings)
    if found is None or after is None:
        return truck, before
    better = after < before
    says.append(
        f"{what}: {'learned' if better else 'not taken over'}; free runs of {RUN_S:.0f} s are off by "
        f"{after:.2f} m/s (rms) with what the recordings show, by {before:.2f} without"
    )
    return (found, after) if better else (truck, before)


def _with_singles(given: Specification, recordings: Sequence[Recording], says: list[str]) -> Specification:
    """The truck with those single parameters that reduce the error of free runs in the recorded gear by at
    least GAIN; adds a line for each."""
    by_deceleration = given.interface.brake_unit == "m/s^2"
    singles = (OF_BRAKES_ALONE, *SINGLES[1:]) if by_deceleration else SINGLES

    def off(truck: Specification, one: Single, value: float) -> float:
        run = PhysicsTruck(truck.with_values(one.values(given, float(value)))).with_recorded_gear()
        return _error(run, recordings, event=one.event) or np.inf

    truck = given
    for _ in range(ROUNDS):
        before = truck
        for one in singles:
            found = _of_least_error(truck.values[one.name], one, partial(off, truck, one))
            truck = truck.with_values(one.values(given, found))
        if truck == before:
            break
    for one in singles:
        best, sheet = truck.values[one.name], given.values[one.name]
        if best != sheet:
            value = f"{best:.3g}, not {sheet:.3g} ({one.says})" if one.high > one.low else one.says
            runs = f"{EVENT_S:.0f} s about {one.event}" if one.event else f"{RUN_S:.0f} s"
            says.append(
                f"{one.name}: {value}; free runs of {runs} in the recorded gear are off by "
                f"{off(truck, one, best):.2f} m/s (rms) with it, by {off(truck, one, sheet):.2f} without"
            )
    return truck


def _of_least_error(given: float, one: Single, off: Callable[[float], float]) -> float:
    """The value of least error `off`, if that is smaller by at least GAIN than that of the given value."""
    before, best = off(given), one.low
    if not np.isfinite(before):  # no such event
        return given
    if one.high > one.low:
        found = minimize_scalar(
            off,
            bounds=(one.low, one.high),
            method="bounded",
            options={"maxiter": TRIALS, "xatol": 0.01 * (one.high - one.low)},
        )
        best = min((one.low, float(found.x)), key=off)
    return round(best, 4) if off(best) < (1.0 - GAIN) * before else given


def _earlier(r: Recording, late_s: float) -> Recording:
    """The recording with its gear shifted `late_s` to earlier times."""
    gear, k = r.channels["gear"], min(round(late_s / r.dt), len(r) - 1)
    return replace(r, channels={**r.channels, "gear": np.append(gear[k:], np.full(k, gear[-1]))})


def _error(truck: PhysicsTruck, recordings: Sequence[Recording], *, event: str = "") -> float | None:
    """Root mean square speed error, m/s, of consecutive free runs of RUN_S, or of runs of EVENT_S about each
    event of a kind; None without one."""
    total, count = 0.0, 0
    for r in recordings:
        n, names = round((EVENT_S if event else RUN_S) / r.dt), (*truck.interface.u, *truck.interface.w)
        inputs = np.column_stack([r.channels.get(name, np.zeros(len(r))) for name in names])
        y = np.column_stack([r.channels.get(name, np.zeros(len(r))) for name in truck.interface.y])
        speed = r.channels["speed"]
        needed = np.column_stack([inputs[:, : len(truck.interface.u)], speed])
        begins = _about(r, event, n) if event else range(0, len(r) - n, n)
        starts = [k for k in begins if np.isfinite(needed[k : k + n]).all()]
        if not starts:
            continue
        x = np.nan_to_num(np.stack([inputs[k : k + n] for k in starts]))
        u, w = np.split(x, [len(truck.interface.u)], axis=2)
        run = PhysicsTruck(truck.specification, dt=r.dt).rollout(u, w, np.nan_to_num(y[starts]), inside=False)
        off = run.y[:, :, SPEED] - np.stack([speed[k : k + n] for k in starts])
        total, count = total + float(np.sum(off**2)), count + off.size
    return float(np.sqrt(total / count)) if count else None


def _about(r: Recording, event: str, n: int) -> list[int]:
    """The first of n samples about each event: an application of the brakes, or HELD_S before a change of
    gear. The truck moves at all of them."""
    speed, brake = r.channels["speed"], r.channels["brake_command"]
    applied = np.flatnonzero((brake[1:] > 0.0) & (brake[:-1] <= 0.0))
    changed = [k - round(HELD_S / r.dt) for k, _, _ in _changes(r)]
    begins = applied if event == BRAKING else changed
    return [int(k) for k in begins if 0 <= k < len(r) - n and speed[k : k + n].min() > LEAST_SPEED]


def _gear(r: Recording) -> Array:
    """The last engaged gear at each sample; NaN before the first."""
    gear = np.round(r.channels["gear"])
    at = np.where(np.isfinite(gear) & (gear >= 1.0), np.arange(len(gear)), -1)
    last = np.maximum.accumulate(at)
    return np.where(last >= 0, gear[np.maximum(last, 0)], np.nan)


def _changes(r: Recording) -> Iterator[tuple[int, float, float]]:
    """The sample before each gear change, and the gears before and after, both held for HELD_S."""
    gear, held = _gear(r), max(1, round(HELD_S / r.dt))
    at = np.flatnonzero(np.diff(gear) != 0)
    if not at.size:
        return
    for k, before, after in zip(at, (0, *at[:-1]), (*at[1:], len(gear) - 1), strict=True):
        moving = r.channels["speed"][k] > LEAST_SPEED
        if moving and k - before >= held and after - k >= held and np.isfinite(gear[k]):
            yield int(k), float(gear[k]), float(gear[k + 1])


def _turning(truck: Specification, r: Recording) -> Array:
    """Speed of the gearbox input in the recorded gear, rad/s."""
    gear = np.clip(np.nan_to_num(_gear(r), nan=1.0), 1, len(truck.ratios)).astype(int)
    overall = np.array(truck.ratios) * truck.values["final_drive"] / truck.values["wheel_radius"]
    turning: Array = overall[gear - 1] * r.channels["speed"]
    return turning


def _torques(truck: Specification, speed: Array) -> tuple[Array, Array]:
    """Full-load torque and motoring friction at engine speeds (rad/s), N m."""
    v, w = truck.values, np.maximum(speed, 40.0)
    friction = v["friction_constant"] + v["friction_linear"] * w + v["friction_quadratic"] * w**2
    full = v["full_load_gain"] * np.interp(speed, *truck.full_load)
    return full, v["engine_friction"] * friction + v["accessory_power"] / w


def _demand(truck: Specification, r: Recording) -> Array:
    """The requested share of the available torque, 0 to 1."""
    command = r.channels["engine_command"]
    if truck.pedal is not None:
        return np.asarray(np.interp(command, *truck.pedal))
    full, drag = _torques(truck, _turning(truck, r))
    percent = truck.interface.engine_unit == "percent"
    torque = command * truck.values["reference_torque"] / 100.0 if percent else command
    return np.clip(torque / np.maximum(full + drag, 1.0), 0.0, 1.0)


def _with_shift_speeds(truck: Specification, recordings: Sequence[Recording]) -> Specification | None:
    """The truck with the engine speeds of recorded gear changes, at zero and at full demand; None for too few
    changes."""
    seen: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for r in recordings:
        turning, demand, back = _turning(truck, r), _demand(truck, r), max(1, round(HELD_S / r.dt))
        for k, old, new in _changes(r):
            asked = float(np.nanmax(demand[max(0, k - back) : k + 1], initial=0.0))  # torque is cut before
            seen[new > old].append((asked, float(turning[k])))
    out = {}
    for up, name in ((True, "upshift"), (False, "downshift")):
        pairs = np.array([pair for pair in seen[up] if np.isfinite(pair).all()])
        if len(pairs) < LEAST_CHANGES:
            return None
        demand, speed = pairs.T
        low, high = np.quantile(demand, [0.1, 0.9])
        if high - low > DEMAND_SPREAD:
            slope, base, *_ = theilslopes(speed, demand)
        else:
            slope, base = 0.0, float(np.median(speed))
        for end, x in (("low", 0.0), ("high", 1.0)):
            limits = PARAMETERS[f"{name}_{end}"]
            out[f"{name}_{end}"] = round(float(np.clip(base + slope * x, limits.low, limits.high)), 2)
    return truck.with_values(out)


def _with_pedal(truck: Specification, recordings: Sequence[Recording]) -> Specification | None:
    """The truck with a pedal curve; None if the command is not a percentage, or if the data do not
    suffice."""
    if truck.interface.engine_unit != "percent" or truck.pedal is not None:
        return None
    steady = [_steady(truck, r) for r in recordings]
    pedal, torque, most = (np.concatenate(x) for x in zip(*steady, strict=True))
    bins = np.round(pedal / BIN).astype(int)
    enough = [b for b in range(1, 11) if np.sum(bins == b) * recordings[0].dt >= LEAST_BIN_S]
    if len(enough) < LEAST_BINS:
        return None
    share = np.clip(torque / most, 0.0, 1.0)
    knots = [0.0, *(BIN * b for b in enough)]
    shares = [0.0, *np.maximum.accumulate([float(np.median(share[bins == b])) for b in enough])]
    if knots[-1] < 100.0:
        slope = shares[-1] / knots[-1]
        knots, shares = [*knots, 100.0], [*shares, min(max(shares[-1], slope * 100.0), 1.0)]
    return replace(truck, pedal=(tuple(knots), tuple(round(float(s), 4) for s in shares)))


def _steady(truck: Specification, r: Recording) -> tuple[Array, Array, Array]:
    """Pedal (%), combustion torque and its maximum (N m) where pedal and gear are constant and no
    brake acts."""
    v, n = truck.values, len(r)
    speed, pedal, gear = r.channels["speed"], r.channels["engine_command"], _gear(r)
    brake = np.nan_to_num(r.channels.get("brake_command", np.zeros(n)))
    grade = np.nan_to_num(r.channels.get("grade", np.zeros(n)))
    turning = _turning(truck, r)
    ratio = turning / np.maximum(speed, 0.1)
    window = max(5, 2 * round(SMOOTH_S / r.dt / 2) + 1)
    known = np.isfinite(speed) & np.isfinite(pedal) & np.isfinite(gear) & (speed > LEAST_SPEED)
    if n <= window:
        known[:] = False
        acceleration = np.zeros(n)
    else:
        acceleration = savgol_filter(np.nan_to_num(speed), window, 2, deriv=1, delta=r.dt)
    held = _held(pedal, STEADY, round(STEADY_S / r.dt)) & _held(gear, 0.5, round(STEADY_S / r.dt))
    use = known & held & (brake <= 0.0) & (pedal > BIN / 2)
    mass = v["mass"] + v["wheel_inertia"] / v["wheel_radius"] ** 2 + v["engine_inertia"] * ratio**2
    weight = v["mass"] * v["gravity"]
    force = mass * acceleration + 0.5 * v["air_density"] * v["drag_area"] * speed**2
    force = force + weight * (grade + v["rolling_resistance"] + v["rolling_resistance_speed"] * speed)
    full, drag = _torques(truck, turning)
    flywheel = force / np.maximum(ratio, 0.1) / v["driveline_efficiency"]
    torque = np.where(
        np.isfinite(r.channels.get("engine_torque", np.full(n, np.nan))),
        r.channels.get("engine_torque", np.full(n, np.nan)),
        flywheel,
    )
    return pedal[use], (torque + drag)[use], np.maximum(full + drag, 1.0)[use]


def _held(values: Array, most: float, steps: int) -> Mask:
    """Whether values changed by at most `most` in the `steps` before each sample."""
    out = np.zeros(len(values), dtype=bool)
    if len(values) > steps:
        before = np.lib.stride_tricks.sliding_window_view(values, steps + 1)
        out[steps:] = np.ptp(before, axis=1) <= most
    return out
