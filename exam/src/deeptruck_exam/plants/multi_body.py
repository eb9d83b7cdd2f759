"""CommonRoad's multi-body car with tyre slip, pitch and wheels that turn, along random speeds and slopes; and
a point mass, as a user would write it for the same car.

The car's drag, rolling resistance and slope are forces added to the model, which has none of its own.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_exam.plants.cases import MISSING, Concealed
from deeptruck_model.recordings import Recording

POINT_MASS = "python:deeptruck_exam.plants.multi_body:make"
DT, SAMPLES, DRIVES = 0.1, 4000, 4
RATIO, AIR, GRAVITY = 4.0, 1.2, 9.81
WHEEL_M, WHEEL_INERTIA = 0.344, 1.7  # of each of the four
VALUES = {
    "mass": 1093.3, "drag_area": 0.65, "rolling_resistance": 0.012, "torque_gain": 1.0, "brake_gain": 1.0
}  # fmt: skip
INTERFACE = TruckInterface("car", "N m", "m/s^2", grade=True, fuel=False)
FORCES = ("traction_force", "brake_force", "drag_force", "rolling_force")
MOST_PULL, MOST_BRAKING = 5.0, 8.0  # m/s^2


@dataclass(frozen=True)
class Truth:
    """What the car has more of than its data sheet: kg, factors, m/s of head wind, N of a dragging brake."""

    mass_kg: float = 0.0
    drag: float = 1.0
    rolling: float = 1.0
    torque: float = 1.0
    brake: float = 1.0
    wind: float = 0.0
    dragging_n: float = 0.0


CONCEALED: Mapping[str, Concealed] = {
    "nothing": Concealed("nothing", truth=Truth()),
    "mass": Concealed("mass +150 kg", "mass", truth=Truth(mass_kg=150.0)),
    "drag": Concealed("drag +30 %", "drag_area", truth=Truth(drag=1.3)),
    "rolling": Concealed("rolling resistance +50 %", "rolling_resistance", truth=Truth(rolling=1.5)),
    "torque": Concealed("torque -6 %", "torque_gain", truth=Truth(torque=0.94)),
    "brake": Concealed("brakes -25 %", "brake_gain", truth=Truth(brake=0.75)),
    "headwind": Concealed("head wind of 6 m/s", "headwind", MISSING, Truth(wind=6.0)),
    "dragging_brake": Concealed("brake drags, 90 N", "dragging_brake", MISSING, Truth(dragging_n=90.0)),
    "payload": Concealed(
        "payload changes between drives", "payload_change", MISSING, Truth(), (0.0, 120.0, -80.0, 160.0)
    ),
    "slope": Concealed("slope not logged", "road_grade", MISSING, Truth(), withholds=("grade",)),
}


def drives(concealed: Concealed, seed: int, *, geared: bool = False) -> list[Recording]:
    """The recordings of a case; it has no gears. Raises ModuleNotFoundError if the model is not installed."""
    return [_drive(concealed, seed, k) for k in range(DRIVES)]


def _drive(concealed: Concealed, seed: int, k: int) -> Recording:
    rng = np.random.default_rng([seed, k])
    target, at, speed = np.empty(SAMPLES), 0, rng.uniform(8.0, 20.0)
    while at < SAMPLES:  # another speed every 15 to 50 s
        held = int(rng.uniform(150, 500))
        target[at : at + held] = speed
        at, speed = at + held, rng.uniform(5.0, 30.0)
    target = gaussian_filter1d(target, 30.0, mode="nearest")
    way = np.cumsum(target) * DT
    x = np.arange(0.0, way[-1] + 20.0, 5.0)
    rise, keep = np.zeros(len(x)), np.exp(-5.0 / 300.0)
    random = rng.standard_normal(len(x))
    for j in range(1, len(x)):
        rise[j] = keep * rise[j - 1] + np.sqrt(1.0 - keep**2) * random[j]
    slope = np.interp(way, x, gaussian_filter1d(0.015 * rise, 6.0, mode="nearest"))
    truth = concealed.truth
    if concealed.each_drive:
        truth = replace(truth, mass_kg=concealed.each_drive[k])
    v, engine, brake = _driven(target, slope, truth)
    channels = {
        "speed": v + 0.02 * rng.standard_normal(SAMPLES),
        "acceleration": np.r_[0.0, np.diff(v)] / DT + 0.03 * rng.standard_normal(SAMPLES),
        "engine_command": engine,
        "brake_command": brake,
        "grade": slope + 0.0006 * rng.standard_normal(SAMPLES),
    }
    shown = {name: x for name, x in channels.items() if name not in concealed.withholds}
    return Recording(f"drive_{k}", DT, shown, replace(INTERFACE, grade="grade" in shown))


def _driven(target: Array, slope: Array, truth: Truth) -> tuple[Array, Array, Array]:
    """Speed, m/s, and commands of engine, N m, and brake, m/s^2, (n,) of a driver who follows a target."""
    from vehiclemodels.init_mb import init_mb
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

    base = parameters_vehicle2()
    p = copy.deepcopy(base)
    p.m_s, p.m = p.m_s + truth.mass_kg, p.m + truth.mass_kg
    for inertia in ("I_y_s", "I_Phi_s", "I_z"):
        setattr(p, inertia, getattr(p, inertia) * p.m / base.m)
    t = DT * np.arange(len(target))
    wanted = np.gradient(target, DT)

    def commands(now: float, v: float) -> tuple[float, float]:
        """Wheel torque, N m, and braking, m/s^2."""
        a = np.interp(now, t, wanted) + 0.6 * (np.interp(now, t, target) - v)
        a += 0.8 * GRAVITY * np.interp(now, t, slope) + VALUES["rolling_resistance"] * GRAVITY
        a += 0.5 * AIR * VALUES["drag_area"] * v * v / base.m
        return min(max(a, 0.0), MOST_PULL) * base.m * base.R_w, min(max(-a, 0.0), MOST_BRAKING)

    def change(now: float, state: Array) -> list[float]:
        x = list(state)
        pull, braking = commands(now, x[3])
        torque = pull * truth.torque - braking * truth.brake * base.m * p.R_w
        out: list[float] = vehicle_dynamics_mb(x, [0.0, torque / (p.m * p.R_w)], p)
        wind, angle = x[3] + truth.wind, np.arctan(np.interp(now, t, slope))
        rolling = VALUES["rolling_resistance"] * truth.rolling * np.cos(angle)
        air = 0.5 * AIR * VALUES["drag_area"] * truth.drag * wind * abs(wind)
        out[3] -= (air + p.m * GRAVITY * (rolling + np.sin(angle)) + truth.dragging_n) / p.m
        return out

    start = init_mb([0, 0, 0, target[0], 0, 0, 0], p)
    fine = np.linspace(0.0, t[-1], (len(t) - 1) * 10 + 1)
    s = solve_ivp(change, (0.0, t[-1]), start, "LSODA", fine, rtol=1e-5, atol=1e-6, max_step=0.05)
    if not s.success:
        raise RuntimeError(s.message)
    each = np.array([commands(now, v) for now, v in zip(fine, s.y[3], strict=True)])
    mean = (0.5 * (each[1:] + each[:-1])).reshape(-1, 10, 2).mean(axis=1)
    mean = np.vstack([mean, mean[-1:]])
    return s.y[3][::10], mean[:, 0] / RATIO, mean[:, 1]


class State(NamedTuple):
    """Speed, m/s, and forces, N, of each row."""

    speed: Array
    forces: dict[str, Array]


@dataclass(frozen=True)
class PointMass:
    """Newton's law with the inertia of the wheels."""

    values: Mapping[str, float] = field(default_factory=lambda: dict(VALUES))
    interface: TruckInterface = INTERFACE
    dt: float = DT

    def reset(self, y0: Array) -> State:
        """The state at some recorded responses."""
        return State(np.array(y0[:, SPEED]), {n: np.zeros(len(y0)) for n in FORCES})

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        """One step; forces are those at its mean speed."""
        p, v, after = self.values, state.speed, state.speed
        angle = np.arctan(w.sum(axis=1))
        pull = p["torque_gain"] * u[:, 0] * RATIO / WHEEL_M
        braking = p["brake_gain"] * VALUES["mass"] * u[:, 1]
        rolling = p["mass"] * GRAVITY * p["rolling_resistance"] * np.cos(angle)
        drag = np.zeros_like(v)
        for _ in range(2):
            drag = 0.5 * AIR * p["drag_area"] * (0.5 * (v + after)) ** 2
            force = pull - braking - drag - rolling - p["mass"] * GRAVITY * np.sin(angle)
            after = np.maximum(v + force / self._effective_mass * self.dt, 0.0)
        forces = dict(zip(FORCES, (pull, braking, drag, rolling), strict=True))
        return State(after, forces), np.stack([(after - v) / self.dt, after], axis=1)

    def force(self, state: State, y: Array) -> State:
        """The state with the speed that was recorded."""
        return state._replace(speed=np.where(np.isnan(y[:, SPEED]), state.speed, y[:, SPEED]))

    def inside(self, state: State) -> dict[str, Array]:
        """Forces and masses of the last step."""
        one = np.ones_like(state.speed)
        masses = {"mass": self.values["mass"] * one, "effective_mass": self._effective_mass * one}
        return {**state.forces, **masses}

    def parameters(self) -> dict[str, float]:
        """What may be refitted."""
        return dict(self.values)

    def with_parameters(self, values: Mapping[str, float]) -> PointMass:
        """The same with other values."""
        return replace(self, values={**self.values, **values})

    @property
    def _effective_mass(self) -> float:
        return self.values["mass"] + 4.0 * WHEEL_INERTIA / WHEEL_M**2


def make(arguments: Mapping[str, Any] | None = None) -> PointMass:
    """The point mass; `grade: false` for one that is not given the slope."""
    given = dict(arguments or {})
    grade = bool(given.pop("grade", True))
    return PointMass({**VALUES, **given}, replace(INTERFACE, grade=grade))
