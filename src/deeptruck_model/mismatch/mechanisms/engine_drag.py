"""Engine drag: engine braking, friction, and auxiliary loads."""

from __future__ import annotations

import numpy as np

from deeptruck_model.mismatch.mechanisms.courses import always, each_drive, slowly
from deeptruck_model.mismatch.mechanisms.record import (
    Column,
    Curve,
    Form,
    Mechanism,
    Trend,
    force,
    grid,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    ACTS,
    BRAKE,
    BRAKED_AGO,
    ELAPSED,
    ENGINE,
    ENGINE_COMMAND,
    ENGINE_SPEED,
    GEARED,
    OMEGA,
    OVERALL_RATIO,
    PER_POWER,
    PULL,
    SPEED,
    STOOD,
    over,
    quantile,
    ramp,
    ratio_reference,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    Expression,
    Integral,
    Since,
    exp,
    lift,
    maximum,
    minimum,
)

LITTLE, RELEASED = 0.03, 0.005  # of the largest command
LINGERS = 0.02  # of the time
LATE_S = (0.0, 0.7)  # valves and vanes take a moment
POWER = PULL * SPEED
TURNING = ENGINE_SPEED / OMEGA
PUMP = OVERALL_RATIO * -1.0  # a pump takes a torque, a fan one with speed squared
FAN = OVERALL_RATIO * TURNING**2 * -1.0
COASTING = ENGINE < 0.02
# since the first touch of the brake, which may set a retarder going
BRAKED = Since((BRAKE > ACTS,)) < Since((PULL > ACTS,))
DRIVEN: tuple[tuple[str, Expression, Trend], ...] = (  # what a pump or a fan may follow
    ("engine power over 60 s", over(60.0, POWER), "rising"),
    ("time since standing", STOOD, "falling"),
)


def _demanded(full: float, order: int = 0, reference: float = 0.0) -> Column:
    """Braking by a negative engine command, at most `full`: a force, or a torque that increases with engine
    speed to the power `order` and is reported as a force at the ratio `reference` (rad/m)."""
    asked = minimum(ENGINE_COMMAND, 0.0) / full
    if reference:
        asked = asked * (OVERALL_RATIO / reference)
    for _ in range(order):
        asked = asked * TURNING
    return force(asked, 0.3, "force_at_full_demand")


def _full_demand(e: Evidence) -> list[float]:
    least = float(np.nanmin(e["engine_command"][e.valid], initial=0.0))
    return [-least] if least < 0 else []


def released(e: Evidence) -> list[float]:
    """Thresholds of the engine command, below which the pedal may count as released: 3 % of the largest
    command; and 0.5 % of it, if the command is below 0.5 % for more than 2 % of the time and between 0.5 and
    3 % for more than 2 %."""
    command = e["engine_command"][e.valid]
    largest = float(np.nanmax(np.abs(command), initial=0.0))
    lingers = np.mean((command > RELEASED * largest) & (command < LITTLE * largest))
    let_go = np.mean(np.abs(command) <= RELEASED * largest)
    return [LITTLE * largest, *([RELEASED * largest] if min(lingers, let_go) > LINGERS else [])]


def _coasting(small: float, after_s: float = 0.0) -> Expression:
    """One while the engine command is below `small` and the engine does not drive, starting `after_s`
    later."""
    coast = (small + 1e-9 > ENGINE_COMMAND) * (ENGINE < ACTS)
    return coast * (Since((1.0 - coast,)) > after_s) if after_s else coast


def _by_engine_speed(small: float, after_s: float, reference: float, order: int) -> list[Column]:
    drive = _coasting(small, after_s) * (OVERALL_RATIO / reference) * TURNING
    first = force(-drive, 0.1, "force_at_150_rad_s")
    return [first, force(-(drive * ENGINE_SPEED / OMEGA), 0.1, "force_square")] if order == 2 else [first]


def _retarder(
    small: float, delay_s: float, rise_s: float, exponent: float, from_m_s: float, reference: float
) -> Column:
    """A retarder above a speed, whose torque rises after a delay and grows with a power of engine speed."""
    coast = _coasting(small) * (from_m_s < SPEED)
    rise = ramp(Since((1.0 - coast,)), delay_s, rise_s)
    return force(-(coast * rise * (OVERALL_RATIO / reference) * TURNING**exponent), 0.3)


def _flap(fill_s: float, from_rad_s: float, reference: float) -> Column:
    """A throttle in the exhaust that the first touch of the brake shuts, and the back pressure behind it."""
    shut = COASTING * BRAKED * (from_rad_s < ENGINE_SPEED)
    pressure = 1.0 - exp(-(Since((1.0 - shut,)) / fill_s))
    return force(-(shut * pressure * (OVERALL_RATIO / reference)), 0.3)


