"""Measures on a simulator the truck capabilities that the assumptions state, by emergency stops from many
states.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.proof import hardest_braking_when_lost
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model.simulators import Simulator, load

PREPARE_S, STOP_S = 4.0, 14.0
STEEPEST = -0.03  # rise over run: most of a motorway; runs measure for steeper descents
NO_BRAKING = 0.02  # m/s^2
MILD = 0.1  # share of the brake command about which following brakes
ROTATING = (
    1.1  # wheels and driveline take part in a stop and heat the brakes too: 3 to 8 % of the pool's trucks
)


def measure(
    simulator: Simulator,
    *,
    worst_grade: float = STEEPEST,
    reserve: float = 0.05,
    base: Assumptions | None = None,
) -> Assumptions:
    """`base` with braking, response_s and accelerations measured on this truck, each made worse by the share
    `reserve`, and with what its brakes give at small commands: `bite`, `brake_gain` and `mild_brake`. Where
    the simulator has parameters of its brakes' heat, these take the place of the stated ones.

    Full braking from 4..30 m/s on the steepest descent covered, after 0..4 s of idle, half and full engine,
    so that boost, gear and shifts differ. Raises InputError for a truck that has no brake or does not brake.
    """
    if simulator.interface.brake_unit is None:
        raise InputError("the truck has no brake command: nothing can be promised for it")
    speed, begin = _emergency_stops(simulator, worst_grade)
    dt, start = simulator.dt, np.take_along_axis(speed, begin[None], axis=0)[0]
    rate = np.diff(speed, axis=0) / dt
    bounds = replace(
        base or Assumptions(),
        dt=dt,
        max_acceleration=float(rate.max()) * (1 + reserve),
        power_per_mass=float((rate * speed[1:]).max()) * (1 + reserve),
    )
    bounds = _with_small_commands(bounds, simulator, worst_grade, reserve)
    bounds = replace(bounds, **_heat_constants(simulator.parameters(), reserve))
    most = bounds.acceleration_at(start)
    time = (np.arange(len(speed))[:, None] - begin) * dt
    moving = (speed > 0.2) & (time > 0)
    best: Assumptions | None = None
    for response in np.arange(dt, 1.55, dt):
        beyond = time - response
        late = moving & (beyond > 0)
        if np.any(moving & (beyond <= 0) & (speed > start + most * time + 1e-9)):
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            braking = np.where(late, (start + most * response - speed) / beyond, np.inf)
        found = replace(bounds, braking=float(braking.min()) * (1 - reserve), response_s=float(response))
        if found.braking > 0.3 and (best is None or _gap(found) < _gap(best)):
            best = found
    if best is None:
        raise InputError(
            "the truck does not brake by 0.3 m/s^2 at its full brake command: nothing can be promised"
        )
    return best


def bridged_time_gap(assumed: Assumptions) -> float:
    """Smallest time gap (s, by 0.1) at which a steady leader may be lost for `bridged_s` at 5 to 29 m/s
    without braking beyond `mild_braking`. Raises InputError if 10 s do not suffice."""
    speed: Array = np.arange(5.0, 30.0, dtype=float)
    for tenths in range(5, 101):
        hardest = hardest_braking_when_lost(assumed, speed, tenths / 10, assumed.bridged_s)
        if (hardest <= assumed.mild_braking + 1e-9).all():
            return tenths / 10
    raise InputError("behind a leader that vanishes the truck brakes hard at every time gap")


def _with_small_commands(
    assumed: Assumptions, simulator: Simulator, grade: float, reserve: float
) -> Assumptions:
    """With what the brake commands of half the range and less do, on the level and on `grade`."""
    shares: Array = np.linspace(0.0, 0.5, 26)
    level, steep = (_slowing(simulator, shares, slope) for slope in (0.0, grade))
    mild = np.interp(assumed.mild_braking, np.maximum.accumulate(level.max(axis=1)), shares)
    added, on_descent = ((table - table[0]).max(axis=1) for table in (level, steep))
    bite, gain = _line_above(shares, added)
    more = max(float((on_descent - added)[shares > 0.1].max()), 0.0)
    return replace(
        assumed,
        mild_brake=float(mild),
        bite=bite,
        brake_gain=gain * ROTATING * (1 + reserve),
        descent_share=more / gain / abs(grade),
        steepest=abs(grade),
    )


def _line_above(shares: Array, added: Array) -> tuple[float, float]:
    """Bite and gain of the line above what the brakes add (m/s^2) at all shares that is lowest at MILD."""
    bites = np.arange(0.0, MILD / 2, 0.002)
    gains = np.array([_gain(shares - bite, added) for bite in bites])
    best = int(np.argmin(gains * (MILD - bites)))
    return float(bites[best]), float(gains[best])


def _gain(beyond: Array, added: Array) -> float:
    """Least gain for which gain * beyond is no less than added, inf if there is none."""
    if (added[beyond <= 0] > NO_BRAKING).any():
        return np.inf
    return float((np.maximum(added - NO_BRAKING, 0.0)[beyond > 0] / beyond[beyond > 0]).max())


def _heat_constants(truck: Mapping[str, float], reserve: float) -> dict[str, Any]:
    """Fade and cooling, from the parameters of a truck that names its brakes' heat; else {}."""
    names = ("brake_heat_capacity", "brake_fade", "fade_temperature", "brake_cooling", "brake_cooling_speed")
    if not {*names, "ambient_temperature", "mass"} <= truck.keys():
        return {}
    capacity, fade, hot, at_rest, by_speed = (truck[name] for name in names)
    per_kelvin = capacity / truck["mass"]
    return {
        "fade_from": (hot - truck["ambient_temperature"]) * per_kelvin * (1 - reserve),
        "fade_per_heat": fade / per_kelvin * (1 + reserve),
        "cooling_at_rest": at_rest / capacity * (1 - reserve),
        "cooling_by_speed": by_speed / capacity * (1 - reserve),
    }


