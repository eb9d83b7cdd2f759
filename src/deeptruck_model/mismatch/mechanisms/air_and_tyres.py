"""Air and tyres: wind, drafting, rolling resistance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.expression import Expression, InRecording, Signal, absolute, exp, maximum
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
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
    DISTANCE,
    DRAG,
    ELAPSED,
    SPEED,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

AROUND_M_S = (0.0, 6.0, -6.0)
NOBODY_M = 1e4  # a gap behind nobody
STEADY_M_S, GUST_M_S = 7.0, 5.0  # prior sd of a drive's mean wind, and the largest of its slow changes
# Most by which the wind along the road departs from the drive's mean for half a minute: Beaufort 6 that falls
# calm, or is met round a bend. What swings further is slopes or brakes under another name.
SWING_M_S = 12.0
SIDE = 0.4  # sd of the drag that wind from the side adds, SAE J1252: 5 to 10 % a degree of yaw
PER_SQUARE = DRAG / maximum(SPEED, 1.0) ** 2


def _headwind_settings(e: Evidence) -> Iterator[Settings]:
    """One wind throughout, one for each recording, or a slowly turning one; linear around calm or around a
    wind. What blows from the side acts as more drag area."""
    for wind in (-12.0, -8.0, -4.0, 4.0, 8.0, 12.0):
        yield {"wind_m_s": wind}
    names = [s.name for s in e.stretches]
    for around in AROUND_M_S:
        if 1 < len(names) <= MOST_KNOTS:
            yield {"recordings": names, "around_m_s": around}
    for around in AROUND_M_S:
        for slow in slow_settings(e, _per_wind(around), GUST_M_S):
            yield slow | {"recordings": names, "around_m_s": around}
    for slow in slow_settings(e, -DRAG, SIDE):
        yield slow | {"recordings": names, "around_m_s": 0.0, "side": True}


def _per_wind(around_m_s: float) -> Expression:
    """The force of 1 m/s more wind than that, m/s^2."""
    return -(PER_SQUARE * (SPEED * 2.0 + around_m_s))


def _headwind(s: Settings) -> list[Column]:
    if "wind_m_s" in s:
        air = SPEED + s["wind_m_s"]
        change = air * absolute(air) - SPEED**2
        return [Column(-(PER_SQUARE * change), 0.3, "wind", "m/s", s["wind_m_s"], mean=1.0)]
    linear = _per_wind(s["around_m_s"])
    names = s["recordings"]
    mean = 1.0 / len(names)  # in a simulation blows the mean of the recorded winds
    steady = [
        Column(linear * InRecording(i, elsewhere=mean), STEADY_M_S, f"wind[{name}]", "m/s", sign=0)
        for i, name in enumerate(names)
    ]
    if "side" in s:
        return steady + slow_columns(s, -DRAG, "more_drag", "1", sign=1, steady=False)
    if "knots" not in s:
        return steady
    return steady + slow_columns(s, linear, "wind", "m/s", sign=0, steady=False, most=SWING_M_S)


def _drafting_settings(e: Evidence) -> Iterator[Settings]:
    """A simulation without a vehicle ahead follows at the gap that was recorded."""
    gap = e["gap"][e.valid]
    usual = float(np.nanmedian(gap)) if np.isfinite(gap).any() else NOBODY_M
    for length_m in (8.0, 20.0, 50.0):
        yield {"length_m": length_m, "usual_m": usual}
        if 1 < len(e.stretches) <= MOST_KNOTS:  # behind another vehicle on every drive
            yield {"length_m": length_m, "usual_m": usual} | each_recording(e)


def _drafting(s: Settings) -> list[Column]:
    near = exp(-(Signal("gap", missing=NOBODY_M, simulated=s.get("usual_m", NOBODY_M)) / s["length_m"]))
    if "each" in s:
        return [Column(DRAG * near * here, 0.4, f"share_of_drag[{name}]") for name, here in in_each(s)]
    return [Column(DRAG * near, 0.4, "share_of_drag")]


def _drag_area_settings(e: Evidence) -> Iterator[Settings]:
    """A constant difference is a parameter error; missing physics is drag area that changes."""
    yield from step_settings(e)
    if len(e.stretches) > 2:
        yield each_recording(e)
    yield from slow_settings(e, -DRAG, 0.5)


def _drag_area(s: Settings) -> list[Column]:
    if "knots" in s:
        return slow_columns(s, -DRAG, "change", "1", sign=0)
    if "each" in s:
        return [Column(-(DRAG * here), 0.2, f"change[{name}]", sign=0) for name, here in in_each(s)]
    return [Column(-(DRAG * from_then_on(s)), 0.3, "change", sign=0)]


def _rolling_settings(e: Evidence) -> Iterator[Settings]:
    yield from ({"order": order} for order in (1, 2, 4))
    yield {"orders": [1, 4]}  # Mitschke's polynomial


def _rolling_speed(s: Settings) -> list[Column]:
    if "orders" in s:
        return [column for order in s["orders"] for column in _rolling_speed({"order": order})]
    if s["order"] == 4:
        return [Column(-((SPEED / 20.0) ** 4), 0.03, "fourth_power", "N s^4/m^4", 20.0**-4, per_mass=True)]
    if s["order"] == 2:
        return [Column(-((SPEED / 20.0) ** 2), 0.03, "square", "N s^2/m^2", 1 / 400.0, per_mass=True)]
    return [Column(-(SPEED / 20.0), 0.03, "slope", "N s/m", 1 / 20.0, per_mass=True)]


def _warm_up_settings(e: Evidence) -> Iterator[Settings]:
    """Every drive may start as cold as the others, or as cold as it happens to be; time warms, or turning."""
    ways: list[Settings] = [{"tau_s": tau_s} for tau_s in (60.0, 200.0, 600.0, 1500.0)]
    ways += [{"length_m": length_m} for length_m in (2000.0, 6000.0)]
    for way in ways:
        yield way
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield way | each_recording(e)


def _warm_up(s: Settings) -> list[Column]:
    still_cold = exp(-(ELAPSED / s["tau_s"] if "tau_s" in s else DISTANCE / s["length_m"]))
    if "each" in s:
        return [
            Column(-(still_cold * here), 0.05, f"cold_force[{name}]", "N", per_mass=True)
            for name, here in in_each(s)
        ]
    return [Column(-still_cold, 0.03, "cold_force", "N", per_mass=True)]


MECHANISMS = (
    Mechanism(
        "headwind",
        "F = -rho/2 CdA ((v + w)|v + w| - v^2)",
        "wind along the road changes the air drag",
        ("drag", "speed"),
        ("speed", "time"),
        "SAE J1263 wind correction",
        "drive the same stretch both ways at two speeds",
        _headwind_settings,
        _headwind,
        hidden=True,
    ),
    Mechanism(
        "drafting",
        "F = +rho/2 CdA v^2 s exp(-gap / L)",
        "the vehicle ahead takes away air drag",
        ("drag", "gap"),
        ("gap", "speed"),
        "Browand et al., PATH UCB-ITS-PRR-2004-20",
        "follow at several gaps at constant speed",
        _drafting_settings,
        _drafting,
        hidden=True,
    ),
    Mechanism(
        "drag_area",
        "F = -rho/2 v^2 d(CdA)(t)",
        "the drag area changed on the way: a tarpaulin, a trailer, a window",
        ("drag", "speed"),
        ("speed", "time", "recording"),
        "SAE J1263: aerodynamic drag; change of body",
        "coast down from high speed before and after the change",
        _drag_area_settings,
        _drag_area,
        hidden=True,
        prior=0.7,
    ),
    Mechanism(
        "rolling_resistance_speed",
        "F = -(k1 v + k2 v^2 + k4 v^4)",
        "rolling resistance grows with speed",
        ("speed",),
        ("speed",),
        "SAE J2452; Mitschke, Dynamik der Kraftfahrzeuge",
        "coast down from high speed on a calm day, both ways",
        _rolling_settings,
        _rolling_speed,
    ),
    Mechanism(
        "rolling_resistance_warmup",
        "F = -F_cold exp(-t / tau)",
        "tyres roll harder while they are cold",
        ("elapsed",),
        ("time since start",),
        "ISO 28580 warm-up times",
        "repeat the same stretch cold and after an hour",
        _warm_up_settings,
        _warm_up,
        hidden=True,
    ),
)
