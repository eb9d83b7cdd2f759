"""Driveline: losses, shifts, converter, inertia and play."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from deeptruck_model.mismatch.expression import (
    Change,
    Expression,
    Lag,
    Play,
    Since,
    absolute,
    exp,
    lift,
    maximum,
    minimum,
)
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    overall_ratio_reference,
    quantile,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    ENGINE,
    ENGINE_SPEED,
    GEAR,
    OMEGA,
    OVERALL_RATIO,
    PULL,
    RATIO,
    SIMULATED,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, Simple, Static
from deeptruck_model.mismatch.residual.evidence import Evidence


@dataclass(frozen=True)
class LossByGear(Constants):
    gears: tuple[float, ...]


@dataclass(frozen=True)
class LossByRatio(Constants):
    """By the gear ratio over `reference` (rad/m), or drag at the input shaft and a share of the pull, as
    regulation 2017/2400, annex VI, has it."""

    by: Literal["ratio", "input"]
    reference: float


def _losses(e: Evidence) -> Iterator[Static]:
    yield Static()
    if e.has("gear"):
        gears = np.round(np.nan_to_num(e["gear"]))
        used = [float(g) for g in np.unique(gears) if g > 0 and (gears[e.valid] == g).mean() > 0.03]
        if 1 < len(used) <= 16:
            yield Static(LossByGear(tuple(used)))
    if e.has("ratio"):
        yield Static(LossByRatio("ratio", overall_ratio_reference(e)))
    if e.has("ratio", "engine_speed"):
        yield Static(LossByRatio("input", overall_ratio_reference(e)))


def _loss(v: Simple) -> list[Column]:
    match v.constants:
        case LossByGear(gears):
            return [Column(-(PULL * (absolute(GEAR - g) < 0.5)), 0.1, f"share_gear_{g:.0f}") for g in gears]
        case LossByRatio("input", reference):
            drag = -(OVERALL_RATIO / reference)
            return [
                Column(drag, 0.05, "drag", "N", per_mass=True),
                Column(drag * (ENGINE_SPEED / OMEGA), 0.05, "drag_per_speed", "N", per_mass=True),
                Column(-PULL, 0.1, "share_of_pull"),
            ]
        case LossByRatio("ratio", reference):
            return [Column(-(PULL * maximum(OVERALL_RATIO / reference - 1.0, 0.0)), 0.1, "share_per_ratio")]
    return [Column(-absolute(ENGINE), 0.15, "share_of_engine_force")]


@dataclass(frozen=True)
class Window(Constants):
    """One share throughout a time after the event."""

    window_s: float


@dataclass(frozen=True)
class Stages(Constants):
    """A share for each part of the time after the event, by the ends of the parts."""

    until_s: tuple[float, ...]


def _shifts(e: Evidence) -> Iterator[Static]:
    gear = np.round(np.nan_to_num(e["gear"]))
    if ((np.abs(np.diff(gear)) > 0) & e.valid[1:]).sum() < 3:
        return
    for window_s in (0.4, 0.8, 1.4, 2.2):
        yield Static(Window(window_s))
    yield Static(Stages((0.3, 0.6, 1.0, 1.5, 2.2)))


def _shift(v: Simple) -> list[Column]:
    """A share of the pull missing throughout a window, or in each part of it separately."""
    since = Since((absolute(Change((GEAR,))) > 0.5,))
    force = maximum(Lag((PULL,), 1.5), PULL)
    match v.constants:
        case Window(window_s):
            return [Column(-(force * (since < window_s)), 0.6, "share_of_pull")]
        case Stages(until_s):
            return [
                Column(-(force * _between(since, first, last)), 0.6, f"share_{first:g}_to_{last:g}_s")
                for first, last in itertools.pairwise((0.0, *until_s))
            ]
    raise TypeError(f"{v!r} is no shift")


def _between(since: Expression, first: float, last: float) -> Expression:
    return (since < last) * (1.0 - (since < first))


@dataclass(frozen=True)
class SlipBySpeed(Constants):
    scale_m_s: float


@dataclass(frozen=True)
class SlipByRatio(Constants):
    """Gears, and the ratio (rad/m) of each with the converter locked."""

    locked: tuple[tuple[float, float], ...]


def _converters(e: Evidence) -> Iterator[Static]:
    """By speed, or by how much faster the engine turns than it would with the converter locked."""
    for scale_m_s in (2.0, 4.0, 8.0):
        yield Static(SlipBySpeed(scale_m_s))
    if e.has("ratio", "gear"):
        ratio, gear = e["ratio"], np.round(np.nan_to_num(e["gear"]))
        locked = {
            g: quantile(e, ratio, (gear == g) & (e["speed"] > 1.0), 0.1)
            for g in np.unique(gear[e.valid]).tolist()
            if g > 0
        }
        yield Static(SlipByRatio(tuple((float(g), r) for g, r in locked.items() if np.isfinite(r))))


def _converter(v: Simple) -> list[Column]:
    match v.constants:
        case SlipByRatio(locked):
            own = sum(((absolute(GEAR - g) < 0.5) * r for g, r in locked), lift(0.0))
            slip = maximum(1.0 - own / maximum(RATIO, 0.01), 0.0)
            return [Column(-(PULL * slip), 1.0, "share_per_slip", sign=0)]
        case SlipBySpeed(scale_m_s):
            return [Column(-(PULL * exp(-(SPEED / scale_m_s))), 0.5, "share", sign=0)]
    raise TypeError(f"{v!r} is no slip of a converter")


@dataclass(frozen=True)
class Turning(Constants):
    """A share of the mass at the gear ratio `reference` (rad/m)."""

    reference: float
    share: float


def _inertias(e: Evidence) -> Iterator[Static]:
    for share in (0.001, 0.002, 0.004, 0.008, 0.016, 0.03, 0.06, 0.12):
        yield Static(Turning(overall_ratio_reference(e), share))


def _inertia(v: Simple) -> list[Column]:
    """F = -J r^2 a with a the acceleration that is left: -a0 x / (1 + x), x the share of the mass."""
    if not isinstance(v.constants, Turning):
        raise TypeError(f"{v!r} is no inertia")
    reference, part = v.constants.reference, v.constants.share
    # first gear over top gear; beyond, the clutch slips
    overall_ratio = minimum(OVERALL_RATIO / reference, 20.0)
    share = (overall_ratio**2) * part
    return [Column(-(SIMULATED * (share / (share + 1.0))), 0.3, "share_of_mass", "1", part, mean=1.0)]


@dataclass(frozen=True)
class TipIn(Constants):
    """A force of `size` (m/s^2), or a share of the engine's, that is missing for a while after each change of
    sign."""

    window_s: float
    size: float | None = None


@dataclass(frozen=True)
class PlayTaken(Constants):
    """A play by the force times s that takes it up, and the force a soft spring in it holds; both at the gear
    ratio `reference` (rad/m), where gears are known."""

    reach: float
    holds: float
    reference: float | None = None


def _backlashes(e: Evidence) -> Iterator[Static]:
    size = quantile(e, np.abs(e["engine"]), np.abs(e["engine"]) > 0.0, 0.8)
    strong = max(size, 0.05)
    for window_s in (0.3, 0.7, 1.2):
        if np.isfinite(size):
            yield Static(TipIn(window_s, strong))
        yield Static(TipIn(window_s))
    yield Static(Stages((0.3, 0.7, 1.2, 2.0)))  # several plays, one after the other
    if np.isfinite(size):
        reference = overall_ratio_reference(e) if "ratio" in e.signals else None
        for turns_s in (0.15, 0.3, 0.6, 1.2):  # by a strong pull
            for soft in (0.0, 0.3):  # what a soft spring in it holds of that
                yield Static(PlayTaken(strong * turns_s, strong * soft, reference))


def _backlash(v: Simple) -> list[Column]:
    change = Change((ENGINE > 0.03,))
    tip_in, tip_out = Since((change > 0.1,)), Since((change < -0.1,))
    match v.constants:
        case PlayTaken(reach, holds, reference):
            overall_ratio = OVERALL_RATIO / reference if reference else lift(1.0)
            play = Play((ENGINE / maximum(overall_ratio, 0.05),), reach, holds)
            return [Column(-(play * overall_ratio), 0.5, "share")]
        case Stages(until_s):
            return [
                Column(-(ENGINE * _between(t, first, last)), 0.6, f"{side}_share_{first:g}_to_{last:g}_s")
                for side, t in (("tip_in", tip_in), ("tip_out", tip_out))
                for first, last in itertools.pairwise((0.0, *until_s))
            ]
        case TipIn(window_s, None):
            up, down = -((tip_in < window_s) * ENGINE), -((tip_out < window_s) * ENGINE)
            return [Column(up, 0.6, "tip_in_share"), Column(down, 0.6, "tip_out_share")]
        case TipIn(window_s, float(size)):
            up, down = -((tip_in < window_s) * size), (tip_out < window_s) * size
            return [Column(up, 0.5, "tip_in"), Column(down, 0.5, "tip_out")]
    raise TypeError(f"{v!r} is no backlash")


MECHANISMS = (
    Mechanism(
        "driveline_loss",
        "F = -k |F_engine|, or k by gear; F = -r (c0 + c1 w) - k F_engine",
        "the driveline loses a share of the torque it carries",
        ("engine",),
        ("engine torque", "gear"),
        "gear mesh efficiency: SAE J1266; Regulation (EU) 2017/2400, annex VI",
        "pull with the same torque in different gears, and coast in gear",
        _losses,
        _loss,
    ),
    Mechanism(
        "shift_interruption",
        "F = -s F_engine for a while after a gear change",
        "traction is missing around gear changes",
        ("gear", "engine"),
        ("time since gear change",),
        "automated manual transmissions: torque gap of 0.5-1.5 s",
        "accelerate through all gears at full torque",
        _shifts,
        _shift,
    ),
    Mechanism(
        "torque_converter_slip",
        "F = -s F_engine exp(-v / v0)",
        "the torque converter multiplies or loses torque at low speed",
        ("engine", "speed"),
        ("speed", "engine torque"),
        "SAE J643 converter characteristics",
        "launch at several torques with the converter locked and unlocked",
        _converters,
        _converter,
    ),
    Mechanism(
        "rotating_inertia",
        "F = -J r^2 a",
        "rotating parts take a share of the acceleration, most in low gears",
        ("ratio", "simulated"),
        ("gear", "acceleration"),
        "Gillespie, Fundamentals of Vehicle Dynamics, eq. 2-9b",
        "accelerate with the same torque in a low and a high gear",
        _inertias,
        _inertia,
    ),
    Mechanism(
        "driveline_backlash",
        "torque is carried only after the play is taken up, at each change between drive and overrun",
        "the driveline has play when torque changes sign",
        ("engine",),
        ("sign of engine torque",),
        "Lagerberg and Egardt, Backlash estimation with application to automotive powertrains, 2007",
        "tip in and out around zero torque in a high gear",
        _backlashes,
        _backlash,
        prior=0.7,
    ),
)
