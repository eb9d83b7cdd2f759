"""What the engine holds the truck back with: braking, friction, and what it drives besides the wheels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression import (
    Expression,
    Since,
    exp,
    maximum,
    minimum,
)
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    overall_ratio_reference,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    MOST_KNOTS,
    each_recording,
    in_each,
    spline_columns,
    splines,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    ELAPSED,
    ENGINE,
    ENGINE_COMMAND,
    ENGINE_SPEED,
    OMEGA,
    OVERALL_RATIO,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, PerRecording, Simple, Spline, Static
from deeptruck_model.mismatch.residual.evidence import Evidence


@dataclass(frozen=True)
class Demanded(Constants):
    """Braking by a negative engine command, `full` at most: a force, or a torque that follows engine speed to
    `order` and is reported as a force at the gear ratio `reference` (rad/m)."""

    full: float
    order: int = 0
    reference: float | None = None


LITTLE, RELEASED = 0.03, 0.005  # of the largest command
LINGERS = 0.02  # of the time


@dataclass(frozen=True)
class Overrun(Constants):
    """Braking while the engine command is below `small`, from `after_s` later on. A torque that follows
    engine speed is reported as a force at the gear ratio `reference` (rad/m)."""

    by: Literal["engine_speed", "speed", "nothing"]
    small: float
    after_s: float
    reference: float
    order: int = 1


@dataclass(frozen=True)
class Staged(Constants):
    """By hand, or by a command the simulator does not get, while the engine command is below `small`."""

    small: float


def _engine_brakes(e: Evidence) -> Iterator[Simple]:
    command = e["engine_command"][e.valid]
    reference = overall_ratio_reference(e)
    if np.nanmin(command, initial=0.0) < 0:
        full = float(-np.nanmin(command))
        yield Static(Demanded(full))
        if e.has("ratio", "engine_speed"):
            yield from (Static(Demanded(full, order, reference)) for order in (0, 1, 2))
    smalls = _smalls(command)
    for small in smalls:
        for after_s in (0.0, 0.7):  # valves and vanes take a moment
            if e.has("ratio", "engine_speed"):
                for order in (1, 2):
                    yield Static(Overrun("engine_speed", small, after_s, reference, order))
            yield Static(Overrun("speed", small, after_s, reference))
            yield Static(Overrun("nothing", small, after_s, reference))
    yield from splines(e, -_coasting(smalls[0]), 0.3, constants=Staged(smalls[0]))


def _smalls(command: NDArray[np.float64]) -> list[float]:
    """Commands below which a pedal may count as released; a smaller one too where a foot lingers there."""
    largest = float(np.nanmax(np.abs(command), initial=0.0))
    lingers = np.mean((command > RELEASED * largest) & (command < LITTLE * largest))
    let_go = np.mean(np.abs(command) <= RELEASED * largest)
    return [LITTLE * largest, *([RELEASED * largest] if min(lingers, let_go) > LINGERS else [])]


def _coasting(small: float) -> Expression:
    """One where the engine is asked for nothing and does not pull, else zero."""
    return (small + 1e-9 > ENGINE_COMMAND) * (ENGINE < 0.05)


def _engine_brake(v: Simple) -> list[Column]:
    match v.constants:
        case Demanded() as demanded:
            return [_demanded(demanded)]
        case Staged(small):
            return spline_columns(v, -_coasting(small), "force", "N", sign=1, per_mass=True)
        case Overrun() as overrun:
            return _overrun(overrun)
    raise TypeError(f"{v!r} is no engine brake")


def _demanded(how: Demanded) -> Column:
    asked = minimum(ENGINE_COMMAND, 0.0) / how.full
    if how.reference is not None:
        asked = asked * (OVERALL_RATIO / how.reference)
    for _ in range(how.order):
        asked = asked * (ENGINE_SPEED / OMEGA)
    return Column(asked, 0.3, "force_at_full_demand", "N", per_mass=True)


def _overrun(how: Overrun) -> list[Column]:
    coast = _coasting(how.small)
    if how.after_s:
        coast = coast * (Since((1.0 - coast,)) > how.after_s)
    if how.by == "engine_speed":
        drive = coast * (OVERALL_RATIO / how.reference) * (ENGINE_SPEED / OMEGA)
        parts = [Column(-drive, 0.1, "force_at_150_rad_s", "N", per_mass=True)]
        if how.order == 2:
            parts.append(Column(-(drive * ENGINE_SPEED / OMEGA), 0.1, "force_square", "N", per_mass=True))
        return parts
    if how.by == "speed":
        return [Column(-(coast * SPEED / 20.0), 0.1, "force_at_20_m_s", "N", per_mass=True)]
    return [Column(-coast, 0.1, "force", "N", per_mass=True)]


@dataclass(frozen=True)
class Friction(Constants):
    """A torque, as a force at the gear ratio `reference` (rad/m), that follows engine speed to `order`; with
    `cold_s` it wears off as the engine warms up."""

    reference: float
    order: int
    cold_s: float | None = None


def _frictions(e: Evidence) -> Iterator[Simple]:
    reference = overall_ratio_reference(e)
    for order in (0, 1):
        yield Static(Friction(reference, order))
    for cold_s in (60.0, 200.0, 600.0, 1500.0):
        yield Static(Friction(reference, 0, cold_s))
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield each_recording(e, Friction(reference, 0, cold_s))


def _friction(v: Simple) -> list[Column]:
    how = v.constants
    if not isinstance(how, Friction):
        raise TypeError(f"{v!r} is no friction")
    drive = OVERALL_RATIO / how.reference
    if how.order == 1:
        drive = drive * ENGINE_SPEED / OMEGA
    if how.cold_s is not None:
        drive = drive * exp(-(ELAPSED / how.cold_s))
    if isinstance(v, PerRecording):  # every drive starts as cold as it happens to be
        return [
            Column(-(drive * here), 0.05, f"force[{name}]", "N", per_mass=True) for name, here in in_each(v)
        ]
    return [Column(-drive, 0.03, "force", "N", per_mass=True)]


PER_POWER = -(1.0 / maximum(SPEED, 3.0))


@dataclass(frozen=True)
class AtTheEngine(Constants):
    """A torque that follows engine speed to `order`, as a force at the gear ratio `reference` (rad/m)."""

    reference: float
    order: int


def _accessory_loads(e: Evidence) -> Iterator[Simple]:
    """A power, or a torque at the engine: a pump's is always the same, a fan's grows with speed squared."""
    yield Static()
    yield from splines(e, PER_POWER, 2.0)
    if e.has("ratio", "engine_speed"):
        reference = overall_ratio_reference(e)
        for order in (0, 2):
            torque = _at_the_engine(reference, order)
            yield from splines(e, torque, 0.3, constants=AtTheEngine(reference, order))


def _at_the_engine(reference: float, order: int) -> Expression:
    overall_ratio = OVERALL_RATIO / reference
    return -(overall_ratio * (ENGINE_SPEED / OMEGA) ** order) if order else -overall_ratio


def _accessories(v: Simple) -> list[Column]:
    match v:
        case Spline(constants=AtTheEngine(reference, order)):
            torque = _at_the_engine(reference, order)
            return spline_columns(v, torque, "force", "N", sign=1, per_mass=True)
        case Spline():
            return spline_columns(v, PER_POWER, "power", "W", sign=1, per_mass=True)
    return [Column(PER_POWER, 0.5, "power", "W", per_mass=True)]


MECHANISMS = (
    Mechanism(
        "engine_brake",
        "F = -c n(w) r, or -F0(t) by stages, with the engine command at or below zero",
        "the engine retards more on the overrun than the simulator knows",
        ("engine_command", "engine", "speed"),
        ("engine command", "engine speed"),
        "SAE J1621 retarder torque curves",
        "coast in gear and in neutral from the same speed",
        _engine_brakes,
        _engine_brake,
    ),
    Mechanism(
        "engine_friction",
        "F = -r (c0 + c1 w), larger while cold",
        "the engine turns harder than the simulator knows",
        ("ratio", "engine_speed"),
        ("engine speed", "gear", "time since start"),
        "Chen-Flynn friction model; Heywood, ch. 13",
        "coast in two gears from the same speed, cold and warm",
        _frictions,
        _friction,
        prior=0.7,
    ),
    Mechanism(
        "accessory_load",
        "F = -P / v, or -T r (1, or w^2)",
        "something besides the wheels takes engine power",
        ("speed", "engine"),
        ("speed", "engine speed", "time since standing"),
        "fan, compressor and air conditioning loads: NREL heavy-vehicle accessory studies",
        "hold the same road load with the fan on and off",
        _accessory_loads,
        _accessories,
        prior=0.7,
    ),
)