def _motored(reference: float) -> list[Column]:
    """Chen and Flynn: rubbing at the boundary, constant, viscous and pumping friction, and gas loading."""
    drag = OVERALL_RATIO / reference
    slow = minimum(OMEGA / maximum(ENGINE_SPEED, 50.0), 2.0)
    each = {
        "boundary": drag * slow,
        "constant": drag,
        "viscous": drag * TURNING,
        "pumping": drag * TURNING**2,
    }
    return [*(force(-x, 0.03, name) for name, x in each.items()), Column(-PULL, 0.02, "gas_loading")]


def _cold(reference: float, warm_s: float, idle: float, full: float) -> list[Column]:
    """Friction that falls as the engine warms up: in time, by `idle` of its full power, and by its power."""
    cold = exp(-(Integral((idle + POWER / full,)) / warm_s))
    drag = OVERALL_RATIO / reference * cold
    return [force(-drag, 0.05, "cold"), force(-(drag * TURNING), 0.05, "cold_per_speed")]


def _full_power(e: Evidence) -> list[float]:
    """Full power of the engine per mass, m^2/s^3; empty if it hardly ever drives."""
    pull = np.maximum(e["engine"], 0.0)
    full = quantile(e, pull * e["speed"], pull > 0.02, 0.95)
    return [full] if np.isfinite(full) else []


def _friction(reference: float, order: int) -> Column:
    """A torque that increases with engine speed to the power `order`, as a force at the ratio `reference`
    (rad/m)."""
    drive = OVERALL_RATIO / reference
    return force(-(drive * ENGINE_SPEED / OMEGA if order else drive), 0.03)


def _torque(reference: float, order: int) -> Column:
    """A torque at the engine that is constant, or increases with engine speed to the power `order`."""
    at_the_engine = OVERALL_RATIO / reference
    return force(-(at_the_engine * TURNING**order) if order else -at_the_engine, 0.3)


ENGINE_BRAKE = Mechanism(
    "engine_brake",
    "engine_driveline",
    says="the engine retards more on the overrun than the simulator knows",
    equation="F = -c n(w) r, or -F0(t) by stages, with the engine command at or below zero",
    needs=("engine_command", "engine", "speed"),
    depends_on=("engine command", "engine speed"),
    source="SAE J1621 retarder torque curves",
    manoeuvre="coast in gear and in neutral from the same speed",
    forms={
        "demanded force": Form(_demanded, lambda e: grid(full=_full_demand(e))),
        "demanded torque": Form(
            _demanded,
            lambda e: grid(full=_full_demand(e), order=(0, 1, 2), reference=[ratio_reference(e)]),
            needs=GEARED,
        ),
        "by engine speed": Form(
            _by_engine_speed,
            lambda e: grid(small=released(e), after_s=LATE_S, reference=[ratio_reference(e)], order=(1, 2)),
            needs=GEARED,
            units={"after_s": "s"},
        ),
        "by speed": Form(
            lambda small, after_s: force(-(_coasting(small, after_s) * SPEED / 20.0), 0.1, "force_at_20_m_s"),
            lambda e: grid(small=released(e), after_s=LATE_S),
            units={"after_s": "s"},
        ),
        "constant": Form(
            lambda small, after_s: force(-_coasting(small, after_s), 0.1),
            lambda e: grid(small=released(e), after_s=LATE_S),
            units={"after_s": "s"},
        ),
        "retarder": Form(
            _retarder,
            lambda e: grid(
                small=released(e)[:1],
                delay_s=(0.3,),
                rise_s=(0.5, 1.5),
                exponent=(1.0, 2.0),
                from_m_s=(2.0, 8.0),
                reference=[ratio_reference(e)],
            ),
            needs=GEARED,
            units={"delay_s": "s"},
            fitted={
                "delay_s": (0.05, 2.0),
                "rise_s": (0.1, 5.0),
                "exponent": (0.3, 3.0),
                "from_m_s": (1.0, 15.0),
            },
        ),
        "exhaust flap": Form(
            _flap,
            lambda e: grid(fill_s=(0.5, 1.5), from_rad_s=(60.0, 100.0), reference=[ratio_reference(e)]),
            needs=GEARED,
            units={"fill_s": "s"},
            fitted={"fill_s": (0.1, 5.0), "from_rad_s": (40.0, 130.0)},
        ),
        # by hand, or by a command the simulator does not get
        "staged": Form(
            lambda small: force(-_coasting(small), 0.3),
            lambda e: grid(small=released(e)[:1]),
            (slowly(0.3),),
        ),
        **{
            f"{by} {when}": Curve(
                -(acts * ratio), of, by, "rising", level=by != "time", share=False, needs=needs
            )
            for acts, when in (
                (COASTING, "while coasting"),
                (COASTING * (BRAKE > ACTS), "while coasting with the brake on"),
                (COASTING * BRAKED, "while coasting since a touch of the brake"),
            )
            for ratio, of, by, needs in (
                (lift(1.0), SPEED, "speed", ()),
                (OVERALL_RATIO, ENGINE_SPEED, "engine speed", GEARED),
                (OVERALL_RATIO, minimum(Since((1.0 - acts,)), 6.0), "time", ("ratio",)),
            )
        },
    },
    mistaken_for="brake",
)

