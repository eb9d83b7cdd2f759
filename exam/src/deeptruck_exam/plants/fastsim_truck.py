"""A class 8 line-haul truck simulated by FASTSim (NREL), and the signals of its bus.

FASTSim is backward facing: it computes the power that a speed trace needs. If the truck falls behind its
trace, FASTSim loses its slopes, so that the driver here demands no more than the engine has. FASTSim has
neither gears nor an engine speed; the bus therefore shows its engine's power as a torque through one fixed
ratio, at idle speed or above, like a lossless converter. No truck with a data sheet is built so: the same
drives `geared` show the torque in the gears of a usual gearbox, below idle speed through a clutch that slips,
and brakes at rest. FASTSim has no wind: a headwind is represented by the slope with the same force.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.reading import package_yaml
from deeptruck_core.signals import TruckInterface
from deeptruck_exam.laws.series import ou_series
from deeptruck_model.recordings import Recording

DT = 0.1
AIR_DENSITY, GRAVITY = 1.2, 9.80665  # kg/m^3, m/s^2: FASTSim's own
# The bus, which FASTSim does not have: direct drive with an axle of 4.0, so that 80 km/h are 1680 rpm, and
# 670 rpm at idle, as heavy diesel engines run; sensors as the usual ones of worlds.yaml.
RATIO, IDLE = 4.0, 70.0  # 1, rad/s
# The geared bus: an Eaton Fuller FRO-1x210C with a common axle; 1620 rpm at most but in top gear.
GEARS, AXLE, UPSHIFT = (12.69, 9.29, 6.75, 4.90, 3.62, 2.59, 1.90, 1.38, 1.00, 0.74), 3.7, 170.0  # rad/s
HOLD = 1.0  # m/s^2 of braking at rest, more than the steepest slope asks for: FASTSim's truck does not roll
SPEED_NOISE, ACCELERATION_NOISE, SLOPE_NOISE = 0.02, 0.03, 0.0006
# The road: between the highways and the hills of worlds.yaml, less steep than the 6 % that AASHTO allows
# freeways; few enough metres from slope to slope that a drive of 400 s has many.
SLOPE_SD, SLOPE_M, STEEPEST = 0.018, 400.0, 0.045
# The driver: asks for what FASTSim's engine has in any case (at once a sixth of its power, 55 kW), as FASTSim
# must not fall behind; rounds the corners of a trace of one sample a second.
SPARE, LAUNCH_W, SMOOTH_S = 0.8, 30_000.0, 3.0  # of the power and of its growth
SLOWEST = 0.05  # m/s, below which power and force are not compared
INTERFACE = TruckInterface("line haul", "N m", "m/s^2", grade=True, fuel=False)


@lru_cache
def sheet() -> dict[str, Any]:
    """The truck's data sheet."""
    values: dict[str, Any] = package_yaml(__package__, "line_haul.yaml")
    return values


@dataclass(frozen=True)
class Truth:
    """The truck's differences from its data sheet: factors and additions."""

    mass_kg: float = 0.0
    drag: float = 1.0
    rolling: float = 1.0
    efficiency: float = 1.0
    auxiliary_w: float = 0.0
    wind: float = 0.0  # m/s, from ahead


def fastsim() -> Any:
    """The package. Raises ModuleNotFoundError if it is not installed."""
    import fastsim as package

    return package


def trace(cycle: str, start_s: float, length_s: float, scale: float) -> Array:
    """Target speeds (n,) in m/s, every DT, from a part of one of FASTSim's cycles, 'udds' or 'hwfet'."""
    values = fastsim().Cycle.from_resource(f"{cycle}.csv").to_dict()
    time, speed = (np.array(values[name]) for name in ("time_seconds", "speed_meters_per_second"))
    at = start_s + DT * np.arange(round(length_s / DT))
    width = round(SMOOTH_S / DT)
    raw = np.pad(scale * np.interp(at, time, speed), (width, width), mode="edge")
    return np.convolve(raw, np.ones(width) / width, mode="same")[width:-width]


