"""Hidden differences that are no missing force: an unrecorded road, faults of the measurement, wrong
parameters."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Kind, Planted, Setting, ou_series, register


def _road(setting: Setting, p: SimpleNamespace) -> Planted:
    return Planted(conceal=("grade", "elevation"))


def _shift(values: Array, dt: float, late_s: float) -> Array:
    n = np.arange(len(values)) * dt
    return np.interp(n - late_s, n, values)


def _clock(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        late = np.sign(p.sign) * p.late_s
        n = np.arange(len(channels["acceleration"])) * dt
        channels["acceleration"] = np.interp(n - late - 1e-6 * p.drift_ppm * n, n, channels["acceleration"])

    return Planted(faults=(spoil,))


def _clock_of_responses(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        for name in ("acceleration", "speed", "fuel_rate", "gear", "engine_speed", "engine_torque"):
            if name in channels:
                channels[name] = _shift(channels[name], dt, p.late_s)

    return Planted(faults=(spoil,))


def _speed_scale(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale)

    return Planted(faults=(spoil,))


def _acceleration_bias(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        drift = p.drift * ou_series(rng, (1, len(channels["acceleration"])), dt, 120.0)[0]
        channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * (p.bias + drift)

    return Planted(faults=(spoil,))


def _grade_bias(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias

    return Planted(faults=(spoil,), conceal=("elevation",))


def _wrong(parameter: str) -> Callable[[Setting, SimpleNamespace], Planted]:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        factor = 1.0 + np.sign(p.sign) * p.share
        return Planted(parameters={parameter: getattr(setting.truck, parameter) * factor})

    return build


def _add(
    key: str,
    kind: Kind,
    source: str,
    ranges: dict[str, tuple[float, float]],
    build: Callable[[Setting, SimpleNamespace], Planted],
    name: str | None = None,
    needs: tuple[str, ...] = ("highway", "suburban", "hills", "descent"),
    accepts: tuple[str, ...] = (),
) -> None:
    register(Effect(key, name or key, kind, source, ranges, build, needs=needs, accepts=accepts))


SIGN = {"sign": (-1.0, 1.0)}
FAULT: Kind = "measurement_fault"

_add(
    "road_grade",
    "missing_physics",
    "Road profiles as in the route generator (routes.py); the slope is not recorded at all",
    {},
    _road,
    needs=("hills", "highway"),
)
_add(
    "clock_offset",
    FAULT,
    "Accelerometer logged by another computer: SAE J1939-21 has no time stamps; crystal drift of tens of ppm",
    {"late_s": (0.35, 1.2), "drift_ppm": (-80.0, 80.0), **SIGN},
    _clock,
    needs=("suburban", "hills"),
)
_add(
    "clock_offset_responses",
    FAULT,
    "All responses stamped late against the commands, as by a gateway that buffers",
    {"late_s": (0.35, 1.0)},
    _clock_of_responses,
    name="clock_offset",
    needs=("suburban", "hills"),
    accepts=("command_delay",),
)
_add(
    "speed_scale",
    FAULT,
    "Tyre wear and a wrong tyre factor in the tachograph's or the bus's speed; sizes beyond a service"
    " adjustment, chosen here",
    {"scale": (0.03, 0.09), **SIGN},
    _speed_scale,
)
_add(
    "acceleration_bias",
    FAULT,
    "Mounting pitch of 1-2 degrees and thermal drift of a MEMS accelerometer (Woodman, UCAM-CL-TR-696, 2007)",
    {"bias": (0.12, 0.40), "drift": (0.0, 0.03), **SIGN},
    _acceleration_bias,
)
_add(
    "grade_bias",
    FAULT,
    "Inclinometer mounted out of level by 0.5-1.5 degrees; Vahidi, Stefanopoulou and Peng, Vehicle System"
    " Dynamics 43 (2005), on estimating grade and mass",
    {"bias": (0.008, 0.025), **SIGN},
    _grade_bias,
    accepts=("rolling_resistance",),
)
for _name, _low, _high, _needs, _accepts in (
    ("mass", 0.15, 0.40, ("suburban", "hills"), ("payload_change",)),
    ("drag_area", 0.25, 0.60, ("highway", "hills"), ("rolling_resistance_speed", "headwind")),
    ("rolling_resistance", 0.35, 0.80, ("highway", "suburban"), ("grade_bias",)),
    ("torque_gain", 0.10, 0.22, ("hills", "highway"), ("driveline_loss",)),
    ("brake_gain", 0.20, 0.45, ("suburban", "descent"), ()),
):
    _add(
        f"wrong_{_name}",
        "parameter_error",
        "The simulator's own parameter is off; no physics is missing",
        {"share": (_low, _high), **SIGN},
        _wrong(_name),
        name=_name,
        needs=_needs,
        accepts=_accepts,
    )