ENGINE_FRICTION = Mechanism(
    "engine_friction",
    "engine_driveline",
    says="the engine turns harder than the simulator knows",
    equation="F = -r (c0 + c1 w), larger while cold",
    needs=("ratio", "engine_speed"),
    depends_on=("engine speed", "gear", "time since start"),
    source="Chen-Flynn friction model; Heywood, ch. 13",
    manoeuvre="coast in two gears from the same speed, cold and warm",
    forms={
        "motored": Form(_motored, lambda e: grid(reference=[ratio_reference(e)])),
        # every drive starts as cold as it happens to be
        "warming up": Form(
            _cold,
            lambda e: grid(
                reference=[ratio_reference(e)], warm_s=(100.0, 400.0), idle=(0.1, 0.5), full=_full_power(e)
            ),
            (always, each_drive()),
            units={"warm_s": "s"},
            fitted={"warm_s": (10.0, 2000.0), "idle": (0.02, 2.0)},
        ),
        "warm": Form(_friction, lambda e: grid(reference=[ratio_reference(e)], order=(0, 1))),
        "engine speed": Curve(
            OVERALL_RATIO * -1.0,
            ENGINE_SPEED,
            "engine speed",
            "rising",
            level=True,
            share=False,
            needs=GEARED,
        ),
        "time since start": Curve(
            OVERALL_RATIO * -1.0, ELAPSED, "time since start", "falling", share=False, needs=("ratio",)
        ),
        # pumping work that keeps the exhaust hot, and oil films that load makes thin
        "engine power over 20 s": Curve(
            OVERALL_RATIO * -1.0,
            over(20.0, POWER),
            "engine power over 20 s",
            "falling",
            share=False,
            needs=("ratio",),
        ),
    },
    prior=0.7,
    mistaken_for="gear",
)

ACCESSORY_LOAD = Mechanism(
    "accessory_load",
    "engine_driveline",
    says="something besides the wheels takes engine power",
    equation="F = -P / v, or -T r (1, or w^2)",
    needs=("speed", "engine"),
    depends_on=("speed", "engine speed", "time since standing"),
    source="fan, compressor and air conditioning loads: NREL heavy-vehicle accessory studies",
    manoeuvre="hold the same road load with the fan on and off",
    forms={
        "power": Form(
            lambda: Column(PER_POWER, 0.5, "power", "W", per_mass=True), courses=(always, slowly(2.0))
        ),
        "torque": Form(
            _torque,
            lambda e: grid(reference=[ratio_reference(e)], order=(0, 2)),
            (slowly(0.3),),
            needs=GEARED,
        ),
        **{
            f"engine power over {s:.0f} s": Curve(
                PER_POWER, over(s, POWER), f"engine power over {s:.0f} s", "rising", share=False
            )
            for s in (60.0, 200.0)
        },
        "time since braking": Curve(
            PER_POWER,
            BRAKED_AGO,
            "time since braking",
            "falling",
            share=False,
        ),
        "engine speed": Curve(
            PER_POWER, ENGINE_SPEED, "engine speed", "rising", share=False, needs=("engine_speed",)
        ),
        **{
            f"{of} of a {name}": Curve(torque, of_what, of, trend, share=False, needs=GEARED)
            for of, of_what, trend in DRIVEN
            for name, torque in (("pump", PUMP), ("fan", FAN))
        },
        "any time since standing of a pump": Curve(
            PUMP, STOOD, "time since standing", "any", share=False, needs=GEARED
        ),
    },
    prior=0.7,
)

MECHANISMS = (ENGINE_BRAKE, ENGINE_FRICTION, ACCESSORY_LOAD)
