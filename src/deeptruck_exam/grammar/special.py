"""Carriers that draw something of their own: wind, slopes, grip, a torque limit, bends, oscillation."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from deeptruck_exam import worlds
from deeptruck_exam.grammar import shapes
from deeptruck_exam.grammar.signals import Signals
from deeptruck_exam.laws.law import GRAVITY, Array
from deeptruck_exam.laws.series import ou_series
from deeptruck_exam.worlds import roads

Rng = np.random.Generator


def wind(s: Signals, size: float, rng: Rng) -> Array:
    """Of `size` m/s: one wind over winding roads, or one for each drive; gusty, or sheltered by places."""
    if rng.random() < 0.5:
        bearing = rng.uniform(0.0, 2.0 * np.pi, int(s.setting.route.max()) + 1)[s.setting.route][:, None]
        bearing = bearing + 0.8 * np.sin(2.0 * np.pi * s.place / rng.uniform(1500.0, 5000.0))
        angle = rng.uniform(0.0, 2.0 * np.pi) - bearing - np.pi * (s.setting.direction[:, None] < 0)
    else:
        angle = np.broadcast_to(rng.uniform(0.0, 2.0 * np.pi, (len(s.speed), 1)), s.speed.shape)
    gusts = rng.uniform(0.05, 0.5) * ou_series(rng, s.speed.shape, s.dt, rng.uniform(3.0, 30.0))
    blows = size * (1.0 + gusts)
    if rng.random() < 0.4:
        blows = blows * (1.0 - rng.uniform(0.3, 0.9) * shapes.places(s, rng))
    v = np.maximum(s.speed, 2.0)
    along, across = 1.0 + blows * np.cos(angle) / v, blows * np.sin(angle) / v
    yaw = np.minimum(np.abs(across) / np.maximum(np.abs(along), 0.3), 1.0)
    met = along * np.hypot(along, across) * (1.0 + rng.uniform(0.0, 1.5) * yaw**2)
    return -np.clip(met - 1.0, -2.0, 4.0) * s.drag_force * np.clip(s.speed / 3.0, 0.0, 1.0)


def slope(s: Signals, size: float, rng: Rng) -> Array:
    """Of a road that nobody recorded, where none is; else humps and errors of the slope that is recorded."""
    values, kinds = worlds.values()["roads"], ("highway", "suburban", "hills")
    routes = int(s.setting.route.max()) + 1
    road = np.stack([roads.slopes(rng, str(rng.choice(kinds)), values) for _ in range(routes)])
    if np.any(s.grade):
        road = road - np.stack([np.convolve(r, np.ones(41) / 41, mode="same") for r in road])
    found = roads.Roads(road, s.setting.route, s.setting.start_m, s.setting.direction)
    met = np.stack([found.grade_at(x) for x in s.distance.T], axis=1)
    return -size * met * s.mass * GRAVITY * s.moving


def over_grip(s: Signals, size: float, rng: Rng) -> Array:
    """Pull beyond what ice or snow carries; the brakes' part is let off."""
    load = s.truck.drive_axle_share * s.mass * GRAVITY
    friction = rng.uniform(0.06, 0.25)
    beyond = np.maximum(np.maximum(s.traction_force, 0.0) - friction * load, 0.0)
    braked = np.maximum(s.brake_force - 1.1 * friction * s.mass * GRAVITY, 0.0) * s.moving
    return size * (shapes.lag(beyond, rng.uniform(0.05, 0.6), s.dt, rng) - braked)


def over_limit(s: Signals, size: float, rng: Rng) -> Array:
    """Torque beyond a limit, with a soft knee; the limit may fall with the engine's speed."""
    limit = s.truck.peak_torque * rng.uniform(0.3, 0.8) * np.ones(s.speed.shape)
    if rng.random() < 0.3:
        limit = limit * np.clip(1.6 - 0.6 * s.engine_speed / rng.uniform(100.0, 180.0), 0.3, 1.0)
    knee = s.truck.peak_torque * rng.uniform(0.01, 0.12)
    return (
        size
        * knee
        * np.logaddexp(0.0, np.clip((s.engine_torque - limit) / knee, -50.0, 50.0))
        * s.force_per_torque
    )


def bends(s: Signals, size: float, rng: Rng) -> Array:
    """Weight by lateral acceleration, at places of the road or at times."""
    bend = shapes.places(s, rng) if rng.random() < 0.5 else np.maximum(
        np.abs(ou_series(rng, s.speed.shape, s.dt, rng.uniform(3.0, 10.0))) - 0.7, 0.0)  # fmt: skip
    lateral = np.minimum(bend * (s.speed / rng.uniform(8.0, 18.0)) ** 2, 2.0)
    return size * s.mass * GRAVITY * s.moving * lateral ** rng.uniform(1.0, 2.0)


def oscillation(s: Signals, size: float, rng: Rng) -> Array:
    """Weight by a sine, with time or with the way; its size varies slowly."""
    period, metres = np.exp(rng.uniform(np.log(0.8), np.log(20.0))), rng.uniform(10.0, 200.0)
    turns = s.time / period if rng.random() < 0.6 else s.distance / metres
    swell = 1.0 + 0.5 * ou_series(rng, s.speed.shape, s.dt, 20.0)
    return size * s.mass * GRAVITY * s.moving * swell * np.sin(2.0 * np.pi * (turns + rng.random()))


SPECIAL: Mapping[str, Callable[[Signals, float, Rng], Array]] = {
    "wind": wind,
    "slope": slope,
    "over_grip": over_grip,
    "over_limit": over_limit,
    "bends": bends,
    "oscillation": oscillation,
}
