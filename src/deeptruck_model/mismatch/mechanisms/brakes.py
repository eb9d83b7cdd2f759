"""Brakes: fade, lag and shoes that do not let go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from deeptruck_model.mismatch.expression import Lag, Rerun, RisingLag, Since, exp, lift, maximum, minimum
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
)
from deeptruck_model.mismatch.mechanisms.commands import FULL_RANGE_S
from deeptruck_model.mismatch.mechanisms.over_time import (
    MOST_KNOTS,
    each_recording,
    from_then_on,
    in_each,
    moments,
    spline_columns,
    splines,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    BRAKE,
    DISTANCE,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import (
    NONE,
    Constants,
    FromMoment,
    PerRecording,
    Simple,
    Spline,
    Static,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

HEAT_CAPACITY = 12.5  # J/kg/K: about 500 kg of drums at 500 J/kg/K under 20 t


@dataclass(frozen=True)
class Heating(Constants):
    """Fade with the heat soaked in: `from` a heat `at` on, or `up_to` it."""

    cooling_s: float
    form: Literal["from", "up_to"]
    at: float


def _fades(e: Evidence) -> Iterator[Simple]:
    """Fade may set in at once, only above a temperature, or level off."""
    forms: tuple[tuple[Literal["from", "up_to"], float], ...]
    forms = (("from", 0.0), ("from", 1.0), ("from", 2.5), ("up_to", 0.7))
    for cooling_s in (40.0, 120.0, 400.0, 1200.0):
        yield from (Static(Heating(cooling_s, form, at)) for form, at in forms)
    yield from splines(e, BRAKE, 0.5)  # linings that fade once, or recover late


def _fade(v: Simple) -> list[Column]:
    match v.constants:
        case Heating(cooling_s, form, at):
            heat = Lag((BRAKE * SPEED,), cooling_s, cold=True) * (cooling_s / HEAT_CAPACITY / 100.0)
            effect = minimum(heat, at) if form == "up_to" else maximum(minimum(heat, 6.0) - at, 0.0)
            return [Column(BRAKE * effect, 0.3, "fade", "1/K", 0.01)]
    return spline_columns(v, BRAKE, "loss", "1", sign=1)


DEAD_TIME: Literal["delay"] = "delay"  # the same force as a delay of the brake command


@dataclass(frozen=True)
class BrakeLag(Constants):
    """Both ways, only applying, only releasing, or dead time."""

    side: Literal["lag", "rise", "fall", "delay"]
    tau_s: float


@dataclass(frozen=True)
class BrakeRate(Constants):
    """Air that flows in, and out, through a throttle."""

    side: Literal["rate", "climb"]
    rate: float  # of the brake command, per s


def _lags(e: Evidence) -> Iterator[Static]:
    sides: tuple[Literal["lag", "rise", "fall", "delay"], ...] = ("lag", "rise", "fall", DEAD_TIME)
    for side in sides:
        yield from (Static(BrakeLag(side, tau_s)) for tau_s in (0.15, 0.3, 0.6, 1.0))
    full = float(np.ptp(e["brake_command"][e.valid]))
    ways: tuple[Literal["rate", "climb"], ...] = ("rate", "climb")
    for way in ways:
        yield from (Static(BrakeRate(way, full / full_s)) for full_s in FULL_RANGE_S if full > 0)


def _lag(v: Simple) -> list[Column]:
    match v.constants:
        case BrakeRate(side, rate):
            return [Column(Rerun(f"{side}_brake", rate), 0.3, "share_of_brake_force", mean=1.0)]
        case BrakeLag(side, tau_s):
            return [Column(Rerun(f"{side}_brake", tau_s), 0.3, "time_constant", "s", tau_s, mean=1.0)]
    raise TypeError(f"{v!r} is no lag of a brake")


@dataclass(frozen=True)
class LetsGo(Constants):
    """Rubs for a while after braking harder than `braking` (m/s^2)."""

    decay_s: float
    braking: float


@dataclass(frozen=True)
class Keeps(Constants):
    """Keeps of its last force for a while: a weak spring. It presses harder than the simulator's brakes too,
    or only comes off late, and then adds nothing `while_braking`."""

    keeps_s: float
    while_braking: bool = True


@dataclass(frozen=True)
class RubsFree(Constants):
    """Frozen, parked with, or out of adjustment until it has rubbed."""

    frees_m: float


def _draggings(e: Evidence) -> Iterator[Simple]:
    threshold = max(0.05, 0.05 * float(np.nanmax(e["brake"])))
    yield Static()
    for decay_s in (5.0, 20.0, 80.0):
        yield Static(LetsGo(decay_s, threshold))
    for keeps_s in (3.0, 10.0, 30.0, 100.0):
        yield Static(Keeps(keeps_s))
        yield Static(Keeps(keeps_s, while_braking=False))
    yield from moments(e)
    for frees_m in (200.0, 700.0, 2000.0):
        yield Static(RubsFree(frees_m))
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield each_recording(e, RubsFree(frees_m))
    yield from splines(e, lift(-1.0), 0.1)


def _dragging(v: Simple) -> list[Column]:
    match v:
        case Spline():
            return spline_columns(v, lift(-1.0), "force", "N", sign=1, per_mass=True)
        case FromMoment():
            return [Column(-from_then_on(v), 0.08, "force", "N", per_mass=True)]
        case PerRecording(constants=RubsFree(frees_m)):
            left = exp(-(DISTANCE / frees_m))
            return [
                Column(-(left * here), 0.1, f"force[{name}]", "N", per_mass=True) for name, here in in_each(v)
            ]
    return [_always_dragging(v.constants)]


def _always_dragging(how: Constants) -> Column:
    match how:
        case RubsFree(frees_m):
            return Column(-exp(-(DISTANCE / frees_m)), 0.1, "force", "N", per_mass=True)
        case Keeps(keeps_s, while_braking):  # a lag that rises at once and falls late
            held = RisingLag((-BRAKE,), keeps_s)
            return Column(held if while_braking else held + BRAKE, 0.1, "share_of_brake_force")
        case LetsGo(decay_s, threshold):
            braking = threshold < BRAKE
            left = exp(-Since((braking,)) / decay_s) * (1.0 - braking)
            return Column(-left, 0.15, "force", "N", per_mass=True)
    if how != NONE:
        raise TypeError(f"{how!r} drags no brake")
    return Column(lift(-1.0), 0.08, "force", "N", per_mass=True)


MECHANISMS = (
    Mechanism(
        "brake_fade",
        "F = +F_brake (k dT + k2 dT^2);  C d(dT)/dt = F_brake v - (C/tau) dT",
        "the brakes lose force as they heat",
        ("brake", "brake_command"),
        ("brake", "speed", "time since braking"),
        "Limpert, Brake Design and Safety, ch. 4; heat balance of a drum",
        "repeat a stop of the same pressure cold and after a long descent",
        _fades,
        _fade,
    ),
    Mechanism(
        "brake_lag",
        "tau dF/dt = F_cmd - F, or |dF/dt| <= r",
        "brake force follows its command late",
        ("brake", "brake_command"),
        ("brake command rate",),
        "air brake actuation 0.2-0.6 s, FMVSS 121 S5.3.3 and S5.3.4",
        "apply and release the brake in steps with the engine at idle",
        _lags,
        _lag,
    ),
    Mechanism(
        "dragging_brake",
        "F = -F0 (while moving), or -(F0 or k F_brake) exp(-t_since_release / tau), or -F0 exp(-x / L)",
        "a brake keeps rubbing when it should be free",
        ("brake", "brake_command"),
        ("time since braking",),
        "residual brake drag: Limpert, Brake Design and Safety",
        "coast down before and after braking",
        _draggings,
        _dragging,
        prior=0.7,
    ),
)