def road(target: Array, rng: np.random.Generator) -> Array:
    """Slopes (n,) along the distance that the target speeds give."""
    way = np.cumsum(target) * DT
    metres = np.arange(0.0, way[-1] + 10.0, 5.0)
    slope = SLOPE_SD * ou_series(rng, (1, len(metres)), 5.0, SLOPE_M)[0]
    slope = np.convolve(slope, np.ones(20) / 20, mode="same")
    return np.clip(np.interp(way, metres, slope), -STEEPEST, STEEPEST)


def record(
    name: str, target: Array, slope: Array, truth: Truth, rng: np.random.Generator, *, geared: bool = False
) -> Recording:
    """The bus signals of FASTSim's truck along the target speeds and slopes, both (n,).

    Raises RuntimeError as FASTSim does if the truck falls behind.
    """
    mass = sheet()["mass"] + truth.mass_kg
    wind = 0.5 * AIR_DENSITY * _drag_area(truth) * (2.0 * target * truth.wind + truth.wind**2)
    felt = slope + np.clip(target / 5.0, 0.0, 1.0) * wind / (mass * GRAVITY)
    history = _walk(driven(target, felt, truth), felt, truth)
    speed = history["veh.history.speed_ach_meters_per_second"]
    mean = np.maximum(np.r_[speed[0], 0.5 * (speed[1:] + speed[:-1])], SLOWEST)
    drive, auxiliary = (history[f"veh.pt_type.Conv.fc.history.pwr_{p}_watts"] for p in ("prop", "aux"))
    braking = np.maximum(-history["veh.history.pwr_tractive_watts"], 0.0) / mean / mass
    braking = np.where(mean > SLOWEST, braking, 0.0)
    n, torque = len(speed), (drive + auxiliary) / engine_speed(mean)
    gears: dict[str, Array] = {}
    if geared:
        gears["gear"] = _held(gear(mean))
        turning = engine_speed(mean, overall(gear(mean)))
        torque = drive / (mean * overall(gear(mean))) + auxiliary / turning
        braking[np.r_[speed[0], np.maximum(speed[1:], speed[:-1])] == 0.0] = HOLD
    channels = {
        "speed": np.maximum(speed + SPEED_NOISE * (speed > 0) * rng.standard_normal(n), 0.0),
        "acceleration": np.r_[0.0, np.diff(speed)] / DT + ACCELERATION_NOISE * rng.standard_normal(n),
        "engine_command": _held(torque),  # FASTSim's step k is from k - 1 to k
        "brake_command": _held(braking),
        "grade": _held(slope) + SLOPE_NOISE * rng.standard_normal(n),
        "engine_speed": engine_speed(speed, overall(gears["gear"])) if geared else engine_speed(mean),
        **gears,
    }
    return Recording(name, DT, channels, INTERFACE)


def driven(target: Array, slope: Array, truth: Truth) -> Array:
    """The speeds (n,) at which a truck follows its target from rest, where FASTSim begins, with the share
    SPARE of its power."""
    s, mass = sheet(), sheet()["mass"] + truth.mass_kg
    efficiency = s["transmission_efficiency"] * truth.efficiency
    growth = SPARE * s["engine_power"] / s["engine_ramp"] * DT
    speed, power = np.zeros(len(target)), 0.0
    gain = 0.5 * inertia(mass) / DT
    for k in range(len(target) - 1):
        v = speed[k]
        resists = mass * GRAVITY * (s["rolling_resistance"] * truth.rolling + slope[k + 1])
        resists += 0.5 * AIR_DENSITY * _drag_area(truth) * v**2
        most = efficiency * (
            min(SPARE * s["engine_power"], max(power, LAUNCH_W) + growth) - truth.auxiliary_w
        )
        # power of the mean speed: gain (v'^2 - v^2) + resists (v' + v) / 2 = most
        half = 0.25 * resists / gain
        reach = max((v - half) ** 2 + most / gain, 0.0) ** 0.5 - half
        after = speed[k + 1] = max(min(target[k + 1], reach), 0.0)
        used = gain * (after**2 - v**2) + 0.5 * resists * (after + v)
        power = max(used, 0.0) / efficiency + truth.auxiliary_w
    return speed


