"""Air and tyres: wind, drafting, rolling resistance, slip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from deeptruck_model.mismatch.expression import Expression, InRecording, Signal, absolute, exp, maximum
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    quantile,
)
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
    DRAG,
    ELAPSED,
    PULL,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import (
    Constants,
    FromMoment,
    PerRecording,
    Simple,
    Spline,
    Static,
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


@dataclass(frozen=True)
class Wind(Constants):
    """One wind throughout."""

    wind_m_s: float


@dataclass(frozen=True)
class Winds(Constants):
    """A wind of each drive, linear around one; `side` adds to it drag area by what blows from the side."""

    around_m_s: float
    side: bool = False


def _headwinds(e: Evidence) -> Iterator[Simple]:
    """One wind throughout, one for each recording, or a slowly turning one; linear around calm or around a
    wind. What blows from the side acts as more drag area."""
    for wind in (-12.0, -8.0, -4.0, 4.0, 8.0, 12.0):
        yield Static(Wind(wind))
    names = tuple(s.name for s in e.stretches)
    for around in AROUND_M_S:
        if 1 < len(names) <= MOST_KNOTS:
            yield PerRecording(names, 1.0 / len(names), Winds(around), weather=True)
    for around in AROUND_M_S:
        yield from splines(e, _per_wind(around), GUST_M_S, constants=Winds(around), levels=True)
    yield from splines(e, -DRAG, SIDE, constants=Winds(0.0, side=True), levels=True)


def _per_wind(around_m_s: float) -> Expression:
    """The force of 1 m/s more wind than that, m/s^2."""
    return -(PER_SQUARE * (SPEED * 2.0 + around_m_s))


def _headwind(v: Simple) -> list[Column]:
    match v:
        case Static(Wind(wind_m_s)):
            air = SPEED + wind_m_s
            change = air * absolute(air) - SPEED**2
            return [Column(-(PER_SQUARE * change), 0.3, "wind", "m/s", wind_m_s, mean=1.0)]
        case PerRecording(names=names, constants=Winds(around_m_s)):
            return _steady_winds(names, _per_wind(around_m_s))
        case Spline(names=names, constants=Winds(around_m_s, side)):
            linear = _per_wind(around_m_s)
            steady = _steady_winds(names, linear)
            if side:
                return steady + spline_columns(v, -DRAG, "more_drag", "1", sign=1, steady=False)
            return steady + spline_columns(v, linear, "wind", "m/s", sign=0, steady=False, most=SWING_M_S)
    raise TypeError(f"{v!r} is no wind")


def _steady_winds(names: tuple[str, ...], linear: Expression) -> list[Column]:
    """A wind for each recording; in a simulation blows the mean of them."""
    mean = 1.0 / len(names)
    return [
        Column(linear * InRecording(i, elsewhere=mean), STEADY_M_S, f"wind[{name}]", "m/s", sign=0)
        for i, name in enumerate(names)
    ]


@dataclass(frozen=True)
class Gap(Constants):
    """The gap over which air drag comes back, and that at which a simulation without a leader follows."""

    length_m: float
    usual_m: float = NOBODY_M


def _draftings(e: Evidence) -> Iterator[Simple]:
    """A simulation without a vehicle ahead follows at the gap that was recorded."""
    gap = e["gap"][e.valid]
    usual = float(np.nanmedian(gap)) if np.isfinite(gap).any() else NOBODY_M
    for length_m in (8.0, 20.0, 50.0):
        yield Static(Gap(length_m, usual))
        if 1 < len(e.stretches) <= MOST_KNOTS:  # behind another vehicle on every drive
            yield each_recording(e, Gap(length_m, usual))


def _drafting(v: Simple) -> list[Column]:
    if not isinstance(v.constants, Gap):
        raise TypeError(f"{v!r} is no drafting")
    gap = Signal("gap", missing=NOBODY_M, simulated=v.constants.usual_m)
    near = exp(-(gap / v.constants.length_m))
    if isinstance(v, PerRecording):
        return [Column(DRAG * near * here, 0.4, f"share_of_drag[{name}]") for name, here in in_each(v)]
    return [Column(DRAG * near, 0.4, "share_of_drag")]


def _drag_areas(e: Evidence) -> Iterator[Simple]:
    """A constant difference is a parameter error; missing physics is drag area that changes."""
    yield from moments(e)
    if len(e.stretches) > 2:
        yield each_recording(e)
    yield from splines(e, -DRAG, 0.5)


def _drag_area(v: Simple) -> list[Column]:
    match v:
        case PerRecording():
            return [Column(-(DRAG * here), 0.2, f"change[{name}]", sign=0) for name, here in in_each(v)]
        case FromMoment():
            return [Column(-(DRAG * from_then_on(v)), 0.3, "change", sign=0)]
    return spline_columns(v, -DRAG, "change", "1", sign=0)


@dataclass(frozen=True)
class SpeedPowers(Constants):
    """The powers of speed with which rolling resistance grows, of 1, 2 and 4."""

    orders: tuple[int, ...]


def _rollings(e: Evidence) -> Iterator[Static]:
    yield from (Static(SpeedPowers((order,))) for order in (1, 2, 4))
    yield Static(SpeedPowers((1, 4)))  # Mitschke's polynomial


def _rolling_speed(v: Simple) -> list[Column]:
    if not isinstance(v.constants, SpeedPowers):
        raise TypeError(f"{v!r} is no rolling resistance")
    return [_rolling_power(order) for order in v.constants.orders]


def _rolling_power(order: int) -> Column:
    if order == 4:
        return Column(-((SPEED / 20.0) ** 4), 0.03, "fourth_power", "N s^4/m^4", 20.0**-4, per_mass=True)
    if order == 2:
        return Column(-((SPEED / 20.0) ** 2), 0.03, "square", "N s^2/m^2", 1 / 400.0, per_mass=True)
    return Column(-(SPEED / 20.0), 0.03, "slope", "N s/m", 1 / 20.0, per_mass=True)


@dataclass(frozen=True)
class WarmsInTime(Constants):
    tau_s: float


@dataclass(frozen=True)
class WarmsByTurning(Constants):
    length_m: float


def _warm_ups(e: Evidence) -> Iterator[Simple]:
    """Every drive may start as cold as the others, or as cold as it happens to be; time warms, or turning."""
    ways: list[Constants] = [WarmsInTime(tau_s) for tau_s in (60.0, 200.0, 600.0, 1500.0)]
    ways += [WarmsByTurning(length_m) for length_m in (2000.0, 6000.0)]
    for way in ways:
        yield Static(way)
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield each_recording(e, way)


def _warm_up(v: Simple) -> list[Column]:
    still_cold = exp(-_warmed(v.constants))
    if isinstance(v, PerRecording):
        return [
            Column(-(still_cold * here), 0.05, f"cold_force[{name}]", "N", per_mass=True)
            for name, here in in_each(v)
        ]
    return [Column(-still_cold, 0.03, "cold_force", "N", per_mass=True)]


def _warmed(by: Constants) -> Expression:
    match by:
        case WarmsInTime(tau_s):
            return ELAPSED / tau_s
        case WarmsByTurning(length_m):
            return DISTANCE / length_m
    raise TypeError(f"{by!r} warms no tyres")


LEAST_GRIP = 0.35  # m/s^2: ice, 0.1, under the driven axle of a truck, 0.35 of its weight


@dataclass(frozen=True)
class Grip(Constants):
    """The largest pull and brake force (m/s^2) that the tyres hold."""

    pull: float
    brake: float = 1e3


def _slips(e: Evidence) -> Iterator[Simple]:
    for q in (0.8, 0.92, 0.97):
        pull = max(quantile(e, e["engine"], e["engine"] > 0.05, q), LEAST_GRIP)
        brake = quantile(e, e["brake"], e["brake"] > 0.1, q)
        if np.isfinite(pull) or np.isfinite(brake):
            yield Static(Grip(pull if np.isfinite(pull) else 1e3, brake if np.isfinite(brake) else 1e3))
    grip = max(quantile(e, e["engine"], e["engine"] > 0.05, 0.6), LEAST_GRIP)
    if np.isfinite(grip):  # the road is slippery here and there
        yield from splines(e, _beyond(grip), 1.0, quick=False, constants=Grip(grip))


def _beyond(grip: float) -> Expression:
    return -maximum(PULL - grip, 0.0)


def _slip(v: Simple) -> list[Column]:
    match v:
        case Spline(constants=Grip(pull)):
            return spline_columns(v, _beyond(pull), "traction_share", "1", sign=1, steady=False)
        case Static(Grip(pull, brake)):
            return [
                Column(_beyond(pull), 0.5, "traction_share"),
                Column(maximum(BRAKE - brake, 0.0), 0.5, "brake_share"),
            ]
    raise TypeError(f"{v!r} is no slip of tyres")


MECHANISMS = (
    Mechanism(
        "headwind",
        "F = -rho/2 CdA ((v + w)|v + w| - v^2)",
        "wind along the road changes the air drag",
        ("drag", "speed"),
        ("speed", "time"),
        "SAE J1263 wind correction",
        "drive the same stretch both ways at two speeds",
        _headwinds,
        _headwind,
    ),
    Mechanism(
        "drafting",
        "F = +rho/2 CdA v^2 s exp(-gap / L)",
        "the vehicle ahead takes away air drag",
        ("drag", "gap"),
        ("gap", "speed"),
        "Browand et al., PATH UCB-ITS-PRR-2004-20",
        "follow at several gaps at constant speed",
        _draftings,
        _drafting,
    ),
    Mechanism(
        "drag_area",
        "F = -rho/2 v^2 d(CdA)(t)",
        "the drag area changed on the way: a tarpaulin, a trailer, a window",
        ("drag", "speed"),
        ("speed", "time", "recording"),
        "SAE J1263: aerodynamic drag; change of body",
        "coast down from high speed before and after the change",
        _drag_areas,
        _drag_area,
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
        _rollings,
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
        _warm_ups,
        _warm_up,
    ),
    Mechanism(
        "wheel_slip",
        "F = -s max(F_engine - mu N, 0), likewise when braking",
        "tyres slip above a force",
        ("engine", "speed", "brake"),
        ("traction force", "brake"),
        "Pacejka, Tyre and Vehicle Dynamics, ch. 1",
        "full torque and full brake at low speed on the same surface",
        _slips,
        _slip,
        prior=0.2,
    ),
)
