"""Air, tyres and road: wind, drafting, rolling resistance, slip; slope and surface over distance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import FELT
from deeptruck_model.mismatch.mechanisms.courses import (
    Course,
    along_the_road,
    always,
    each_drive,
    each_wind,
    from_moments,
    slowly,
)
from deeptruck_model.mismatch.mechanisms.record import Column, Constants, Curve, Form, Mechanism, force, grid
from deeptruck_model.mismatch.mechanisms.symbols import (
    ACTS,
    BRAKE,
    CRAWL_SPEED,
    DISTANCE,
    DRAG,
    ELAPSED,
    PULL,
    SPEED,
    UPPER,
    quantile,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    Expression,
    Lag,
    Signal,
    absolute,
    exp,
    lift,
    maximum,
    minimum,
)

NOBODY_M = 1e4  # a gap behind nobody
FAR_M = 150.0  # the same, on a curve
STEADY_M_S, GUST_M_S = 7.0, 5.0  # prior sd of a drive's mean wind, and the largest of its slow changes
# Most by which the wind along the road departs from the drive's mean for half a minute: Beaufort 6 that falls
# calm, or is met round a bend. What swings further is slopes or brakes under another name.
SWING_M_S = 12.0
SIDE = 0.4  # sd of the drag that wind from the side adds, SAE J1252: 5 to 10 % a degree of yaw
PER_SQUARE = DRAG / maximum(SPEED, CRAWL_SPEED) ** 2
LEAST_GRIP = 0.35  # m/s^2: ice, 0.1, under the driven axle of a truck, 0.35 of its weight
HOLDS = 1e3  # m/s^2: tyres that never slip
HILLY = 0.02  # sd of the slope of a hilly road
ROUGH = 0.1  # m/s^2: soft ground
WET = 0.02  # m/s^2: a third of what tyres take, from one whole drive to another


def _wind(wind_m_s: float) -> Column:
    return Column(_of_wind(wind_m_s), 0.3, "wind", "m/s", wind_m_s, mean=1.0)


def _of_wind(wind_m_s: float) -> Expression:
    air = SPEED + wind_m_s
    return -(PER_SQUARE * (air * absolute(air) - SPEED**2))


def _more_wind(around_m_s: float, most: float = np.inf) -> Column:
    """Additional headwind of 1 m/s, linearised at `around_m_s`."""
    more = -(PER_SQUARE * (SPEED * 2.0 + around_m_s))
    return Column(more, STEADY_M_S, "wind", "m/s", sign=0, most=most)


def _behind(length_m: float, usual_m: float) -> Column:
    """`length_m` is the gap over which air drag recovers, `usual_m` the gap that a simulation without a
    leader assumes."""
    gap = Signal("gap", missing=NOBODY_M, simulated=usual_m)
    return Column(DRAG * exp(-(gap / length_m)), 0.4, "share_of_drag")


def _gaps(e: Evidence) -> Iterable[Constants]:
    gap = e["gap"][e.valid]
    usual = float(np.nanmedian(gap)) if np.isfinite(gap).any() else NOBODY_M
    return grid(length_m=(8.0, 20.0, 50.0), usual_m=[usual])


POWERS = {  # of speed: name and unit of the coefficient, which is that at 20 m/s
    1: ("slope", "N s/m"),
    2: ("square", "N s^2/m^2"),
    4: ("fourth_power", "N s^4/m^4"),
}


def _power_of_speed(order: int) -> Column:
    at_20 = SPEED / 20.0 if order == 1 else (SPEED / 20.0) ** order
    name, unit = POWERS[order]
    return Column(-at_20, 0.03, name, unit, 20.0**-order, per_mass=True)


def _grips(e: Evidence) -> Iterable[Constants]:
    """The largest drive and brake forces per mass (m/s^2) that the tyres transmit."""
    for q in (0.8, 0.92, 0.97):
        pull = max(quantile(e, e["engine"], e["engine"] > ACTS, q), LEAST_GRIP)
        brake = quantile(e, e["brake"], e["brake"] > 0.1, q)
        if np.isfinite(pull) or np.isfinite(brake):
            yield {
                "pull": pull if np.isfinite(pull) else HOLDS,
                "brake": brake if np.isfinite(brake) else HOLDS,
            }


def _slippery(e: Evidence) -> Iterable[Constants]:
    pull = max(quantile(e, e["engine"], e["engine"] > ACTS, 0.6), LEAST_GRIP)
    return ({"pull": pull},) if np.isfinite(pull) else ()


def _beyond(pull: float) -> Expression:
    return -maximum(PULL - pull, 0.0)


HEADWIND = Mechanism(
    "headwind",
    "air_tyres_road",
    says="wind along the road changes the air drag",
    equation="F = -rho/2 CdA ((v + w)|v + w| - v^2)",
    needs=("drag", "speed"),
    depends_on=("speed", "time"),
    source="SAE J1263 wind correction",
    manoeuvre="drive the same section both ways at two speeds",
    forms={
        "one wind": Form(
            _wind, grid(wind_m_s=(-12.0, -8.0, -4.0, 4.0, 8.0, 12.0)), fitted={"wind_m_s": (2.0, 16.0)}
        ),
        # linear around calm or around a wind
        "each drive": Form(
            lambda around_m_s: replace(_more_wind(around_m_s), exact=_of_wind),
            grid(around_m_s=(0.0, 6.0, -6.0)),
            (each_wind,),
        ),
        "turning": Form(
            lambda around_m_s: _more_wind(around_m_s, SWING_M_S),
            grid(around_m_s=(0.0, 6.0, -6.0)),
            (slowly(GUST_M_S),),
            level=_more_wind,
        ),
        # what blows from the side acts as more drag area
        "from the side": Form(
            lambda: Column(-DRAG, SIDE, "more_drag"),
            courses=(slowly(SIDE),),
            level=lambda: _more_wind(0.0),
        ),
    },
    prior_with={FELT: 5.0},  # what is slow and no slope is mostly wind
)

DRAFTING = Mechanism(
    "drafting",
    "air_tyres_road",
    says="the vehicle ahead takes away air drag",
    equation="F = +rho/2 CdA v^2 s exp(-gap / L)",
    needs=("drag", "gap"),
    depends_on=("gap", "speed"),
    source="Browand et al., PATH UCB-ITS-PRR-2004-20",
    manoeuvre="follow at several gaps at constant speed",
    forms={
        # behind the same vehicle, or another one on every drive
        "exponential": Form(
            _behind, _gaps, (always, each_drive()), units={"length_m": "m"}, fitted={"length_m": (4.0, 100.0)}
        ),
        **{
            f"gap, {trend}": Curve(
                DRAG,
                minimum(Signal("gap", missing=FAR_M, simulated=FAR_M), FAR_M),
                "gap",
                trend,
                needs=("gap",),
            )
            for trend in ("falling", "any")
        },
    },
)

# A constant difference is a parameter error; missing physics is drag area that changes.
DRAG_AREA = Mechanism(
    "drag_area",
    "air_tyres_road",
    says="the drag area changed on the way: a tarpaulin, a trailer, a window",
    equation="F = -rho/2 v^2 d(CdA)(t)",
    needs=("drag", "speed"),
    depends_on=("speed", "time", "recording"),
    source="SAE J1263: aerodynamic drag; change of body",
    manoeuvre="coast down from high speed before and after the change",
    forms={
        "changed": Form(
            lambda: Column(-DRAG, 0.3, "change", sign=0),
            courses=(from_moments, each_drive(0.2, more_than=2, most=np.inf), slowly(0.5)),
        ),
    },
    prior=0.7,
)

ROLLING_RESISTANCE_SPEED = Mechanism(
    "rolling_resistance_speed",
    "air_tyres_road",
    says="rolling resistance grows with speed",
    equation="F = -(k1 v + k2 v^2 + k4 v^4)",
    needs=("speed",),
    depends_on=("speed",),
    source="SAE J2452; Mitschke, Dynamik der Kraftfahrzeuge",
    manoeuvre="coast down from high speed on a calm day, both ways",
    forms={
        # 1 and 4 are Mitschke's polynomial
        "power": Form(
            lambda order: force(-((SPEED / 20.0) ** order), 0.03, "at_20_m_s"),
            grid(order=(1.0, 2.5, 5.0)),
            units={"order": "1"},
            fitted={"order": (0.5, 12.0)},
        ),
        "powers": Form(
            lambda orders: [_power_of_speed(order) for order in orders],
            grid(orders=((1,), (2,), (4,), (1, 4))),
        ),
        **{
            f"speed, {trend}": Curve(lift(-1.0), SPEED, "speed", trend, share=False)
            for trend in ("rising", "any")
        },
    },
)

# Every drive may start as cold as the others, or as cold as it happens to be.
ROLLING_RESISTANCE_WARMUP = Mechanism(
    "rolling_resistance_warmup",
    "air_tyres_road",
    says="tyres roll harder while they are cold",
    equation="F = -F_cold exp(-t / tau)",
    needs=("elapsed",),
    depends_on=("time since start",),
    source="ISO 28580 warm-up times",
    manoeuvre="repeat the same section cold and after an hour",
    forms={
        "in time": Form(
            lambda tau_s: force(-exp(-(ELAPSED / tau_s)), 0.03, "cold_force"),
            grid(tau_s=(60.0, 200.0, 600.0, 1500.0)),
            (always, each_drive(0.05)),
            units={"tau_s": "s"},
            fitted={"tau_s": (30.0, 3000.0)},
        ),
        "by turning": Form(
            lambda length_m: force(-exp(-(DISTANCE / length_m)), 0.03, "cold_force"),
            grid(length_m=(2000.0, 6000.0)),
            (always, each_drive(0.05)),
            units={"length_m": "m"},
            fitted={"length_m": (500.0, 20000.0)},
        ),
        "time since start": Curve(lift(-1.0), ELAPSED, "time since start", "falling", share=False),
        "speed over 300 s": Curve(
            lift(-1.0), Lag((SPEED,), 300.0, cold=True), "speed over 300 s", "falling", share=False
        ),
    },
)

WHEEL_SLIP = Mechanism(
    "wheel_slip",
    "engine_driveline",
    says="tyres slip above a force",
    equation="F = -s max(F_engine - mu N, 0), likewise when braking",
    needs=("engine", "speed", "brake"),
    depends_on=("traction force", "brake"),
    source="Pacejka, Tyre and Vehicle Dynamics, ch. 1",
    manoeuvre="full torque and full brake at low speed on the same surface",
    forms={
        "grip": Form(
            lambda pull, brake: [
                Column(_beyond(pull), 0.5, "traction_share"),
                Column(maximum(BRAKE - brake, 0.0), 0.5, "brake_share"),
            ],
            _grips,
            fitted={"pull": (0.2, 3.0)},
        ),
        "slippery in places": Form(
            lambda pull: Column(_beyond(pull), 1.0, "traction_share"),
            _slippery,
            (slowly(1.0, quick=False),),
            steady=False,
        ),
        **{
            by: Curve(acts * -1.0, absolute(acts), by, "rising", sd=0.6, knots=UPPER)
            for acts, by in ((PULL, "traction force"), (PULL - BRAKE, "force of the tyres"))
        },
    },
    prior=0.2,
)

SLOPE = Column(lift(-GRAVITY), HILLY, "grade", "ratio", sign=0)
FELT_SHARE = Column(-GRAVITY * Signal(FELT), 0.1, "share of the slope that was felt", mean=1.0)


def _unless_felt(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """Profiles where no accelerometer says what the slope is."""
    if not e.has(FELT):
        yield from along_the_road(HILLY)(e, carrier)


ROAD_GRADE = Mechanism(
    "road_grade",
    "air_tyres_road",
    says="the road has a slope the simulator does not know",
    equation="F = -m g s(x)",
    needs=("distance",),
    depends_on=("distance along the road",),
    source="definition of grade",
    manoeuvre="drive the same section in both directions",
    forms={
        # where none was recorded it may be the same everywhere; else that is the sensor's zero
        "constant": Form(lambda: SLOPE, lambda e: () if e.has("grade") or e.has(FELT) else ({},)),
        "profile": Form(lambda: SLOPE, courses=(_unless_felt,), steady=False),
        "felt": Form(lambda: FELT_SHARE, needs=(FELT,)),
    },
    prior_with={"grade": 0.2},  # where it would show
    of_input="grade",
)

ROAD_SURFACE = Mechanism(
    "road_surface",
    "air_tyres_road",
    says="the road rolls harder, on sections or on whole drives",
    equation="F = -m c(x), c >= 0, or one c in each recording",
    needs=("distance",),
    depends_on=("distance along the road", "recording"),
    source="rolling resistance of road textures: MIRIAM project",
    manoeuvre="drive the same section in both directions",
    forms={
        # another road, or rain
        "each drive": Form(lambda: force(lift(-1.0), WET, sign=0), courses=(each_drive(more_than=2),)),
        "profile": Form(lambda: force(lift(-1.0), ROUGH), courses=(along_the_road(ROUGH),)),
    },
    prior=0.05,  # what is not the same on the next pass is any drag that is time-varying
)

MECHANISMS = (
    HEADWIND,
    DRAFTING,
    DRAG_AREA,
    ROLLING_RESISTANCE_SPEED,
    ROLLING_RESISTANCE_WARMUP,
    WHEEL_SLIP,
    ROAD_GRADE,
    ROAD_SURFACE,
)
