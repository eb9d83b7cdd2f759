"""Brakes: fade, lag and shoes that do not let go."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.expression import Lag, Rerun, RisingLag, Since, exp, lift, maximum, minimum
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.mechanisms.commands import FULL_RANGE_S
from deeptruck_model.mismatch.mechanisms.over_time import (
    MOST_KNOTS,
    each_recording,
    from_then_on,
    in_each,
    slow_columns,
    slow_settings,
    step_settings,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    BRAKE,
    DISTANCE,
    SPEED,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

HEAT_CAPACITY = 12.5  # J/kg/K: about 500 kg of drums at 500 J/kg/K under 20 t


def _fade_settings(e: Evidence) -> Iterator[Settings]:
    """Fade may set in at once, only above a temperature, or level off."""
    for cooling_s in (40.0, 120.0, 400.0, 1200.0):
        for form, at in (("from", 0.0), ("from", 1.0), ("from", 2.5), ("up_to", 0.7)):
            yield {"cooling_s": cooling_s, "form": form, "at": at}
    yield from slow_settings(e, BRAKE, 0.5)  # linings that fade once, or recover late


def _fade(s: Settings) -> list[Column]:
    if "knots" in s:
        return slow_columns(s, BRAKE, "loss", "1", sign=1)
    heat = Lag((BRAKE * SPEED,), s["cooling_s"], cold=True) * (s["cooling_s"] / HEAT_CAPACITY / 100.0)
    effect = minimum(heat, s["at"]) if s["form"] == "up_to" else maximum(minimum(heat, 6.0) - s["at"], 0.0)
    return [Column(BRAKE * effect, 0.3, "fade", "1/K", 0.01)]


def _lag_settings(e: Evidence) -> Iterator[Settings]:
    for side in ("lag", "rise", "fall", "delay"):  # both ways, only applying, only releasing, dead time
        for tau_s in (0.15, 0.3, 0.6, 1.0):
            yield {"side": side, "tau_s": tau_s}
    full = float(np.ptp(e["brake_command"][e.valid]))
    for side in ("rate", "climb"):  # air flows in, and out, through a throttle
        for full_s in FULL_RANGE_S if full > 0 else ():
            yield {"side": side, "rate": full / full_s}


def _lag(s: Settings) -> list[Column]:
    if "rate" in s:
        return [Column(Rerun(f"{s['side']}_brake", s["rate"]), 0.3, "share", mean=1.0)]
    return [Column(Rerun(f"{s['side']}_brake", s["tau_s"]), 0.3, "time_constant", "s", s["tau_s"], mean=1.0)]


def _dragging_settings(e: Evidence) -> Iterator[Settings]:
    threshold = max(0.05, 0.05 * float(np.nanmax(e["brake"])))
    yield {"decay_s": None}
    for decay_s in (5.0, 20.0, 80.0):
        yield {"decay_s": decay_s, "braking": threshold}
    for keeps_s in (3.0, 10.0, 30.0, 100.0):  # of its last force: a weak spring
        yield {"keeps_s": keeps_s}
    for at in step_settings(e):
        yield {"decay_s": None} | at
    for frees_m in (200.0, 700.0, 2000.0):  # frozen, parked with, or out of adjustment until they have rubbed
        yield {"frees_m": frees_m}
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield {"frees_m": frees_m} | each_recording(e)
    yield from slow_settings(e, lift(-1.0), 0.1)


def _dragging(s: Settings) -> list[Column]:
    if "knots" in s:
        return slow_columns(s, lift(-1.0), "force", "N", sign=1, per_mass=True)
    if "first" in s:
        return [Column(-from_then_on(s), 0.08, "force", "N", per_mass=True)]
    if "frees_m" in s:
        left = exp(-(DISTANCE / s["frees_m"]))
        each = in_each(s) if "each" in s else [("", lift(1.0))]
        return [
            Column(-(left * here), 0.1, f"force[{name}]" if name else "force", "N", per_mass=True)
            for name, here in each
        ]
    if "keeps_s" in s:  # a lag that rises at once and falls late
        return [Column(RisingLag((-BRAKE,), s["keeps_s"]), 0.1, "share")]
    if s["decay_s"] is None:
        return [Column(lift(-1.0), 0.08, "force", "N", per_mass=True)]
    braking = s["braking"] < BRAKE
    left = exp(-Since((braking,)) / s["decay_s"]) * (1.0 - braking)
    return [Column(-left, 0.15, "force", "N", per_mass=True)]


MECHANISMS = (
    Mechanism(
        "brake_fade",
        "F = +F_brake (k dT + k2 dT^2);  C d(dT)/dt = F_brake v - (C/tau) dT",
        "the brakes lose force as they heat",
        ("brake", "brake_command"),
        ("brake", "speed", "time since braking"),
        "Limpert, Brake Design and Safety, ch. 4; heat balance of a drum",
        "repeat a stop of the same pressure cold and after a long descent",
        _fade_settings,
        _fade,
        hidden=True,
    ),
    Mechanism(
        "brake_lag",
        "tau dF/dt = F_cmd - F, or |dF/dt| <= r",
        "brake force follows its command late",
        ("brake", "brake_command"),
        ("brake command rate",),
        "air brake actuation 0.2-0.6 s, FMVSS 121 S5.3.3 and S5.3.4",
        "apply and release the brake in steps with the engine at idle",
        _lag_settings,
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
        _dragging_settings,
        _dragging,
        hidden=True,
        prior=0.7,
    ),
)
