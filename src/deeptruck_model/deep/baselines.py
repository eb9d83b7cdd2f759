"""What an open-loop error is read against: a constant speed, and the best physics truck of the pool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_model import trucks
from deeptruck_model.deep.evaluation import Trials, statistics
from deeptruck_model.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model.simulators import free_run
from deeptruck_model.trucks import PhysicsTruck

CONSTANT = "constant speed"
ENGINE, BRAKE = ("N m", "percent"), ("percent", "m/s^2")  # what a physics truck takes


def baselines(runs: Trials, interface: TruckInterface, simulated: object = None) -> list[dict[str, Any]]:
    """Statistics of both over the same runs, each with its 'name'.

    The physics truck is the one with the smallest speed error, as published and with the mass of the
    recordings where it is stated; none where the signals are not those of a physics truck. `simulated` is the
    simulator itself, which is no baseline of its own.
    """
    found = [_named(CONSTANT, statistics(replace(runs, modelled=_held(runs))))]
    drawn = [_physics(runs, interface, name) for name in trucks.pool() if not _same(simulated, name)]
    known = [x for x in drawn if x is not None]
    return [*found, *sorted(known, key=lambda x: float(x["speed"]["rmse"]))[:1]]


def _named(name: str, figures: Mapping[str, Any]) -> dict[str, Any]:
    return {"name": name, **{channel: x for channel, x in figures.items() if isinstance(x, dict)}}


def _held(runs: Trials) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The responses of the start kept; no acceleration."""
    held = np.repeat(runs.modelled[:, :1], runs.modelled.shape[1], axis=1)
    held[:, :, ACCELERATION] = 0.0
    return held


def _same(simulated: object, name: str) -> bool:
    return isinstance(simulated, PhysicsTruck) and simulated.specification.name == name


def _physics(runs: Trials, interface: TruckInterface, name: str) -> dict[str, Any] | None:
    if interface.engine_unit not in ENGINE or interface.brake_unit not in BRAKE:
        return None
    specification = replace(trucks.load(name).specification, interface=interface)
    if interface.mass_kg is not None:
        specification = specification.with_values({"mass": interface.mass_kg})
    truck = PhysicsTruck(specification, dt=runs.dt)
    start = runs.modelled[:, 0].copy()
    start[:, SPEED] = np.maximum(start[:, SPEED], 0.0)
    return _named(
        f"physics truck {name}", statistics(replace(runs, modelled=free_run(truck, runs.u, runs.w, start).y))
    )
