"""A drive of known speed, as tables in which each test changes one thing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
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


def table(path: Path, columns: dict[str, Any], delimiter: str = ",") -> Path:
    rows = [
        delimiter.join(columns),
        *(delimiter.join(map(str, row)) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def with_channels(**more: Any) -> dict[str, Any]:
    return {**COLUMNS, "channels": {**COLUMNS["channels"], **more}}
