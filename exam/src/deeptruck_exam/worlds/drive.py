"""Simulates the true truck on its roads with its drivers; sensors are applied later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.law import Channels
from deeptruck_exam.worlds.drivers import STANDSTILL_M, Driver
from deeptruck_exam.worlds.roads import Roads
from deeptruck_model.trucks import PhysicsTruck

SEEN = ("gear", "engine_speed", "engine_torque", "elevation", "distance")


@dataclass(frozen=True)
class Drives:
    """True signals: `channels` each (batch, n), in SI and interface units; `u` (batch, n, 2), `w` (batch, n,
    1)."""

    channels: Channels
    u: Array
    w: Array
    y: Array
    dt: float


def simulate(truck: PhysicsTruck, roads: Roads, driver: Driver, leader_m: Array, dt: float) -> Drives:
    """Drive the truck, whose interface must have the grade, for the length of `driver.target`."""
    batch, n = driver.target.shape
    y = np.zeros((batch, n, len(truck.interface.y)))
    y[:, 0, 1] = driver.target[:, 0]
    u, w = np.zeros((batch, n, 2)), np.zeros((batch, n, 1))
    seen = {name: np.zeros((batch, n)) for name in SEEN}
    state = truck.reset(y[:, 0])
    for k in range(n):
        inside = state.records
        for name in SEEN:
            seen[name][:, k] = inside[name]
        on_bus = (np.asarray(getattr(force, "on_bus_nm", 0.0)) for force in state.forces)
        seen["engine_torque"][:, k] += sum(on_bus, start=np.zeros(()))  # what the controller reports too much
        w[:, k, 0] = roads.grade_at(inside["distance"])
        gap = leader_m[:, k] - inside["distance"]
        u[:, k] = driver.act(k, y[:, k, 1], gap, inside["ratio"], inside["engine_speed"], w[:, k, 0])
        if k + 1 < n:
            state, y[:, k + 1] = truck.step(state, u[:, k], w[:, k])
    y[:, 0, 2:] = y[:, 1, 2:]
    names = dict(zip(truck.interface.y, np.moveaxis(y, 2, 0), strict=True))
    channels = {
        **names,
        "engine_command": u[:, :, 0],
        "brake_command": u[:, :, 1],
        "grade": w[:, :, 0],
        **seen,
    }
    return Drives(channels, u, w, y, dt)


def leader_way(target: Array, follows: Sequence[bool], headway_s: float, dt: float) -> Array:
    """Position of the leader relative to the truck's start, (batch, n) m; NaN without a leader."""
    first = STANDSTILL_M + headway_s * target[:, :1] + 3.0
    way = first + np.cumsum(target, axis=1) * dt - target[:, :1] * dt
    return np.where(np.asarray(follows)[:, None], way, np.nan)
