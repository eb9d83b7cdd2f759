"""Engine: lag of the boost, derates, limits, friction, and what it drives besides the wheels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from deeptruck_model.mismatch.expression import (
    Expression,
    Lag,
    RisingLag,
    Signal,
    Since,
    exp,
    lift,
    maximum,
    minimum,
)
from deeptruck_model.mismatch.mechanisms.base import (
    Array,
    Column,
    Mechanism,
    overall_ratio_reference,
    quantile,
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
    PULL,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, PerRecording, Simple, Spline, Static
from deeptruck_model.mismatch.residual.evidence import Evidence


@dataclass(frozen=True)
class Boost(Constants):
    """Torque above what the engine gives without boost comes late. Torques are told as forces at the gear
    ratio `reference` (rad/m); without it gears are not known."""

    tau_s: float
    aspirated: float = 0.0
    reference: float | None = None
    order: int = 1
    stays: bool = False  # through a shift: what was built up falls no faster than it rises
    slow_when_slow: bool = False  # little exhaust spins the turbine up slowly


def _turbos(e: Evidence) -> Iterator[Static]:
    """All of the torque may lag, or what is above what the engine gives without boost, or more so at low
    revolutions."""
    pull = np.maximum(e["engine"], 0.0)
    reference = overall_ratio_reference(e)
    known = "ratio" in e.signals
    torque = pull * reference / np.maximum(e["ratio"], 0.05 * reference) if known else pull
    full = quantile(e, torque, pull > 0.02, 0.98)
    gearing = reference if known else None
    for tau_s in (0.4, 0.8, 1.6, 3.0):
        yield Static(Boost(tau_s, 0.0, gearing))
        yield Static(Boost(tau_s, 0.0, gearing, order=2))
        for share in (0.2, 0.4) if np.isfinite(full) else ():
            yield Static(Boost(tau_s, share * full, gearing))
            yield Static(Boost(tau_s, share * full, gearing, stays=True))
        if known and e.has("engine_speed"):
            yield Static(Boost(tau_s, 0.0, gearing, slow_when_slow=True))


def _turbo(v: Simple) -> list[Column]:
    how = v.constants
    if not isinstance(how, Boost):
        raise TypeError(f"{v!r} is no lag of a boost")
    overall_ratio = OVERALL_RATIO / how.reference if how.reference else lift(1.0)
    boosted = maximum(PULL / maximum(overall_ratio, 0.05) - how.aspirated, 0.0)
    boost: Expression = boosted
    for _ in range(how.order):  # a boost that feeds itself begins slowly
        boost = RisingLag((boost,), how.tau_s / how.order)
    if how.stays:
        boost = Lag((boosted,), how.tau_s)
    late = minimum(boost - boosted, 0.0) * overall_ratio
    if how.slow_when_slow:
        late = late * minimum(OMEGA / maximum(ENGINE_SPEED, 50.0), 2.0)
    return [Column(late, 0.7, "share")]


@dataclass(frozen=True)
class LastingLoad(Constants):
    """A share of `full` power (m^2/s^3) soaked in over `soak_s`."""

    soak_s: float
    full: float


@dataclass(frozen=True)
class Surroundings(Constants):
    by: Literal["elevation", "ambient_temperature"]


@dataclass(frozen=True)
class Throttled(Constants):
    """What throttles the flow (a filter, a leaking hose) costs the more, the more flows."""

    full: float  # m^2/s^3


def _derates(e: Evidence) -> Iterator[Simple]:
    pull = np.maximum(e["engine"], 0.0)
    full = quantile(e, pull * e["speed"], pull > 0.02, 0.95)
    for soak_s in (60.0, 200.0, 600.0):
        if np.isfinite(full):
            yield Static(LastingLoad(soak_s, full))
    if e.has("elevation"):
        yield Static(Surroundings("elevation"))
    if e.has("ambient_temperature"):
        yield Static(Surroundings("ambient_temperature"))
    yield from splines(e, -PULL, 0.5, quick=False)
    if np.isfinite(full):
        yield from splines(e, _throttled(full), 0.5, quick=False, constants=Throttled(full))


def _throttled(full: float) -> Expression:
    """Minus the pull, by the share of full power that is asked."""
    return -(PULL * minimum(PULL * SPEED / full, 1.5))


def _derate(v: Simple) -> list[Column]:
    match v.constants:
        case LastingLoad(soak_s, full):
            load = minimum(Lag((PULL * SPEED / full,), soak_s, cold=True), 1.5)
            return [Column(-(PULL * load), 0.3, "loss_at_full_load")]
        case Surroundings("elevation"):
            return [Column(-(PULL * maximum(Signal("elevation"), 0.0) / 1000.0), 0.15, "loss", "1/km")]
        case Surroundings():
            heat = maximum(Signal("ambient_temperature") - 25.0, 0.0) / 10.0
            return [Column(-(PULL * heat), 0.1, "loss", "1/K", 0.1)]
        case Throttled(full):
            return spline_columns(v, _throttled(full), "loss_at_full_power", "1", sign=1)
    return spline_columns(v, -PULL, "loss", "1", sign=1)


@dataclass(frozen=True)
class Top(Constants):
    """The largest torque (as a force at the gear ratio `reference`, rad/m), power or speed."""

    by: Literal["torque", "power", "speed"]
    top: float
    reference: float | None = None


def _limits(e: Evidence) -> Iterator[Static]:
    pull, speed = np.maximum(e["engine"], 0.0), e["speed"]
    reference = overall_ratio_reference(e)
    torque = pull * reference / np.maximum(e["ratio"], 0.05 * reference) if "ratio" in e.signals else pull
    gearing = reference if "ratio" in e.signals else None
    tops: tuple[tuple[Literal["torque", "power", "speed"], Array], ...]
    tops = (("torque", torque), ("power", pull * speed), ("speed", speed))
    for q in (0.6, 0.75, 0.85, 0.93, 0.97):
        for by, x in tops:
            top = quantile(e, x, (pull > 0.02) | (by == "speed"), q)
            if np.isfinite(top):
                yield Static(Top(by, top, gearing))


def _limit(v: Simple) -> list[Column]:
    over: Expression
    match v.constants:
        case Top("speed", top):
            over = PULL * minimum(maximum(SPEED - top, 0.0), 1.0)
        case Top("power", top):
            over = maximum(PULL - top / maximum(SPEED, 1.0), 0.0)
        case Top("torque", top, reference):
            over = maximum(PULL - OVERALL_RATIO / reference * top if reference else PULL - top, 0.0)
        case _:
            raise TypeError(f"{v!r} is no limit")
    return [Column(-over, 0.5, "share")]


@dataclass(frozen=True)
class Demanded(Constants):
    """Braking by a negative engine command, `full` at most."""

    full: float
    order: int
    geared: bool


@dataclass(frozen=True)
class Overrun(Constants):
    """Braking while the engine command is below `small`, from `after_s` later on. A torque that follows
    engine speed is told as a force at the gear ratio `reference` (rad/m)."""

    by: Literal["engine_speed", "speed", "nothing"]
    small: float
    after_s: float
    reference: float
    order: int = 1


@dataclass(frozen=True)
class Staged(Constants):
    """By hand, or by whatever else the simulator is not told, while the engine command is below `small`."""

    small: float


def _engine_brakes(e: Evidence) -> Iterator[Simple]:
    command = e["engine_command"][e.valid]
    small = 0.03 * float(np.nanmax(np.abs(command), initial=0.0))
    reference = overall_ratio_reference(e)
    if np.nanmin(command, initial=0.0) < 0:
        full = float(-np.nanmin(command))
        yield Static(Demanded(full, 0, geared=False))
        if e.has("ratio", "engine_speed"):
            yield from (Static(Demanded(full, order, geared=True)) for order in (0, 1, 2))
    for after_s in (0.0, 0.7):  # valves and vanes take a moment
        if e.has("ratio", "engine_speed"):
            yield from (Static(Overrun("engine_speed", small, after_s, reference, order)) for order in (1, 2))
        yield Static(Overrun("speed", small, after_s, reference))
        yield Static(Overrun("nothing", small, after_s, reference))
    yield from splines(e, -_coasting(small), 0.3, constants=Staged(small))


def _coasting(small: float) -> Expression:
    """One where the engine is asked for nothing and does not pull, else zero."""
    return (small + 1e-9 > ENGINE_COMMAND) * (ENGINE < 0.05)


def _engine_brake(v: Simple) -> list[Column]:
    match v.constants:
        case Demanded(full):
            asked = minimum(ENGINE_COMMAND, 0.0) / full
            return [Column(asked, 0.3, "force_at_full_demand", "N", per_mass=True)]
        case Staged(small):
            return spline_columns(v, -_coasting(small), "force", "N", sign=1, per_mass=True)
        case Overrun() as overrun:
            return _overrun(overrun)
    raise TypeError(f"{v!r} is no engine brake")


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
        "turbo_lag",
        "F = -(F_cmd - F_boost);  tau dF_boost/dt = F_cmd - F_boost while rising",
        "engine torque builds up later than commanded",
        ("engine",),
        ("rate of engine command",),
        "Rakopoulos and Giakoumis, Diesel Engine Transient Operation",
        "step the engine command up and down at constant speed",
        _turbos,
        _turbo,
        reported=0.8,
    ),
    Mechanism(
        "torque_derate",
        "F = -k L F_engine, L the load soaked in (or altitude, or outside heat, or power)",
        "the engine gives less than commanded under lasting load, height or heat",
        ("engine", "speed"),
        ("sustained load", "elevation", "ambient temperature"),
        "SAE J1349 correction; thermal derating practice",
        "hold full torque for several minutes, then repeat after idling",
        _derates,
        _derate,
        hidden=True,
        reported=0.7,
    ),
    Mechanism(
        "torque_limit",
        "F = -s max(F_engine - F_max, 0)",
        "a limiter or governor cuts the engine above a threshold",
        ("engine", "speed"),
        ("engine command", "speed"),
        "SAE J1939-71 torque and speed limits; ECE R89",
        "command full torque from low to top speed",
        _limits,
        _limit,
        reported=0.8,
    ),
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
        reported=0.2,
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
        hidden=True,
        prior=0.7,
    ),
)
