"""Units that are often confused: a speed in km/h that is read as m/s is 3.6 times too large."""

from __future__ import annotations

from collections.abc import Mapping

NEAR = 0.015  # relative: as tyres differ from those of the simulator
ACCELEROMETERS = {  # what speed is too large by beside one that is read so
    1 / 9.80665: "an accelerometer in m/s^2 read as g",
    9.80665: "an accelerometer in g read as m/s^2",
}


def likely(scale: float, taken: Mapping[float, str]) -> str:
    """The confusion, among those in `taken`, that explains a factor of speed, with its cure; empty for most
    factors."""
    found = [what for factor, what in taken.items() if abs(scale / factor - 1.0) < NEAR]
    return f"{found[0]} is off by as much: check the units in COLUMNS.yaml" if found else ""