def inertia(mass: float) -> float:
    """The mass with the equivalent mass of the wheels, kg."""
    s = sheet()
    return float(mass + s["wheels"] * s["wheel_inertia"] / s["wheel_radius"] ** 2)


def gear(speed: Array) -> Array:
    """The lowest gear (n,), from 1, in which the engine turns at UPSHIFT or slower at speeds (n,) in m/s."""
    highest = UPSHIFT * sheet()["wheel_radius"] / AXLE / np.array(GEARS[:-1])
    return np.asarray(1.0 + np.searchsorted(highest, speed), dtype=np.float64)


def overall(gear: Array) -> Array:
    """Engine speed over road speed, rad/m, in gears (n,)."""
    return np.asarray(np.array(GEARS)[gear.astype(int) - 1] * AXLE / sheet()["wheel_radius"])


def engine_speed(speed: Array, overall: Array | None = None) -> Array:
    """Engine speed in rad/s at speeds (n,) in m/s, idle or above, through RATIO or `overall` ratios
    (n,), rad/m."""
    through = RATIO / sheet()["wheel_radius"] if overall is None else overall
    return np.asarray(np.maximum(IDLE, speed * through))


def _held(values: Array) -> Array:
    return np.r_[values[1:], values[-1]]


def _drag_area(truth: Truth) -> float:
    return float(sheet()["drag_coefficient"] * sheet()["frontal_area"] * truth.drag)


def _walk(target: Array, slope: Array, truth: Truth) -> Mapping[str, Array]:
    """FASTSim's histories (n,) by name."""
    package = fastsim()
    cycle = {
        "time_seconds": (DT * np.arange(len(target))).tolist(),
        "speed_meters_per_second": target.tolist(),
        "grade": slope.tolist(),
    }
    drive = package.SimDrive(_vehicle(package, truth), package.Cycle.from_dict(cycle))
    drive.run()
    table = drive.to_dataframe()
    return {name: np.array(table[name], dtype=np.float64) for name in table.columns if "history" in name}


def _vehicle(package: Any, truth: Truth) -> Any:
    """FASTSim's vehicle: one of its conventional vehicles, with all numbers replaced by ours."""
    s = sheet()
    data = package.Vehicle.from_resource("2012_Ford_Fusion.yaml").to_dict()
    engine, chassis = data["pt_type"]["Conv"]["fc"], data["chassis"]
    data.update(
        name="line haul",
        mass_kilograms=s["mass"] + truth.mass_kg,
        pwr_aux_base_watts=s["auxiliary_power"] + truth.auxiliary_w,
    )
    data["pt_type"]["Conv"]["fs"]["pwr_out_max_watts"] = 5e6
    data["pt_type"]["Conv"]["transmission"]["eff_interp"] = s["transmission_efficiency"] * truth.efficiency
    engine.update(
        pwr_out_max_watts=s["engine_power"],
        pwr_out_max_init_watts=s["engine_power"] / s["engine_ramp"],
        pwr_ramp_lag_seconds=s["engine_ramp"],
    )
    engine["eff_interp_from_pwr_out"]["data"]["values"] = s["engine_efficiency"]
    chassis.update(
        drag_coef=s["drag_coefficient"] * truth.drag,
        frontal_area_square_meters=s["frontal_area"],
        wheel_rr_coef=s["rolling_resistance"] * truth.rolling,
        wheel_inertia_kilogram_square_meters=s["wheel_inertia"],
        num_wheels=s["wheels"],
        wheel_radius_meters=s["wheel_radius"],
        wheel_fric_coef=s["wheel_friction"],
        cg_height_meters=s["centre_height"],
        wheel_base_meters=s["wheel_base"],
        drive_axle_weight_frac=s["drive_axle_share"],
        drive_type="RWD",
        glider_mass_kilograms=None,
        cargo_mass_kilograms=None,
    )
    return package.Vehicle.from_dict(data)
