"""The drives of the reference trucks and of a fleet of synthetic trucks, and training on them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deeptruck_model import trucks
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.gated_brake import COMMAND, SWITCH, substituted
from deeptruck_model.signals import TruckInterface
from deeptruck_model.trucks import PhysicsTruck
from deeptruck_model.trucks.driving_cycles import FREEWAY, YARD, CycleSettings, drive

# Seeds of the drives: settings were chosen on the validation drives, the test drives are only ever read.
TRAIN_SEED, VALIDATION_SEED, TEST_SEED, LOOK_ALIKE_SEED, FLEET_SEED = 1, 2, 3, 5, 7
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


class Field(NamedTuple):
    """The recordings of a field truck, as the paper describes them."""

    minutes: float
    cycle: CycleSettings
    gated_brake: bool = False  # its brake is a switch, and the deceleration stands for a command


FIELD = {"freightliner": Field(16, YARD), "volvo": Field(24, FREEWAY, gated_brake=True)}


def chosen(seeds: int, updates: int, mode: Any = "default") -> Arguments:
    """The settings of an experiment."""
    return Arguments(members=seeds, updates=updates, mode=mode)


def drive_of(name: str, minutes: float, seed: int, cycle: CycleSettings | None = None) -> Recording:
    """A drive of a reference truck, `minutes` long."""
    return drive(trucks.load(name), seconds=60 * minutes, seed=seed, settings=cycle)


def trained(
    drives: list[Recording],
    arguments: Arguments,
    observe: Callable[[int, TruckNetwork], None] | None = None,
) -> DeepTruck:
    """A truck trained on `drives`; no files are kept."""
    with tempfile.TemporaryDirectory() as folder:
        return train(drives, Path(folder) / "truck", arguments, observe=observe)


def singles(truck: DeepTruck) -> list[DeepTruck]:
    """The members of an ensemble, each as a truck of its own; their intervals are calibrated for the
    ensemble's mean."""
    details = {name: value for name, value in truck.details.items() if name != "calibration"}
    return [
        DeepTruck(
            truck.network.member(m),
            truck.interface,
            truck.coverage,
            details,
            truck.reference,
            truck.driven,
        )
        for m in range(truck.network.shape.members)
    ]


def field_drives(name: str) -> tuple[Recording, Recording]:
    """The first 85 percent of a field truck's driving, and the remainder, with the brake command as in the
    paper."""
    whole = drive_of(name, FIELD[name].minutes, TRAIN_SEED, FIELD[name].cycle)
    if FIELD[name].gated_brake:
        on = (whole.channels[COMMAND] > trucks.load(name).parameters()["brake_gate"]).astype(float)
        whole = substituted(replace(whole, channels={**whole.channels, SWITCH: on, COMMAND: on}))
    edge = round(0.85 * len(whole))
    return whole.piece(0, edge), whole.piece(edge, len(whole))


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
