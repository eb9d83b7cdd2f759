"""The library: every mechanism the tool can name."""

from deeptruck_model.mismatch.mechanisms import air_and_tyres, brakes, commands, driveline, engine, load, road
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Shape,
    build,
    comes_and_goes,
    merge,
    shapes,
)
from deeptruck_model.mismatch.mechanisms.unnamed import UNNAMED

LIBRARY: dict[str, Mechanism] = {
    m.effect: m
    for room in (brakes, air_and_tyres, road, engine, driveline, load, commands)
    for m in room.MECHANISMS
}

__all__ = [
    "LIBRARY",
    "UNNAMED",
    "Column",
    "Mechanism",
    "Shape",
    "build",
    "comes_and_goes",
    "merge",
    "shapes",
]
