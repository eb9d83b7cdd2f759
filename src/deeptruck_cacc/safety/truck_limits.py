"""Measures on a simulator the truck capabilities that a Promise assumes, by emergency stops from many
states.
"""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.proof import hardest_braking_when_lost
from deeptruck_cacc.safety.shield import Promise
from deeptruck_model.errors import InputError
from deeptruck_model.signals import SPEED, TruckInterface
from deeptruck_model.simulators import Simulator, load

Array = NDArray[np.float64]
PREPARE_S, STOP_S = 4.0, 14.0


def measure(
    simulator: Simulator, *, worst_grade: float = -0.03, reserve: float = 0.05, base: Promise | None = None
) -> Promise:
    """`base` with braking, response_s and accelerations measured on this truck, each made worse by the share
    `reserve`, and with the brake command that decelerates it by `mild_braking`.

    Full braking from 4..30 m/s on the steepest descent covered, after 0..4 s of idle, half and full engine,
    so that boost, gear and shifts differ. Raises InputError for a truck that has no brake or does not brake.
    """
    if simulator.interface.brake_unit is None:
        raise InputError("the truck has no brake command: nothing can be promised for it")
    speed, begin = _emergency_stops(simulator, worst_grade)
    dt, start = simulator.dt, np.take_along_axis(speed, begin[None], axis=0)[0]
    rate = np.diff(speed, axis=0) / dt
    bounds = replace(
        base or Promise(),
        dt=dt,
        max_acceleration=float(rate.max()) * (1 + reserve),
        power_per_mass=float((rate * speed[1:]).max()) * (1 + reserve),
    )
    bounds = replace(bounds, mild_brake=_mild_brake(simulator, bounds.mild_braking))
    most = bounds.acceleration_at(start)
    time = (np.arange(len(speed))[:, None] - begin) * dt
    moving = (speed > 0.2) & (time > 0)
    best: Promise | None = None
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


def bridged_time_gap(promise: Promise) -> float:
    """Smallest time gap (s, by 0.1) at which a steady leader may be lost for `bridged_s` at 5 to 29 m/s
    without braking beyond `mild_braking`. Raises InputError if 10 s do not suffice."""
    speed: Array = np.arange(5.0, 30.0, dtype=float)
    for tenths in range(5, 101):
        hardest = hardest_braking_when_lost(promise, speed, tenths / 10, promise.bridged_s)
        if (hardest <= promise.mild_braking + 1e-9).all():
            return tenths / 10
    raise InputError("behind a leader that vanishes the truck brakes hard at every time gap")


def _mild_brake(simulator: Simulator, deceleration: float) -> float:
    """Share of the brake command that decelerates the truck by at most `deceleration` (m/s^2) on a level
    road, with a low engine command, at 8..28 m/s; the mean of 2 s, starting after one second."""
    scale, dt = ActionScale.of(simulator), simulator.dt
    speeds, shares = np.arange(8.0, 29.0, 4.0), np.linspace(0.0, 0.5, 26)
    v, share = (x.ravel() for x in np.meshgrid(speeds, shares))
    y0 = np.zeros((len(v), len(simulator.interface.y)))
    y0[:, SPEED] = v
    state, w = simulator.reset(y0), np.zeros((len(v), len(simulator.interface.w)))
    u = np.column_stack([np.full(len(v), scale.engine_low), share * scale.brake_high])
    trace = []
    for _ in range(round(3.0 / dt)):
        state, y = simulator.step(state, u, w)
        trace.append(y[:, SPEED])
    slowing = (trace[round(1.0 / dt) - 1] - trace[-1]) / 2.0
    hardest = np.maximum.accumulate(slowing.reshape(len(shares), len(speeds)).max(axis=1))
    return float(np.interp(deceleration, hardest, shares))


def _gap(promise: Promise) -> float:
    """Needed gap at 20 m/s behind a leader at 20 m/s, with cold brakes."""
    v = np.array([20.0])
    return float(promise.needed_gap(v, v, np.zeros(1), promise.dt)[0])


def _emergency_stops(simulator: Simulator, grade: float) -> tuple[Array, NDArray[np.int64]]:
    """Speeds (T, batch) and the sample at which the full brake was commanded, (batch,)."""
    if hasattr(simulator, "with_grade_input"):  # the road is there, whether the truck senses it or not
        simulator = simulator.with_grade_input()
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


def known(interface: TruckInterface) -> Promise | None:
    """The promise stored for a truck of this name in promises.json, or None."""
    table = json.loads(TABLE.read_text())
    return Promise(**table[interface.name]) if interface.name in table else None


def main() -> None:
    """Measure the pool again and rewrite promises.json: python -m deeptruck_cacc.safety.truck_limits."""
    names = ("trucksim", "freightliner", "volvo")
    found = {name: measure(load(f"truck:{name}")) for name in names}
    table = {
        name: asdict(replace(promise, bridged_time_gap=bridged_time_gap(promise)))
        for name, promise in found.items()
    }
    rounded = {name: {k: round(v, 4) for k, v in row.items()} for name, row in table.items()}
    TABLE.write_text(json.dumps(rounded, indent=1) + "\n")


if __name__ == "__main__":
    main()
