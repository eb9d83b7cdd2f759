"""Engine: torque that is late, or less than was asked for."""

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
    spline_columns,
    splines,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    ENGINE_SPEED,
    OMEGA,
    OVERALL_RATIO,
    PULL,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, Simple, Static
from deeptruck_model.mismatch.residual.evidence import Evidence


@dataclass(frozen=True)
class Boost(Constants):
    """Torque above what the engine gives without boost comes late. Torques are reported as forces at the gear
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
    return [Column(late, 0.7, "share_of_boosted_pull")]


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
    """The largest torque (as a force at the gear ratio `reference`, rad/m), power, speed, or command in its
    own unit."""

    by: Literal["torque", "power", "speed", "command"]
    top: float
    reference: float | None = None

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Where it begins, as a torque of the engine where gears are known."""
        if self.by == "torque":
            yield (
                ("limit_force", self.top)
                if self.reference is None
                else (
                    "limit_torque",
                    self.top / self.reference,
                )
            )
        else:
            yield f"limit_{self.by}", self.top


LIMITS = (0.35, 0.5, 0.65, 0.75, 0.85, 0.93)  # of the largest: full throttle is held for long


def _limits(e: Evidence) -> Iterator[Static]:
    pull, speed = np.maximum(e["engine"], 0.0), e["speed"]
    reference = overall_ratio_reference(e) if "ratio" in e.signals else None
    torque = pull * reference / np.maximum(e["ratio"], 0.05 * reference) if reference else pull
    limited: list[tuple[Literal["torque", "power", "command"], Array]]
    limited = [("torque", torque), ("power", pull * speed)]
    if reference is None and e.has("engine_command"):  # a torque that no gear ratio gives
        limited.append(("command", e["engine_command"]))
    for by, x in limited:
        most = quantile(e, x, pull > 0.02, 0.98)
        for share in LIMITS if 0.0 < most < np.inf else ():
            yield Static(Top(by, share * most, reference))
    for q in (0.6, 0.75, 0.85, 0.93, 0.97):
        top = quantile(e, speed, np.ones(len(e), dtype=bool), q)
        if np.isfinite(top):
            yield Static(Top("speed", top, reference))


def _limit(v: Simple) -> list[Column]:
    over: Expression
    match v.constants:
        case Top("speed", top):
            over = PULL * minimum(maximum(SPEED - top, 0.0), 1.0)
        case Top("power", top):
            over = maximum(PULL - top / maximum(SPEED, 1.0), 0.0)
        case Top("command", top):
            command = maximum(Signal("engine_command"), top)
            over = PULL * (1.0 - top / command)
        case Top("torque", top, reference):
            over = maximum(PULL - OVERALL_RATIO / reference * top if reference else PULL - top, 0.0)
        case _:
            raise TypeError(f"{v!r} is no limit")
    return [Column(-over, 0.5, "share_of_what_is_beyond")]


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
    ),
)