def _slowing(simulator: Simulator, shares: Array, grade: float) -> Array:
    """Deceleration (m/s^2, (shares, speeds)) at shares of the brake command and a low engine command from
    8..28 m/s; the mean of 2 s, starting after one second."""
    simulator = _on_roads(simulator)
    scale, dt = ActionScale.of(simulator), simulator.dt
    speeds = np.arange(8.0, 29.0, 4.0)
    v, share = (x.ravel() for x in np.meshgrid(speeds, shares))
    y0 = np.zeros((len(v), len(simulator.interface.y)))
    y0[:, SPEED] = v
    state, w = simulator.reset(y0), np.full((len(v), len(simulator.interface.w)), grade)
    u = np.column_stack([np.full(len(v), scale.engine_low), share * scale.brake_high])
    trace = []
    for _ in range(round(3.0 / dt)):
        state, y = simulator.step(state, u, w)
        trace.append(y[:, SPEED])
    slowing = (trace[round(1.0 / dt) - 1] - trace[-1]) / 2.0
    return np.asarray(slowing.reshape(len(shares), len(speeds)))


def _on_roads(simulator: Simulator) -> Simulator:
    """The simulator with a grade as input: the road is there, whether the truck senses it or not."""
    return simulator.with_grade_input() if hasattr(simulator, "with_grade_input") else simulator


def _gap(assumed: Assumptions) -> float:
    """Needed gap at 20 m/s behind a leader at 20 m/s, with cold brakes."""
    v = np.array([20.0])
    return float(assumed.needed_gap(v, v, np.zeros(1), assumed.dt)[0])


def _emergency_stops(simulator: Simulator, grade: float) -> tuple[Array, NDArray[np.int64]]:
    """Speeds (T, batch) and the sample at which the full brake was commanded, (batch,)."""
    simulator = _on_roads(simulator)
    scale, dt = ActionScale.of(simulator), simulator.dt
    speeds, engines, delays = np.arange(4.0, 31.0, 2.0), (0.0, 0.5, 1.0), np.arange(0.0, PREPARE_S, 0.3)
    v, e, d = (x.ravel() for x in np.meshgrid(speeds, engines, delays))
    engine, begin = (
        scale.engine_low + e * (scale.engine_high - scale.engine_low),
        np.round(d / dt).astype(int),
    )
    y0 = np.zeros((len(v), len(simulator.interface.y)))
    y0[:, SPEED] = v
    state, w = simulator.reset(y0), np.full((len(v), len(simulator.interface.w)), grade)
    trace = [v]
    for k in range(round((PREPARE_S + STOP_S) / dt)):
        stopping = k >= begin
        u = np.column_stack([np.where(stopping, scale.engine_low, engine), stopping * scale.brake_high])
        state, y = simulator.step(state, u, w)
        trace.append(y[:, SPEED])
    return np.array(trace), begin


TABLE = Path(__file__).with_name("promises.json")


def known(
    interface: TruckInterface, parameters: Mapping[str, float] | None = None, steepest: float = STEEPEST
) -> Assumptions | None:
    """The assumptions stored for a truck of this name in promises.json.

    None where there is none, where the `parameters` of a simulator of that name are another truck's (another
    load, say), or for steeper descents. Without parameters the name counts.
    """
    row = json.loads(TABLE.read_text()).get(interface.name)
    if row is None or steepest < STEEPEST or (parameters and digest(parameters) != row["parameters"]):
        return None
    del row["parameters"]
    return Assumptions(**row)


def digest(parameters: Mapping[str, float]) -> str:
    """A hash of all parameters of a truck, to nine digits."""
    numbers = {name: f"{value:.9g}" for name, value in parameters.items()}
    return hashlib.sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()[:16]


def main() -> None:
    """Measure the pool again and rewrite promises.json: python -m deeptruck_cacc.safety.truck_limits."""
    names = ("trucksim", "freightliner", "volvo")
    trucks = {name: load(f"truck:{name}") for name in names}
    found = {name: measure(truck) for name, truck in trucks.items()}
    table = {
        name: asdict(replace(assumed, bridged_time_gap=bridged_time_gap(assumed)))
        for name, assumed in found.items()
    }
    rounded = {
        name: {k: float(f"{v:.5g}") for k, v in row.items()}
        | {"parameters": digest(trucks[name].parameters())}
        for name, row in table.items()
    }
    TABLE.write_text(json.dumps(rounded, indent=1) + "\n")


if __name__ == "__main__":
    main()
