"""Air and tyres: wind, drafting, rolling resistance."""

from __future__ import annotations

from collections.abc import Iterator

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.expression import InRecording, Signal, Tent, absolute, exp, maximum
from deeptruck_model.mismatch.mechanisms.base import (
    DRAG,
    ELAPSED,
    SPEED,
    Column,
    Mechanism,
    Settings,
    durations,
    from_then_on,
    share_out,
    step_settings,
)

MOST_KNOTS = 80
AROUND_M_S = (0.0, 6.0, -6.0)
STEADY_M_S, GUST_M_S = 7.0, 3.0  # prior sd of a drive's mean wind and of its slow changes


def _headwind_settings(e: Evidence) -> Iterator[Settings]:
    """One wind throughout, one for each recording, or a slowly turning one; linear around calm or around a
    wind."""
    for wind in (-12.0, -8.0, -4.0, 4.0, 8.0, 12.0):
        yield {"wind_m_s": wind}
    names = [s.name for s in e.stretches]
    for around in AROUND_M_S:
        if 1 < len(names) <= MOST_KNOTS:
            yield {"recordings": names, "around_m_s": around}
    for knot_s in (15.0, 60.0):
        knots = share_out(durations(e), knot_s, MOST_KNOTS)
        for around in AROUND_M_S:
            yield {"recordings": names, "around_m_s": around, "knots": knots, "knot_s": knot_s}


def _headwind(s: Settings) -> list[Column]:
    per_square = DRAG / maximum(SPEED, 1.0) ** 2
    if "wind_m_s" in s:
        air = SPEED + s["wind_m_s"]
        change = air * absolute(air) - SPEED**2
        return [Column(-(per_square * change), 0.3, "wind", "m/s", s["wind_m_s"], mean=1.0)]
    linear = -(per_square * (SPEED * 2.0 + s["around_m_s"]))
    names = s["recordings"]
    mean = 1.0 / len(names)  # in a simulation blows the mean of the recorded winds
    steady = [
        Column(linear * InRecording(i, elsewhere=mean), STEADY_M_S, f"wind[{name}]", "m/s", sign=0)
        for i, name in enumerate(names)
    ]
    return steady + [
        Column(linear * InRecording(i) * _tent(k, s["knot_s"]), GUST_M_S, f"wind[{name}, {k}]", "m/s", sign=0)
        for i, (name, count) in enumerate(zip(names, s.get("knots", []), strict=False))
        for k in range(count)
    ]


def _tent(k: int, knot_s: float) -> Tent:
    return Tent((ELAPSED,), k * knot_s, knot_s)


def _drafting_settings(e: Evidence) -> Iterator[Settings]:
    for length_m in (8.0, 20.0, 50.0):
        yield {"length_m": length_m}


def _drafting(s: Settings) -> list[Column]:
    near = exp(-(Signal("gap", missing=1e4) / s["length_m"]))
    return [Column(DRAG * near, 0.4, "share_of_drag")]


def _drag_area_settings(e: Evidence) -> Iterator[Settings]:
    """A constant difference is a parameter error; missing physics is drag area that changes."""
    yield from step_settings(e)
    if len(e.stretches) > 2:
        yield {"each": [s.name for s in e.stretches]}


def _drag_area(s: Settings) -> list[Column]:
    if "each" in s:
        return [
            Column(-(DRAG * InRecording(i)), 0.2, f"change[{name}]", sign=0)
            for i, name in enumerate(s["each"])
        ]
    return [Column(-(DRAG * from_then_on(s)), 0.3, "change", sign=0)]


def _no_settings(e: Evidence) -> Iterator[Settings]:
    yield {}


def _rolling_speed(s: Settings) -> list[Column]:
    return [Column(-(SPEED / 20.0), 0.03, "slope", "N s/m", 1 / 20.0, per_mass=True)]


def _warm_up_settings(e: Evidence) -> Iterator[Settings]:
    for tau_s in (200.0, 600.0, 1500.0):
        yield {"tau_s": tau_s}


def _warm_up(s: Settings) -> list[Column]:
    return [Column(-exp(-(ELAPSED / s["tau_s"])), 0.03, "cold_force", "N", per_mass=True)]


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
        "F = -k v",
        "rolling resistance grows with speed",
        ("speed",),
        ("speed",),
        "SAE J2452",
        "coast down from high speed on a calm day, both ways",
        _no_settings,
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
