"""Driveline: losses, shifts, converter, inertia and play."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from deeptruck_model.mismatch.mechanisms.record import Column, Constants, Curve, Form, Mechanism, force, grid
from deeptruck_model.mismatch.mechanisms.symbols import (
    ACTS,
    CRAWL_SPEED,
    ELAPSED,
    ENGINE,
    ENGINE_SPEED,
    GEAR,
    OMEGA,
    OVERALL_RATIO,
    PULL,
    RATIO,
    SHIFTED,
    SIMULATED,
    SPEED,
    STOOD,
    geared,
    quantile,
    ramp,
    ratio_if_known,
    ratio_reference,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    Change,
    Lag,
    Play,
    Since,
    absolute,
    exp,
    lift,
    maximum,
    minimum,
)

SOON = (0.02, 0.12, 0.25, 0.4, 0.55, 0.75, 0.98)  # quantiles of seconds
LOCKED_M_S = 12.0  # faster, no truck's converter slips
UP, DOWN = Since((Change((GEAR,)) > 0.5,)), Since((Change((GEAR,)) < -0.5,))
SIGN = Change((ENGINE > 0.03,))
TIP_IN, TIP_OUT = Since((SIGN > 0.1,)), Since((SIGN < -0.1,))
MISSING = maximum(Lag((PULL,), 1.5), PULL)  # the pull before a shift, or that of now


def _gears(e: Evidence) -> Iterable[Constants]:
    gears = np.round(np.nan_to_num(e["gear"]))
    used = [float(g) for g in np.unique(gears) if g > 0 and (gears[e.valid] == g).mean() > 0.03]
    return [{"gears": tuple(used)}] if 1 < len(used) <= 16 else []


def _at_the_input(reference: float) -> list[Column]:
    """Drag at the input shaft and a share of the traction, as in regulation 2017/2400, annex VI."""
    drag = -(OVERALL_RATIO / reference)
    return [
        force(drag, 0.05, "drag"),
        force(drag * (ENGINE_SPEED / OMEGA), 0.05, "drag_per_speed"),
        Column(-PULL, 0.1, "share_of_pull"),
    ]


def _shifts(e: Evidence) -> bool:
    """Whether there are at least three gear changes."""
    gear = np.round(np.nan_to_num(e["gear"]))
    return bool(((np.abs(np.diff(gear)) > 0) & e.valid[1:]).sum() >= 3)


def _let_in(hold_s: float, return_s: float) -> Column:
    """Pull that is held back after a change of gear, and then let in by a ramp."""
    return Column(-(PULL * (1.0 - ramp(SHIFTED, hold_s, return_s))), 0.6, "share_of_pull")


def _metered(wait_s: float, rate: float) -> Column:
    """A clutch that slips: after a wait it carries a force per mass that rises by `rate` (m/s^3)."""
    carried = maximum(SHIFTED - wait_s, 0.0) * rate
    lost = maximum(absolute(ENGINE) - carried, 0.0)
    return Column(-(lost * (1.0 - (ENGINE < 0.0) * 2.0)), 0.6, "share_of_force")


def _dead(gap_s: float, wind_s: float) -> Column:
    """No torque while the play is open after it changes sign, then that of shafts that wind up."""
    since = minimum(TIP_IN, TIP_OUT)
    wound = exp(-(maximum(since - gap_s, 0.0) / wind_s))
    return Column(-(ENGINE * wound), 0.6, "share")


def _locked(e: Evidence) -> Iterable[Constants]:
    """The gears, and the ratio (rad/m) of each with the converter locked."""
    ratio, gear = e["ratio"], np.round(np.nan_to_num(e["gear"]))
    locked = {
        g: quantile(e, ratio, (gear == g) & (e["speed"] > CRAWL_SPEED), 0.1)
        for g in np.unique(gear[e.valid]).tolist()
        if g > 0
    }
    return [{"locked": tuple((float(g), r) for g, r in locked.items() if np.isfinite(r))}]


def _slipping(locked: tuple[tuple[float, float], ...]) -> Column:
    """Excess of the engine speed over that with the converter locked."""
    own = sum(((absolute(GEAR - g) < 0.5) * r for g, r in locked), lift(0.0))
    return Column(-(PULL * maximum(1.0 - own / maximum(RATIO, 0.01), 0.0)), 1.0, "share_per_slip", sign=0)


def _turning(reference: float, share: float) -> Column:
    """F = -J r^2 a with a the resulting acceleration: -a0 x / (1 + x), where x is the share of the mass;
    `share` is that at the ratio `reference` (rad/m)."""
    # first gear over top gear; beyond, the clutch slips
    x = (minimum(OVERALL_RATIO / reference, 20.0) ** 2) * share
    return Column(-(SIMULATED * (x / (x + 1.0))), 0.3, "share_of_mass", "1", share, mean=1.0)


def _strong_pull(e: Evidence) -> list[float]:
    """A large engine force, m/s^2; empty if there is hardly any."""
    size = quantile(e, np.abs(e["engine"]), np.abs(e["engine"]) > 0.0, 0.8)
    return [max(size, ACTS)] if np.isfinite(size) else []


def _plays(e: Evidence) -> Iterable[Constants]:
    """Plays by the time that a strong traction force takes to cross them, and the share of that force held by
    a soft spring."""
    for strong in _strong_pull(e):
        for turns_s, soft in itertools.product((0.15, 0.3, 0.6, 1.2), (0.0, 0.3)):
            yield {"reach": strong * turns_s, "holds": strong * soft, "reference": ratio_if_known(e)}


def _play(reach: float, holds: float, reference: float) -> Column:
    """A play, given by the force times time that crosses it and the force that a soft spring in it holds;
    both at the ratio `reference` (rad/m), zero if gears are not known."""
    play = Play((ENGINE / maximum(geared(reference), 0.05),), reach, holds)
    return Column(-(play * geared(reference)), 0.5, "share")


DRIVELINE_LOSS = Mechanism(
    "driveline_loss",
    "engine_driveline",
    says="the driveline loses a share of the torque it carries",
    equation="F = -k |F_engine|, or k by gear; F = -r (c0 + c1 w) - k F_engine",
    needs=("engine",),
    depends_on=("engine torque", "gear"),
    source="gear mesh efficiency: SAE J1266; Regulation (EU) 2017/2400, annex VI",
    manoeuvre="pull with the same torque in different gears, and coast in gear",
    forms={
        "share": Form(lambda: Column(-absolute(ENGINE), 0.15, "share_of_engine_force")),
        "by gear": Form(
            lambda gears: [
                Column(-(PULL * (absolute(GEAR - g) < 0.5)), 0.1, f"share_gear_{g:.0f}") for g in gears
            ],
            _gears,
            needs=("gear",),
        ),
        "by ratio": Form(
            lambda reference: Column(
                -(PULL * maximum(OVERALL_RATIO / reference - 1.0, 0.0)), 0.1, "share_per_ratio"
            ),
            lambda e: grid(reference=[ratio_reference(e)]),
            needs=("ratio",),
        ),
        "at the input": Form(
            _at_the_input, lambda e: grid(reference=[ratio_reference(e)]), needs=("ratio", "engine_speed")
        ),
        "ratio": Curve(PULL * -1.0, OVERALL_RATIO, "ratio", "any", needs=("ratio",)),
        "speed": Curve(absolute(ENGINE) * -1.0, SPEED, "speed", "rising", level=True),
        "engine speed": Curve(
            absolute(ENGINE) * -1.0,
            ENGINE_SPEED,
            "engine speed",
            "rising",
            level=True,
            needs=("engine_speed",),
        ),
        "engine force": Curve(absolute(ENGINE) * -1.0, absolute(ENGINE), "engine force", "any"),
    },
    mistaken_for="gear",
)

SHIFT_INTERRUPTION = Mechanism(
    "shift_interruption",
    "engine_driveline",
    says="traction is missing around gear changes",
    equation="F = -s F_engine for a while after a gear change",
    needs=("gear", "engine"),
    depends_on=("time since gear change",),
    source="automated manual transmissions: torque gap of 0.5-1.5 s",
    manoeuvre="accelerate through all gears at full torque",
    forms={
        "let in": Form(
            _let_in,
            lambda e: grid(hold_s=(0.4, 0.8), return_s=(0.3, 1.0)) if _shifts(e) else (),
            units={"hold_s": "s", "return_s": "s"},
            fitted={"hold_s": (0.1, 2.0), "return_s": (0.1, 3.0)},
        ),
        "slipping clutch": Form(
            _metered,
            lambda e: grid(wait_s=(0.3, 0.8), rate=(0.3, 1.0)) if _shifts(e) else (),
            units={"wait_s": "s", "rate": "m/s^3"},
            fitted={"wait_s": (0.05, 2.0), "rate": (0.05, 5.0)},
        ),
        "time since a shift": Curve(
            MISSING * -1.0, minimum(SHIFTED, 4.0), "time since a shift", "falling", needs=("gear",)
        ),
        # what comes back later than simulated: up and down may each take their own time
        **{
            f"pull, {by}": Curve(PULL * -1.0, minimum(since, 4.0), by, "falling", needs=("gear",), knots=SOON)
            for since, by in (
                (SHIFTED, "time since a shift"),
                (UP, "time since a shift up"),
                (DOWN, "time since a shift down"),
            )
        },
    },
    mistaken_for="gear",
)

TORQUE_CONVERTER_SLIP = Mechanism(
    "torque_converter_slip",
    "engine_driveline",
    says="the torque converter multiplies or loses torque at low speed",
    equation="F = -s F_engine exp(-v / v0)",
    needs=("engine", "speed"),
    depends_on=("speed", "engine torque"),
    source="SAE J643 converter characteristics",
    manoeuvre="launch at several torques with the converter locked and unlocked",
    forms={
        "by speed": Form(
            lambda scale_m_s: Column(-(PULL * exp(-(SPEED / scale_m_s))), 0.5, "share", sign=0),
            grid(scale_m_s=(2.0, 4.0, 8.0)),
            fitted={"scale_m_s": (1.0, 12.0)},
        ),
        "by ratio": Form(_slipping, _locked, needs=("ratio", "gear")),
        "loss": Curve(PULL * -1.0, minimum(SPEED, LOCKED_M_S), "speed", "falling"),
        "gain": Curve(PULL, minimum(SPEED, LOCKED_M_S), "speed", "falling"),
        # no lock-up while the oil is cold; a converter that fills again
        "time since start": Curve(PULL * -1.0, ELAPSED, "time since start", "falling"),
        "time since standing": Curve(PULL * -1.0, STOOD, "time since standing", "falling"),
    },
    mistaken_for="gear",
)

ROTATING_INERTIA = Mechanism(
    "rotating_inertia",
    "engine_driveline",
    says="rotating parts take a share of the acceleration, most in low gears",
    equation="F = -J r^2 a",
    needs=("ratio", "simulated"),
    depends_on=("gear", "acceleration"),
    source="Gillespie, Fundamentals of Vehicle Dynamics, eq. 2-9b",
    manoeuvre="accelerate with the same torque in a low and a high gear",
    forms={
        "engine and wheels": Form(
            lambda reference, share: [
                _turning(reference, share),
                Column(-SIMULATED, 0.03, "wheels_share_of_mass"),
            ],
            lambda e: grid(reference=[ratio_reference(e)], share=(0.004, 0.016)),
            fitted={"share": (0.0005, 0.2)},
        ),
        "ratio": Curve(SIMULATED * -1.0, OVERALL_RATIO, "ratio", "rising", needs=("ratio",)),
    },
    mistaken_for="gear",
)

DRIVELINE_BACKLASH = Mechanism(
    "driveline_backlash",
    "engine_driveline",
    says="the driveline has play when torque changes sign",
    equation="torque is carried only after the play is taken up, at each change between drive and overrun",
    needs=("engine",),
    depends_on=("sign of engine torque",),
    source="Lagerberg and Egardt, Backlash estimation with application to automotive powertrains, 2007",
    manoeuvre="tip in and out around zero torque in a high gear",
    forms={
        # a force of `size` (m/s^2), or a share of the engine's, that is missing for a while
        "force": Form(
            lambda window_s, size: [
                Column(-((window_s > TIP_IN) * size), 0.5, "tip_in"),
                Column((window_s > TIP_OUT) * size, 0.5, "tip_out"),
            ],
            lambda e: grid(window_s=(0.3, 0.7, 1.2), size=_strong_pull(e)),
            units={"window_s": "s"},
            fitted={"window_s": (0.1, 2.0)},
        ),
        "dead zone": Form(
            _dead,
            grid(gap_s=(0.2, 0.5), wind_s=(0.1, 0.4)),
            units={"gap_s": "s", "wind_s": "s"},
            fitted={"gap_s": (0.05, 2.0), "wind_s": (0.03, 1.0)},
        ),
        "play": Form(_play, _plays, fitted={"reach": (0.02, 2.0)}),
    },
    prior=0.7,
    mistaken_for="gear",
)

MECHANISMS = (
    DRIVELINE_LOSS,
    SHIFT_INTERRUPTION,
    TORQUE_CONVERTER_SLIP,
    ROTATING_INERTIA,
    DRIVELINE_BACKLASH,
)
