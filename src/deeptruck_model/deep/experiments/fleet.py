"""A fleet of made-up trucks, to know trucks in general before one of them has driven far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model import trucks
from deeptruck_model.driving_cycles import CycleSettings, drive
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.resample import derive_acceleration
from deeptruck_model.recordings.units import DIESEL_DENSITY
from deeptruck_model.signals import TruckInterface
from deeptruck_model.trucks import PhysicsTruck

MADE_FROM = "volvo"  # whose engine, brakes and shift rules are varied; the truck to be learned is another
FACTORS = {  # log-uniform from one over to times
    "drag_area": 1.3,
    "rolling_resistance": 1.4,
    "full_load_gain": 1.4,
    "engine_friction": 1.4,
    "engine_brake_torque": 1.5,
    "boost_lag": 2.0,
    "brake_gain": 1.4,
    "brake_fade": 2.0,
    "fuel_gain": 1.1,
    "shift_time": 1.5,
    "final_drive": 1.25,
}
SHIFTS = ("upshift_low", "upshift_high", "downshift_low", "downshift_high")
MASS = (8000.0, 38000.0)  # kg
GEARS = (8, 14)


def fleet(
    interface: TruckInterface, count: int, minutes: float, seed: int, cycle: CycleSettings | None = None
) -> list[Recording]:
    """One drive of `minutes` by each of `count` random trucks that all have `interface`."""
    rng = np.random.default_rng(seed)
    made = [random_truck(interface, rng) for _ in range(count)]
    return [
        drive(truck, seconds=60 * minutes, seed=1000 * seed + i, settings=cycle, name=f"fleet-{i}")
        for i, truck in enumerate(made)
    ]


def by_fuel(recording: Recording, dt: float) -> Recording:
    """The drive as a log without commands shows it, a row every `dt`, no brake recorded.

    The fuel flow until the next row, in g/s, stands in for the engine command: NaN in the last.
    """
    every = round(dt / recording.dt)
    rows = slice(every - 1, len(recording) // every * every, every)
    channels = {name: recording.channels[name][rows] for name in ("speed", "grade", "engine_speed")}
    fuel = recording.channels["fuel_rate"][: rows.stop].reshape(-1, every).mean(axis=1)
    channels |= {"fuel_rate": fuel, "engine_command": DIESEL_DENSITY * np.append(fuel[1:], np.nan)}
    channels["acceleration"] = derive_acceleration(channels["speed"], dt)
    interface = TruckInterface(recording.interface.name, "g/s", brake_unit=None)
    return replace(recording, dt=dt, channels=channels, interface=interface)


def random_truck(interface: TruckInterface, rng: np.random.Generator) -> PhysicsTruck:
    """A truck of random load, engine, gearbox, brakes and tyres."""
    known = trucks.load(MADE_FROM).specification
    values = {n: known.values[n] * _factor(rng, most) for n, most in FACTORS.items()}
    values["mass"] = float(rng.uniform(*MASS))
    faster = _factor(rng, 1.1)
    values |= {name: known.values[name] * faster for name in SHIFTS}
    first, last = rng.uniform(10.0, 15.0), rng.uniform(0.72, 1.0)
    ratios = np.geomspace(first, last, int(rng.integers(GEARS[0], GEARS[1] + 1)))
    return PhysicsTruck(
        replace(known.with_values(values), interface=interface, ratios=tuple(ratios.tolist()))
    )


def _factor(rng: np.random.Generator, most: float) -> float:
    return float(np.exp(rng.uniform(-1, 1) * np.log(most)))
