"""Unit and scale of speed, checked by positions, or by engine speed in the gears of a simulator that reports
them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED
from deeptruck_core.vehicle_kinds import CLUTCH_CLOSED
from deeptruck_model.mismatch.prepare.checks import SensorFault
from deeptruck_model.mismatch.prepare.one_road import driven_by_positions
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.prepare.runs import fed
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings.consistency.agreement import SPEEDS, factor_of
from deeptruck_model.simulators import Simulator, forced_run

Array = NDArray[np.float64]

GEARS_AT_MOST = 2.0  # a simulator may drive a gear or two apart, which is no unit
NEAR, MOSTLY = 0.01, 0.6  # so near its median, relative, so often: a converter that slips has no one ratio
SAME = 0.5  # gears are whole
FEWEST = 5  # pieces of road that give a scale: one alone may be all bends
BETWEEN, BY_PLACE = ("speed", "engine_speed"), ("speed", "latitude")
PLACED = "speed is {scale:.3f} times what positions give: it is scaled"
SCALED = (
    "speed is {scale:.3f} times what engine speed gives in the simulator's gears: it is scaled, or tyres and "
    "axles are not the simulator's"
)


def check_speed_unit(simulator: Simulator, prepared: Sequence[Prepared]) -> None:
    """Raises InputError if speed and engine speed of the first drive that has both differ by the factor of a
    unit. Other factors are inconclusive, because tyres and axles differ."""
    first = next((p for p in prepared if "engine_speed" in p.recording.channels), None)
    scale = _scale(simulator, first) if first is not None else None
    if first is None or scale is None or 1.0 / GEARS_AT_MOST < scale < GEARS_AT_MOST:
        return
    if unit := factor_of(scale, SPEEDS):
        raise InputError(
            f"speed of '{first.recording.name}' is {scale:.3g} times what its engine speed gives by the "
            f"simulator's gear; {unit} is off by as much: check the units in COLUMNS.yaml"
        )


def speed_scale_faults(simulator: Simulator, prepared: Sequence[Prepared], rules: Rules) -> list[SensorFault]:
    """A scale fault of speed that no accelerometer reading could confirm; empty if there is none or it cannot
    be checked. Positions check it for any truck; without them engine speed does, if the simulator has the
    truck's tyres and axles."""
    if any(p.measured_acceleration for p in prepared):
        return []
    ratios = [driven_by_positions(p) for p in prepared]
    by_place = _common_factor(ratios) if sum(map(len, ratios)) >= FEWEST else None
    if by_place is not None:
        return _beyond(by_place, rules, PLACED, "speed = k * speed by positions", BY_PLACE)
    by_engine = _common_factor([_ratios(simulator, p, same_gear=True) for p in prepared])
    return _beyond(by_engine, rules, SCALED, "speed = k * speed by engine", BETWEEN)


def _common_factor(drives: Sequence[Array]) -> tuple[float, float] | None:
    """The common factor of the ratios of all drives, each (m,), and its standard error; None if there is
    none."""
    drives = [x for x in drives if len(x)]
    if not drives:
        return None
    ratios = np.concatenate(drives)
    scale = float(np.median(ratios))
    if np.mean(np.abs(ratios / scale - 1.0) < NEAR) < MOSTLY or not 1 / GEARS_AT_MOST < scale < GEARS_AT_MOST:
        return None
    spread = float(np.median(np.abs(ratios - scale)))
    se = max(spread, float(np.std([np.median(x) for x in drives]))) / float(np.sqrt(len(drives)))
    return scale, se


def _beyond(
    found: tuple[float, float] | None, rules: Rules, says: str, equation: str, between: tuple[str, str]
) -> list[SensorFault]:
    if found is None or abs(found[0] - 1.0) <= rules.speed_scale:
        return []
    scale, se = found
    return [SensorFault("speed_scale", scale, se, "1", says.format(scale=scale), equation, between, "speed")]


def _scale(simulator: Simulator, p: Prepared) -> float | None:
    """The factor by which speed is too large; None if the simulator or the recording lacks a channel."""
    ratios = _ratios(simulator, p)
    return float(np.median(ratios)) if len(ratios) else None


def _ratios(simulator: Simulator, p: Prepared, same_gear: bool = False) -> Array:
    """Ratios of simulated to recorded engine speed (m,) while the truck moves in the `same_gear`; empty if
    the simulator or the recording lacks a channel."""
    recorded, gear = (p.recording.channels.get(name) for name in ("engine_speed", "gear"))
    if recorded is None:
        return np.zeros(0)
    inside = forced_run(simulator, p.u[None], p.w[None], fed(simulator, p.y)[None]).inside
    if "engine_speed" not in inside:
        return np.zeros(0)
    use = p.valid & (p.y[:, SPEED] > CLUTCH_CLOSED) & (recorded > 0.0)
    if same_gear and gear is not None and "gear" in inside:
        use &= np.abs(gear - inside["gear"][0]) < SAME
    out: Array = inside["engine_speed"][0][use] / recorded[use]
    return out
