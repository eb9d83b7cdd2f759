"""Engine: lag of the boost, derates, limits, friction, and what it drives besides the wheels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.expression import (
    Expression,
    Lag,
    RisingLag,
    Signal,
    Since,
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
    MOST_KNOTS,
    each_recording,
    in_each,
    slow_columns,
    slow_settings,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    ELAPSED,
    ENGINE,
    ENGINE_COMMAND,
    ENGINE_SPEED,
    LEVER,
    OMEGA,
    PULL,
    SPEED,
)
from deeptruck_model.mismatch.residual.evidence import Evidence


def _turbo_settings(e: Evidence) -> Iterator[Settings]:
    """All of the torque may lag, or what is above what the engine gives without boost, or more so at low
    revolutions."""
    pull = np.maximum(e["engine"], 0.0)
    reference = lever_reference(e)
    known = "ratio" in e.signals
    torque = pull * reference / np.maximum(e["ratio"], 0.05 * reference) if known else pull
    full = quantile(e, torque, pull > 0.02, 0.98)
    for tau_s in (0.4, 0.8, 1.6, 3.0):
        yield {"tau_s": tau_s, "aspirated": 0.0, "reference": reference if known else None}
        yield {"tau_s": tau_s, "aspirated": 0.0, "reference": reference if known else None, "order": 2}
        if np.isfinite(full):
            for share in (0.2, 0.4):
                yield {"tau_s": tau_s, "aspirated": share * full, "reference": reference if known else None}
                yield {
                    "tau_s": tau_s,
                    "aspirated": share * full,
                    "reference": reference if known else None,
                    "stays": True,
                }
        if known and e.has("engine_speed"):
            yield {"tau_s": tau_s, "aspirated": 0.0, "reference": reference, "slow_when_slow": True}


def _turbo(s: Settings) -> list[Column]:
    lever = LEVER / s["reference"] if s["reference"] else lift(1.0)
    boosted = maximum(PULL / maximum(lever, 0.05) - s["aspirated"], 0.0)
    boost: Expression = boosted
    for _ in range(s.get("order", 1)):  # a boost that feeds itself begins slowly
        boost = RisingLag((boost,), s["tau_s"] / s.get("order", 1))
    if "stays" in s:  # through a shift: what was built up falls no faster than it rises
        boost = Lag((boosted,), s["tau_s"])
    late = minimum(boost - boosted, 0.0) * lever
    if "slow_when_slow" in s:  # little exhaust spins the turbine up slowly
        late = late * minimum(OMEGA / maximum(ENGINE_SPEED, 50.0), 2.0)
    return [Column(late, 0.7, "share")]


def _derate_settings(e: Evidence) -> Iterator[Settings]:
    pull = np.maximum(e["engine"], 0.0)
    full = quantile(e, pull * e["speed"], pull > 0.02, 0.95)
    for soak_s in (60.0, 200.0, 600.0):
        if np.isfinite(full):
            yield {"by": "load", "soak_s": soak_s, "full": full}
    if e.has("elevation"):
        yield {"by": "elevation"}
    if e.has("ambient_temperature"):
        yield {"by": "ambient_temperature"}
    yield from slow_settings(e, -PULL, 0.5, quick=False)
    if np.isfinite(full):  # what throttles the flow (a filter, a leaking hose) costs the more, the more flows
        loss = _throttled(full)
        yield from ({**slow, "full": full} for slow in slow_settings(e, loss, 0.5, quick=False))


def _throttled(full: float) -> Expression:
    """Minus the pull, by the share of full power that is asked."""
    return -(PULL * minimum(PULL * SPEED / full, 1.5))


def _derate(s: Settings) -> list[Column]:
    if "knots" in s:
        carrier = _throttled(s["full"]) if "full" in s else -PULL
        return slow_columns(s, carrier, "loss_at_full_power" if "full" in s else "loss", "1", sign=1)
    if s["by"] == "load":
        load = minimum(Lag((PULL * SPEED / s["full"],), s["soak_s"], cold=True), 1.5)
        return [Column(-(PULL * load), 0.3, "loss_at_full_load")]
    if s["by"] == "elevation":
        return [Column(-(PULL * maximum(Signal("elevation"), 0.0) / 1000.0), 0.15, "loss", "1/km")]
    heat = maximum(Signal("ambient_temperature") - 25.0, 0.0) / 10.0
    return [Column(-(PULL * heat), 0.1, "loss", "1/K", 0.1)]


def _limit_settings(e: Evidence) -> Iterator[Settings]:
    pull, speed = np.maximum(e["engine"], 0.0), e["speed"]
    reference = lever_reference(e)
    torque = pull * reference / np.maximum(e["ratio"], 0.05 * reference) if "ratio" in e.signals else pull
    for q in (0.6, 0.75, 0.85, 0.93, 0.97):
        for by, x in (("torque", torque), ("power", pull * speed), ("speed", speed)):
            top = quantile(e, x, (pull > 0.02) | (by == "speed"), q)
            if np.isfinite(top):
                yield {"by": by, "top": top, "reference": reference if "ratio" in e.signals else None}


def _limit(s: Settings) -> list[Column]:
    if s["by"] == "speed":
        over: Expression = PULL * minimum(maximum(SPEED - s["top"], 0.0), 1.0)
    elif s["by"] == "power":
        over = maximum(PULL - s["top"] / maximum(SPEED, 1.0), 0.0)
    else:
        lever = LEVER / s["reference"] if s["reference"] else 1.0
        over = maximum(PULL - s["top"] * lever, 0.0) if s["reference"] else maximum(PULL - s["top"], 0.0)
    return [Column(-over, 0.5, "share")]


def _engine_brake_settings(e: Evidence) -> Iterator[Settings]:
    command = e["engine_command"][e.valid]
    base: Settings = {
        "small": 0.03 * float(np.nanmax(np.abs(command), initial=0.0)),
        "reference": lever_reference(e),
    }
    if np.nanmin(command, initial=0.0) < 0:
        full = float(-np.nanmin(command))
        yield base | {"by": "demand", "full": full, "order": 0, "geared": False}
        if e.has("ratio", "engine_speed"):
            yield from (base | {"by": "demand", "full": full, "order": k, "geared": True} for k in (0, 1, 2))
    for after_s in (0.0, 0.7):  # valves and vanes take a moment
        if e.has("ratio", "engine_speed"):
            yield base | {"by": "engine_speed", "order": 1, "after_s": after_s}
            yield base | {"by": "engine_speed", "order": 2, "after_s": after_s}
        yield base | {"by": "speed", "after_s": after_s}
        yield base | {"by": "nothing", "after_s": after_s}
    # its stage is chosen by hand, or by whatever else the simulator is not told
    yield from (base | {"by": "stage"} | slow for slow in slow_settings(e, -_coasting(base["small"]), 0.3))


def _coasting(small: float) -> Expression:
    """One where the engine is asked for nothing and does not pull, else zero."""
    return (small + 1e-9 > ENGINE_COMMAND) * (ENGINE < 0.05)


def _engine_brake(s: Settings) -> list[Column]:
    if s["by"] == "demand":
        return [
            Column(minimum(ENGINE_COMMAND, 0.0) / s["full"], 0.3, "force_at_full_demand", "N", per_mass=True)
        ]
    coast = _coasting(s["small"])
    if s["by"] == "stage":
        return slow_columns(s, -coast, "force", "N", sign=1, per_mass=True)
    if s.get("after_s"):
        coast = coast * (Since((1.0 - coast,)) > s["after_s"])
    if s["by"] == "engine_speed":
        drive = coast * (LEVER / s["reference"]) * (ENGINE_SPEED / OMEGA)
        parts = [Column(-drive, 0.1, "force_at_150_rad_s", "N", per_mass=True)]
        if s["order"] == 2:
            parts.append(Column(-(drive * ENGINE_SPEED / OMEGA), 0.1, "force_square", "N", per_mass=True))
        return parts
    if s["by"] == "speed":
        return [Column(-(coast * SPEED / 20.0), 0.1, "force_at_20_m_s", "N", per_mass=True)]
    return [Column(-coast, 0.1, "force", "N", per_mass=True)]


def _friction_settings(e: Evidence) -> Iterator[Settings]:
    reference = lever_reference(e)
    for order in (0, 1):
        yield {"reference": reference, "order": order, "cold_s": None}
    for cold_s in (60.0, 200.0, 600.0, 1500.0):
        yield {"reference": reference, "order": 0, "cold_s": cold_s}
        if 1 < len(e.stretches) <= MOST_KNOTS:
            yield {"reference": reference, "order": 0, "cold_s": cold_s} | each_recording(e)


def _friction(s: Settings) -> list[Column]:
    drive = LEVER / s["reference"]
    if s["order"] == 1:
        drive = drive * ENGINE_SPEED / OMEGA
    if s["cold_s"] is not None:
        drive = drive * exp(-(ELAPSED / s["cold_s"]))
    if "each" in s:  # every drive starts as cold as it happens to be
        return [
            Column(-(drive * here), 0.05, f"force[{name}]", "N", per_mass=True) for name, here in in_each(s)
        ]
    return [Column(-drive, 0.03, "force", "N", per_mass=True)]


PER_POWER = -(1.0 / maximum(SPEED, 3.0))


def _accessory_settings(e: Evidence) -> Iterator[Settings]:
    """A power, or a torque at the engine: a pump's is always the same, a fan's grows with speed squared."""
    yield {}
    yield from slow_settings(e, PER_POWER, 2.0)
    if e.has("ratio", "engine_speed"):
        reference = lever_reference(e)
        for order in (0, 2):
            torque = _at_the_engine(reference, order)
            yield from ({**s, "reference": reference, "order": order} for s in slow_settings(e, torque, 0.3))


def _at_the_engine(reference: float, order: int) -> Expression:
    lever = LEVER / reference
    return -(lever * (ENGINE_SPEED / OMEGA) ** order) if order else -lever


def _accessories(s: Settings) -> list[Column]:
    if "order" in s:
        torque = _at_the_engine(s["reference"], s["order"])
        return slow_columns(s, torque, "force", "N", sign=1, per_mass=True)
    if "knots" in s:
        return slow_columns(s, PER_POWER, "power", "W", sign=1, per_mass=True)
    return [Column(PER_POWER, 0.5, "power", "W", per_mass=True)]


MECHANISMS = (
    Mechanism(
        "turbo_lag",
        "F = -(F_cmd - F_boost);  tau dF_boost/dt = F_cmd - F_boost while rising",
        "engine torque builds up later than commanded",
        ("engine",),
        ("rate of engine command",),
        "Rakopoulos and Giakoumis, Diesel Engine Transient Operation",
        "step the engine command up and down at constant speed",
        _turbo_settings,
        _turbo,
    ),
    Mechanism(
        "torque_derate",
        "F = -k L F_engine, L the load soaked in (or altitude, or outside heat, or power)",
        "the engine gives less than commanded under lasting load, height or heat",
        ("engine", "speed"),
        ("sustained load", "elevation", "ambient temperature"),
        "SAE J1349 correction; thermal derating practice",
        "hold full torque for several minutes, then repeat after idling",
        _derate_settings,
        _derate,
        hidden=True,
    ),
    Mechanism(
        "torque_limit",
        "F = -s max(F_engine - F_max, 0)",
        "a limiter or governor cuts the engine above a threshold",
        ("engine", "speed"),
        ("engine command", "speed"),
        "SAE J1939-71 torque and speed limits; ECE R89",
        "command full torque from low to top speed",
        _limit_settings,
        _limit,
    ),
    Mechanism(
        "engine_brake",
        "F = -c n(w) r, or -F0(t) by stages, with the engine command at or below zero",
        "the engine retards more on the overrun than the simulator knows",
        ("engine_command", "engine", "speed"),
        ("engine command", "engine speed"),
        "SAE J1621 retarder torque curves",
        "coast in gear and in neutral from the same speed",
        _engine_brake_settings,
        _engine_brake,
    ),
    Mechanism(
        "engine_friction",
        "F = -r (c0 + c1 w), larger while cold",
        "the engine turns harder than the simulator knows",
        ("ratio", "engine_speed"),
        ("engine speed", "gear", "time since start"),
        "Chen-Flynn friction model; Heywood, ch. 13",
        "coast in two gears from the same speed, cold and warm",
        _friction_settings,
        _friction,
        prior=0.7,
    ),
    Mechanism(
        "accessory_load",
        "F = -P / v, or -T r (1, or w^2)",
        "something besides the wheels takes engine power",
        ("speed", "engine"),
        ("speed", "engine speed", "time since standing"),
        "fan, compressor and air conditioning loads: NREL heavy-vehicle accessory studies",
        "hold the same road load with the fan on and off",
        _accessory_settings,
        _accessories,
        hidden=True,
        prior=0.7,
    ),
)
