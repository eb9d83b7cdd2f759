"""Driveline: losses, shifts, converter, slip, inertia and play."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

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
    Settings,
    lever_reference,
    quantile,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    slow_columns,
    slow_settings,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    BRAKE,
    ENGINE,
    ENGINE_SPEED,
    GEAR,
    LEVER,
    OMEGA,
    PULL,
    RATIO,
    SIMULATED,
    SPEED,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

LEAST_GRIP = 0.35  # m/s^2: ice, 0.1, under the driven axle of a truck, 0.35 of its weight


def _loss_settings(e: Evidence) -> Iterator[Settings]:
    yield {"by": "torque"}
    if e.has("gear"):
        gears = np.round(np.nan_to_num(e["gear"]))
        used = [float(g) for g in np.unique(gears) if g > 0 and (gears[e.valid] == g).mean() > 0.03]
        if 1 < len(used) <= 16:
            yield {"by": "gear", "gears": used}
    if e.has("ratio"):
        yield {"by": "ratio", "reference": lever_reference(e)}
    if e.has("ratio", "engine_speed"):
        yield {"by": "input", "reference": lever_reference(e)}


def _loss(s: Settings) -> list[Column]:
    if s["by"] == "torque":
        return [Column(-absolute(ENGINE), 0.15, "share")]
    if s["by"] == "gear":
        return [Column(-(PULL * (absolute(GEAR - g) < 0.5)), 0.1, f"share_gear_{g:.0f}") for g in s["gears"]]
    if s["by"] == "input":  # as regulation 2017/2400, annex VI, has it: drag at the input shaft, and a share
        drag = -(LEVER / s["reference"])
        return [
            Column(drag, 0.05, "drag", "N", per_mass=True),
            Column(drag * (ENGINE_SPEED / OMEGA), 0.05, "drag_per_speed", "N", per_mass=True),
            Column(-PULL, 0.1, "share"),
        ]
    return [Column(-(PULL * maximum(LEVER / s["reference"] - 1.0, 0.0)), 0.1, "share_per_ratio")]


def _shift_settings(e: Evidence) -> Iterator[Settings]:
    gear = np.round(np.nan_to_num(e["gear"]))
    if ((np.abs(np.diff(gear)) > 0) & e.valid[1:]).sum() < 3:
        return
    for window_s in (0.4, 0.8, 1.4, 2.2):
        yield {"window_s": window_s}
    yield {"until_s": [0.3, 0.6, 1.0, 1.5, 2.2]}


def _shift(s: Settings) -> list[Column]:
    """A share of the pull missing throughout a window, or as much as each part of it tells."""
    since = Since((absolute(Change((GEAR,))) > 0.5,))
    force = maximum(Lag((PULL,), 1.5), PULL)
    if "window_s" in s:
        return [Column(-(force * (since < s["window_s"])), 0.6, "share")]
    return [
        Column(-(force * _between(since, first, last)), 0.6, f"share_{first:g}_to_{last:g}_s")
        for first, last in itertools.pairwise([0.0, *s["until_s"]])
    ]


def _between(since: Expression, first: float, last: float) -> Expression:
    return (since < last) * (1.0 - (since < first))


def _converter_settings(e: Evidence) -> Iterator[Settings]:
    """By speed, or by how much faster the engine turns than it would with the converter locked."""
    for scale_m_s in (2.0, 4.0, 8.0):
        yield {"scale_m_s": scale_m_s}
    if e.has("ratio", "gear"):
        ratio, gear = e["ratio"], np.round(np.nan_to_num(e["gear"]))
        locked = {
            g: quantile(e, ratio, (gear == g) & (e["speed"] > 1.0), 0.1)
            for g in np.unique(gear[e.valid]).tolist()
            if g > 0
        }
        yield {"locked": {f"{g:.0f}": r for g, r in locked.items() if np.isfinite(r)}}


def _converter(s: Settings) -> list[Column]:
    if "locked" in s:
        own = sum(((absolute(GEAR - float(g)) < 0.5) * r for g, r in s["locked"].items()), lift(0.0))
        slip = maximum(1.0 - own / maximum(RATIO, 0.01), 0.0)
        return [Column(-(PULL * slip), 1.0, "share_per_slip", sign=0)]
    return [Column(-(PULL * exp(-(SPEED / s["scale_m_s"]))), 0.5, "share", sign=0)]


def _slip_settings(e: Evidence) -> Iterator[Settings]:
    for q in (0.8, 0.92, 0.97):
        pull = max(quantile(e, e["engine"], e["engine"] > 0.05, q), LEAST_GRIP)
        brake = quantile(e, e["brake"], e["brake"] > 0.1, q)
        if np.isfinite(pull) or np.isfinite(brake):
            yield {"pull": pull if np.isfinite(pull) else 1e3, "brake": brake if np.isfinite(brake) else 1e3}
    grip = max(quantile(e, e["engine"], e["engine"] > 0.05, 0.6), LEAST_GRIP)
    if np.isfinite(grip):  # the road is slippery here and there
        yield from ({**slow, "pull": grip} for slow in slow_settings(e, _beyond(grip), 1.0, quick=False))


def _beyond(grip: float) -> Expression:
    return -maximum(PULL - grip, 0.0)


def _slip(s: Settings) -> list[Column]:
    if "knots" in s:
        return slow_columns(s, _beyond(s["pull"]), "traction_share", "1", sign=1, steady=False)
    return [
        Column(-maximum(PULL - s["pull"], 0.0), 0.5, "traction_share"),
        Column(maximum(BRAKE - s["brake"], 0.0), 0.5, "brake_share"),
    ]


def _inertia_settings(e: Evidence) -> Iterator[Settings]:
    for share in (0.001, 0.002, 0.004, 0.008, 0.016, 0.03, 0.06, 0.12):
        yield {"reference": lever_reference(e), "share": share}


def _inertia(s: Settings) -> list[Column]:
    """F = -J r^2 a with a the acceleration that is left: -a0 x / (1 + x), x the share of the mass."""
    lever = minimum(LEVER / s["reference"], 20.0)  # first gear over top gear; beyond, the clutch slips
    share = (lever**2) * s["share"]
    return [Column(-(SIMULATED * (share / (share + 1.0))), 0.3, "share_of_mass", "1", s["share"], mean=1.0)]


def _backlash_settings(e: Evidence) -> Iterator[Settings]:
    size = quantile(e, np.abs(e["engine"]), np.abs(e["engine"]) > 0.0, 0.8)
    for window_s in (0.3, 0.7, 1.2):
        if np.isfinite(size):
            yield {"window_s": window_s, "size": max(size, 0.05)}
        yield {"window_s": window_s, "size": None}
    yield {"until_s": [0.3, 0.7, 1.2, 2.0]}  # several plays, one after the other
    if np.isfinite(size):
        reference = lever_reference(e) if "ratio" in e.signals else None
        strong = max(size, 0.05)
        for turns_s in (0.15, 0.3, 0.6, 1.2):  # by a strong pull
            for soft in (0.0, 0.3):  # what a soft spring in it holds of that
                yield {"reach": strong * turns_s, "holds": strong * soft, "reference": reference}


def _backlash(s: Settings) -> list[Column]:
    if "reach" in s:
        lever = LEVER / s["reference"] if s["reference"] else lift(1.0)
        play = Play((ENGINE / maximum(lever, 0.05),), s["reach"], s["holds"])
        return [Column(-(play * lever), 0.5, "share")]
    change = Change((ENGINE > 0.03,))
    since = {"tip_in": Since((change > 0.1,)), "tip_out": Since((change < -0.1,))}
    if "until_s" in s:
        return [
            Column(-(ENGINE * _between(t, first, last)), 0.6, f"{side}_share_{first:g}_to_{last:g}_s")
            for side, t in since.items()
            for first, last in itertools.pairwise([0.0, *s["until_s"]])
        ]
    up, down = since["tip_in"] < s["window_s"], since["tip_out"] < s["window_s"]
    if s["size"] is None:
        return [Column(-(up * ENGINE), 0.6, "tip_in_share"), Column(-(down * ENGINE), 0.6, "tip_out_share")]
    return [Column(-(up * s["size"]), 0.5, "tip_in"), Column(down * s["size"], 0.5, "tip_out")]


MECHANISMS = (
    Mechanism(
        "driveline_loss",
        "F = -k |F_engine|, or k by gear; F = -r (c0 + c1 w) - k F_engine",
        "the driveline loses a share of the torque it carries",
        ("engine",),
        ("engine torque", "gear"),
        "gear mesh efficiency: SAE J1266; Regulation (EU) 2017/2400, annex VI",
        "pull with the same torque in different gears, and coast in gear",
        _loss_settings,
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
        _shift_settings,
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
        _converter_settings,
        _converter,
    ),
    Mechanism(
        "wheel_slip",
        "F = -s max(F_engine - mu N, 0), likewise when braking",
        "tyres slip above a force",
        ("engine", "speed", "brake"),
        ("traction force", "brake"),
        "Pacejka, Tyre and Vehicle Dynamics, ch. 1",
        "full torque and full brake at low speed on the same surface",
        _slip_settings,
        _slip,
        prior=0.2,
    ),
    Mechanism(
        "rotating_inertia",
        "F = -J r^2 a",
        "rotating parts take a share of the acceleration, most in low gears",
        ("ratio", "simulated"),
        ("gear", "acceleration"),
        "Gillespie, Fundamentals of Vehicle Dynamics, eq. 2-9b",
        "accelerate with the same torque in a low and a high gear",
        _inertia_settings,
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
        _backlash_settings,
        _backlash,
        prior=0.7,
    ),
)
