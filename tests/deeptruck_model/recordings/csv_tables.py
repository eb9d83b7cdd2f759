"""Tables for the tests of the importer."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array

DATA = Path(os.environ.get("DEEPTRUCK_REAL_DATA", Path(__file__).parents[4] / "shared" / "data"))
SPEED = {"speed": {"column": "v", "unit": "m/s"}}
EVERYTHING = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "speed": {"column": "v", "unit": "km/h"},
        "acceleration": {"column": "a", "unit": "m/s^2"},
        "engine_command": {"column": "E_cmd", "unit": "percent"},
        "brake_command": {"column": "B_cmd", "unit": "bar"},
        "grade": {"column": "grade", "unit": "percent"},
        "fuel_rate": {"column": "fuel", "unit": "g/s", "density": 0.8},
        "gear": {"column": "gear"},
        "engine_speed": {"column": "rpm", "unit": "rpm"},
        "engine_torque": {"column": "T_e", "unit": "N m"},
        "elevation": {"column": "h", "unit": "m"},
        "gap": {"column": "gap", "unit": "m"},
        "leader_speed": {"column": "v_lead", "unit": "m/s"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    },
}


def write_csv(path: Path, columns: dict[str, Any], delimiter: str = ",", encoding: str = "utf-8") -> Path:
    rows = [
        delimiter.join(columns),
        *(delimiter.join(map(str, row)) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(rows) + "\n", encoding=encoding)
    return path


def everything(count: int = 400) -> dict[str, np.ndarray[Any, Any]]:
    rng = np.random.default_rng(0)
    t = 0.1 * np.arange(count)
    columns = {"t": np.round(5 + t, 3), "v": 36 + 9 * np.sin(t / 5), "a": 0.5 * np.cos(t / 5)}
    for name in ("E_cmd", "B_cmd", "grade", "fuel", "T_e", "h", "v_lead", "T"):
        columns[name] = rng.uniform(0.1, 1.0, count)
    columns |= {"gear": rng.integers(1, 12, count), "rpm": rng.uniform(600, 2000, count)}
    return columns | {"gap": np.round(rng.uniform(5, 50, count) * 8) / 8}


def hilly() -> dict[str, np.ndarray[Any, Any]]:
    return {"v": np.full(600, 20.0), "h": 100 + 0.02 * 20.0 * np.arange(600), "T": np.arange(600) / 30}


HILLY = {
    "time": {"rate_hz": 1.0},
    "channels": {
        **SPEED,
        "elevation": {"column": "h", "unit": "m"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    },
}


COLUMNS: dict[str, Any] = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "speed": {"column": "v", "unit": "km/h"},
        "engine_command": {"column": "gas", "unit": "percent"},
        "brake_command": {"column": "brake", "unit": "percent"},
    },
}


def speed(t: Array) -> Array:
    """m/s."""
    return 15 + 6 * np.sin(2 * np.pi * t / 60) + 2 * np.sin(2 * np.pi * t / 17)


def drive(count: int = 600) -> dict[str, Any]:
    """A minute at 10 Hz: time in s, speed in km/h, pedals in percent, acceleration in m/s^2."""
    t = np.round(0.1 * np.arange(count), 1)
    a = np.gradient(speed(t), t)
    return {
        "t": t,
        "v": np.round(3.6 * speed(t), 2),
        "gas": np.round(np.clip(35 + 38 * a, 0, 90), 1),
        "brake": np.round(np.clip(-20 * a - 8, 0, 90), 1),
        "a": np.round(a, 4),
    }


def with_channels(**more: Any) -> dict[str, Any]:
    return {**COLUMNS, "channels": {**COLUMNS["channels"], **more}}
