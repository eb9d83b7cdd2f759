"""Engine: torque that is delayed, or less than commanded."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.mechanisms.courses import each_drive, slowly
from deeptruck_model.mismatch.mechanisms.record import Column, Constants, Curve, Form, Mechanism, grid
from deeptruck_model.mismatch.mechanisms.symbols import (
    CRAWL_SPEED,
    ENGINE_SPEED,
    OMEGA,
    OVERALL_RATIO,
    PULL,
    SIMULATED,
    SPEED,
    UPPER,
    geared,
    over,
    quantile,
    ratio_if_known,
    torque_of,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Expression, Lag, RisingLag, Signal, maximum, minimum

TAUS_S = (0.4, 0.8, 1.6, 3.0)
BOOST = {"tau_s": (0.2, 8.0), "aspirated": (0.03, 2.0)}
LIMITS = (0.35, 0.5, 0.65, 0.75, 0.85, 0.93)  # of the largest: full throttle is held for long
POWER, TORQUE = PULL * SPEED, PULL / maximum(OVERALL_RATIO, 0.05)


def _boosted(reference: float, aspirated: float) -> Expression:
    """Torque above the naturally aspirated torque, as a force at the ratio `reference` (rad/m)."""
    return maximum(PULL / maximum(geared(reference), 0.05) - aspirated, 0.0)


def _late(boost: Expression, boosted: Expression, reference: float) -> Column:
    return Column(minimum(boost - boosted, 0.0) * geared(reference), 0.7, "share_of_boosted_pull")


def _first_order(tau_s: float, reference: float, aspirated: float = 0.0) -> Column:
    boosted = _boosted(reference, aspirated)
    return _late(RisingLag((boosted,), tau_s), boosted, reference)


def _kept(tau_s: float, reference: float, aspirated: float) -> Column:
    boosted = _boosted(reference, aspirated)
    return _late(Lag((boosted,), tau_s), boosted, reference)


def _slow_when_slow(tau_s: float, reference: float) -> Column:
    late = _first_order(tau_s, reference)
    spinning = minimum(OMEGA / maximum(ENGINE_SPEED, 50.0), 2.0)
    return Column(late.expression * spinning, late.sd, late.name)


def _aspirated(e: Evidence) -> Iterable[Constants]:
    reference = ratio_if_known(e)
    full = quantile(e, torque_of(e, reference), np.maximum(e["engine"], 0.0) > 0.02, 0.98)
    aspirated = [share * full for share in (0.2, 0.4)] if np.isfinite(full) else []
    return grid(tau_s=TAUS_S, reference=[reference], aspirated=aspirated)


def _full_power(e: Evidence) -> list[float]:
    """Full power of the engine per mass, m^2/s^3; empty if it hardly ever drives."""
    pull = np.maximum(e["engine"], 0.0)
    full = quantile(e, pull * e["speed"], pull > 0.02, 0.95)
    return [full] if np.isfinite(full) else []


def _beyond_onset(soak_s: float, gas_s: float, onset: float, full: float) -> Column:
    """Less torque in proportion to the heat of two bodies beyond an onset, a share of that at full power."""
    heat = Lag((Lag((POWER / full,), soak_s, cold=True),), gas_s, cold=True)
    return Column(-(PULL * minimum(maximum(heat - onset, 0.0) / onset, 1.0)), 0.3, "loss_at_twice_the_onset")


def _exhaust_driven(shaft_s: float, aspirated: float, full: float, reference: float) -> Column:
    """Torque beyond what the air allows, as a force at the ratio `reference` (rad/m): the energy of the
    turbocharger's shaft follows the exhaust's power, torque times engine speed."""
    torque = PULL / maximum(geared(reference), 0.05)
    power = minimum(torque / full, 1.0) * minimum(maximum(ENGINE_SPEED / OMEGA, 0.3), 1.6)
    allowed = aspirated + (full - aspirated) * minimum(Lag((power,), shaft_s, cold=True), 1.0)
    return Column(minimum(allowed - torque, 0.0) * geared(reference), 0.7, "share_of_what_is_beyond")


def _full_torque(e: Evidence) -> Iterable[Constants]:
    reference = ratio_if_known(e)
    full = quantile(e, torque_of(e, reference), np.maximum(e["engine"], 0.0) > 0.02, 0.98)
    top = [full] if np.isfinite(full) and reference else []
    return (
        c
        for f in top
        for c in grid(shaft_s=(1.0, 3.0), aspirated=(0.2 * f, 0.4 * f), full=[f], reference=[reference])
    )


def _soaked(soak_s: float, full: float) -> Column:
    load = minimum(Lag((POWER / full,), soak_s, cold=True), 1.5)
    return Column(-(PULL * load), 0.3, "loss_at_full_load")


def _hot(by: str) -> Column:
    heat = maximum(Signal(by) - 25.0, 0.0) / 10.0
    return Column(-(PULL * heat), 0.1, "loss", "1/K", 0.1)


def _beyond(share: Expression) -> Column:
    return Column(-share, 0.5, "share_of_what_is_beyond")


def _shares(e: Evidence, x: Array) -> list[float]:
    """Shares of the largest value of x (n,) while the engine drives."""
    most = quantile(e, x, np.maximum(e["engine"], 0.0) > 0.02, 0.98)
    return [share * most for share in LIMITS] if 0.0 < most < np.inf else []


def _torques(e: Evidence) -> Iterable[Constants]:
    reference = ratio_if_known(e)
    tops = _shares(e, torque_of(e, reference)) if reference else []
    return [{"limit_torque": top / reference} for top in tops]


def _forces(e: Evidence) -> Iterable[Constants]:
    known = "ratio" in e.signals
    return [] if known else grid(limit_force=_shares(e, np.maximum(e["engine"], 0.0)))


def _commands(e: Evidence) -> Iterable[Constants]:
    """Constants for a torque that does not follow from any gear ratio."""
    known = "ratio" in e.signals or not e.has("engine_command")
    return [] if known else grid(limit_command=_shares(e, e["engine_command"]))


def _speeds(e: Evidence) -> Iterable[Constants]:
    tops = [quantile(e, e["speed"], np.ones(len(e), dtype=bool), q) for q in (0.6, 0.75, 0.85, 0.93, 0.97)]
    return grid(limit_speed=[top for top in tops if np.isfinite(top)])


TURBO_LAG = Mechanism(
    "turbo_lag",
    "engine_driveline",
    says="engine torque builds up later than commanded",
    equation="F = -(F_cmd - F_boost);  tau dF_boost/dt = F_cmd - F_boost while rising",
    needs=("engine",),
    depends_on=("rate of engine command",),
    source="Rakopoulos and Giakoumis, Diesel Engine Transient Operation",
    manoeuvre="step the engine command up and down at constant speed",
    # torques are forces at the ratio `reference` (rad/m), zero where gears are not known
    forms={
        "all of the torque": Form(
            _first_order,
            lambda e: grid(tau_s=TAUS_S, reference=[ratio_if_known(e)]),
            units={"tau_s": "s"},
            fitted={"tau_s": (0.2, 8.0)},
        ),
        "exhaust energy": Form(
            _exhaust_driven,
            _full_torque,
            needs=("engine_speed",),
            units={"shaft_s": "s"},
            fitted={"shaft_s": (0.3, 10.0), "aspirated": (0.03, 2.0)},
        ),
        "above aspirated": Form(_first_order, _aspirated, units={"tau_s": "s"}, fitted=BOOST),
        # through a shift: what was built up falls no faster than it rises
        "kept through a shift": Form(_kept, _aspirated, units={"tau_s": "s"}, fitted=BOOST),
        # little exhaust spins the turbine up slowly
        "slow at low speed": Form(
            _slow_when_slow,
            lambda e: grid(tau_s=TAUS_S, reference=[ratio_if_known(e)]) if "ratio" in e.signals else (),
            needs=("engine_speed",),
            units={"tau_s": "s"},
            fitted={"tau_s": (0.2, 8.0)},
        ),
        "engine speed": Curve(
            RisingLag((PULL,), 1.0) - PULL,
            ENGINE_SPEED,
            "engine speed",
            "falling",
            level=True,
            needs=("engine_speed",),
        ),
    },
)

TORQUE_DERATE = Mechanism(
    "torque_derate",
    "engine_driveline",
    says="the engine gives less than commanded under lasting load, height or heat",
    equation="F = -k L F_engine, L the load soaked in (or altitude, or outside heat, or power)",
    needs=("engine", "speed"),
    depends_on=("sustained load", "elevation", "ambient temperature"),
    source="SAE J1349 correction; thermal derating practice",
    manoeuvre="hold full torque for several minutes, then repeat after idling",
    forms={
        # a share of full power (m^2/s^3) soaked in
        "lasting load": Form(
            _soaked,
            lambda e: grid(soak_s=(60.0, 200.0, 600.0), full=_full_power(e)),
            units={"soak_s": "s"},
            fitted={"soak_s": (5.0, 2000.0)},
        ),
        "beyond an onset": Form(
            _beyond_onset,
            lambda e: grid(soak_s=(20.0, 100.0), gas_s=(10.0,), onset=(0.3, 0.6), full=_full_power(e)),
            units={"soak_s": "s"},
            fitted={"soak_s": (3.0, 600.0), "gas_s": (1.0, 100.0), "onset": (0.05, 1.0)},
        ),
        "elevation": Form(
            lambda: Column(-(PULL * maximum(Signal("elevation"), 0.0) / 1000.0), 0.15, "loss", "1/km"),
            needs=("elevation",),
        ),
        "ambient temperature": Form(lambda: _hot("ambient_temperature"), needs=("ambient_temperature",)),
        # in some drives and not in others, or on the way
        "over time": Form(
            lambda: Column(-PULL, 0.5, "loss"), courses=(each_drive(0.5), slowly(0.5, quick=False))
        ),
        # what throttles the flow (a filter, a leaking hose) costs the more, the more flows
        "throttled": Form(
            lambda full: Column(-(PULL * minimum(POWER / full, 1.5)), 0.5, "loss_at_full_power"),
            lambda e: grid(full=_full_power(e)),
            (slowly(0.5, quick=False),),
        ),
        **{
            f"engine power over {s:.0f} s": Curve(
                PULL * -1.0, over(s, POWER), f"engine power over {s:.0f} s", "rising"
            )
            for s in (20.0, 60.0, 200.0, 600.0)
        },
        "engine power": Curve(PULL * -1.0, POWER, "engine power", "rising", level=True),
        "engine speed": Curve(
            PULL * -1.0, ENGINE_SPEED, "engine speed", "rising", level=True, needs=("engine_speed",)
        ),
        "metres above 500": Curve(
            PULL * -1.0,
            maximum(Signal("elevation") - 500.0, 0.0),
            "metres above 500",
            "rising",
            needs=("elevation",),
        ),
        "kelvins above 20 degrees outside": Curve(
            PULL * -1.0,
            maximum(Signal("ambient_temperature") - 20.0, 0.0),
            "kelvins above 20 degrees outside",
            "rising",
            needs=("ambient_temperature",),
        ),
    },
)

TORQUE_LIMIT = Mechanism(
    "torque_limit",
    "engine_driveline",
    says="a limiter or governor cuts the engine above a threshold",
    equation="F = -s max(F_engine - F_max, 0)",
    needs=("engine", "speed"),
    depends_on=("engine command", "speed"),
    source="SAE J1939-71 torque and speed limits; ECE R89",
    manoeuvre="command full torque from low to top speed",
    forms={
        "torque": Form(
            lambda limit_torque: _beyond(maximum(PULL - OVERALL_RATIO * limit_torque, 0.0)),
            _torques,
            fitted={"limit_torque": (0.002, 1.0)},
            units={"limit_torque": "N m"},
        ),
        "force": Form(
            lambda limit_force: _beyond(maximum(PULL - limit_force, 0.0)),
            _forces,
            fitted={"limit_force": (0.05, 3.0)},
            units={"limit_force": "N"},
        ),
        "power": Form(
            lambda limit_power: _beyond(maximum(PULL - limit_power / maximum(SPEED, CRAWL_SPEED), 0.0)),
            lambda e: grid(limit_power=_shares(e, np.maximum(e["engine"], 0.0) * e["speed"])),
            fitted={"limit_power": (0.5, 40.0)},
            units={"limit_power": "W"},
        ),
        "command": Form(
            lambda limit_command: _beyond(
                PULL * (1.0 - limit_command / maximum(Signal("engine_command"), limit_command))
            ),
            _commands,
            units={"limit_command": "engine_command"},
        ),
        "speed": Form(
            lambda limit_speed: _beyond(PULL * minimum(maximum(SPEED - limit_speed, 0.0), 1.0)),
            _speeds,
            fitted={"limit_speed": (5.0, 35.0)},
            units={"limit_speed": "m/s"},
        ),
        **{
            f"{by}, rising": Curve(PULL * -1.0, of, by, "rising", sd=0.6, needs=needs, knots=UPPER)
            for of, by, needs in (
                (TORQUE, "torque", ("ratio",)),
                (PULL, "engine force", ()),
                (SPEED, "speed", ()),
                (POWER, "engine power", ()),
                (ENGINE_SPEED, "engine speed", ("engine_speed",)),
                (Lag((SIMULATED,), 0.5), "acceleration", ()),  # a governor that holds it
            )
        },
        # a feed pump, or a map of the pedal, that gives less at low speed
        "engine speed, falling": Curve(
            PULL * -1.0, ENGINE_SPEED, "engine speed", "falling", sd=0.6, needs=("engine_speed",)
        ),
    },
)

MECHANISMS = (TURBO_LAG, TORQUE_DERATE, TORQUE_LIMIT)
