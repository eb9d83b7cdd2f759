"""The forms a name may take on beside its textbook ones: any course of its own variables.

Fade is a loss of brake force that grows with the heat soaked in; by which curve is another truck's matter.
So every name also offers its carrier times a curve through a few knots that only rises, only falls, or runs
as it likes, and names compete by what they act on and in which direction, not by one formula.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression import (
    Change,
    Expression,
    Interpolated,
    Lag,
    RisingLag,
    Signal,
    Since,
    absolute,
    lift,
    maximum,
    minimum,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    BRAKE,
    DRAG,
    ELAPSED,
    ENGINE,
    ENGINE_SPEED,
    GEAR,
    OMEGA,
    OVERALL_RATIO,
    PULL,
    SIMULATED,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import OwnCurve
from deeptruck_model.mismatch.residual.evidence import Evidence

PER_POWER = -(1.0 / maximum(SPEED, 3.0))
COASTING = ENGINE < 0.02
BRAKED = Since((BRAKE > 0.05,)) < Since(
    (PULL > 0.05,)
)  # the first touch of the brake may set a retarder going
Array = NDArray[np.float64]

EVEN = (0.02, 0.35, 0.65, 0.98)
SOON = (0.02, 0.12, 0.25, 0.4, 0.55, 0.75, 0.98)  # of seconds
UPPER = (0.4, 0.7, 0.85, 0.93, 0.97, 0.995)
ACTING = 0.1  # of the carrier's largest: where it says little no knot is worth having
NEAREST = 0.04  # of the whole way, between knots
LEAST_ROWS = 50
NEVER_S = 120.0
ALONE_M = 150.0  # behind nobody
LOCKED_M_S = 12.0  # faster, no truck's converter slips
SIZE = 0.1  # m/s^2 sd of a force that is no share of another


@dataclass(frozen=True)
class Form:
    """`carrier` times a curve of `of`. `trend` is how the curve may run; one that rises or falls without
    `level` vanishes at its low end. `share`: the carrier is a force of which the curve is a share."""

    carrier: Expression
    of: Expression
    by: str
    trend: Literal["rising", "falling", "any"]
    level: bool = False
    share: bool = True
    sd: float = 0.3
    needs: tuple[str, ...] = ()
    knots: tuple[float, ...] = EVEN  # quantiles of `of` where the carrier acts
    when: str = ""  # in words, where the carrier is there part of the time alone


def _heated(power: Expression, over_s: float) -> Expression:
    return Lag((power,), over_s, cold=True)


SHIFTED = Since((absolute(Change((GEAR,))) > 0.5,))
UP, DOWN = Since((Change((GEAR,)) > 0.5,)), Since((Change((GEAR,)) < -0.5,))
TORQUE = PULL / maximum(OVERALL_RATIO, 0.05)
STOOD = minimum(Since((SPEED < 0.5,)), 60.0)
GEARED = ("ratio", "engine_speed")
PUMP = OVERALL_RATIO * -1.0  # a pump takes a torque, a fan one with speed squared
FAN = OVERALL_RATIO * (ENGINE_SPEED / OMEGA) ** 2 * -1.0
LATE = RisingLag((PULL,), 1.0) - PULL
GRIPPED = PULL - BRAKE  # what the tyres hold

OWN: dict[str, tuple[Form, ...]] = {
    "brake_fade": tuple(
        Form(BRAKE, _heated(BRAKE * SPEED, t), f"braking power over {t:.0f} s", "rising")
        for t in (20.0, 60.0, 200.0, 600.0)
    ),
    "dragging_brake": (
        Form(
            (BRAKE < 0.05) * -1.0,
            minimum(Since((BRAKE > 0.1,)), NEVER_S),
            "time since braking",
            "any",
            share=False,
            when="while the brake is off",
        ),
        *(
            Form(
                lift(-1.0), _heated(BRAKE * SPEED, t), f"braking power over {t:.0f} s", "rising", share=False
            )
            for t in (60.0, 200.0)
        ),
    ),
    "drafting": tuple(
        Form(
            DRAG,
            minimum(Signal("gap", missing=ALONE_M, simulated=ALONE_M), ALONE_M),
            "gap",
            trend,
            needs=("gap",),
        )
        for trend in ("falling", "any")
    ),
    "rolling_resistance_speed": tuple(
        Form(lift(-1.0), SPEED, "speed", trend, share=False) for trend in ("rising", "any")
    ),
    "rolling_resistance_warmup": (
        Form(lift(-1.0), ELAPSED, "time since start", "falling", share=False),
        Form(lift(-1.0), Lag((SPEED,), 300.0, cold=True), "speed over 300 s", "falling", share=False),
    ),
    "turbo_lag": (Form(LATE, ENGINE_SPEED, "engine speed", "falling", level=True, needs=("engine_speed",)),),
    "torque_derate": (
        *(
            Form(PULL * -1.0, _heated(PULL * SPEED, t), f"engine power over {t:.0f} s", "rising")
            for t in (20.0, 60.0, 200.0, 600.0)
        ),
        Form(PULL * -1.0, PULL * SPEED, "engine power", "rising", level=True),
        Form(PULL * -1.0, ENGINE_SPEED, "engine speed", "rising", level=True, needs=("engine_speed",)),
        Form(
            PULL * -1.0,
            maximum(Signal("elevation") - 500.0, 0.0),
            "metres above 500",
            "rising",
            needs=("elevation",),
        ),
        Form(
            PULL * -1.0,
            maximum(Signal("ambient_temperature") - 20.0, 0.0),
            "kelvins above 20 degrees outside",
            "rising",
            needs=("ambient_temperature",),
        ),
    ),
    "torque_limit": (
        *(
            Form(PULL * -1.0, of, by, "rising", sd=0.6, needs=needs, knots=UPPER)
            for of, by, needs in (
                (TORQUE, "torque", ("ratio",)),
                (PULL, "engine force", ()),
                (SPEED, "speed", ()),
                (PULL * SPEED, "engine power", ()),
                (ENGINE_SPEED, "engine speed", ("engine_speed",)),
                (Lag((SIMULATED,), 0.5), "acceleration", ()),  # a governor that holds it
            )
        ),
        # a feed pump, or a map of the pedal, that gives less at low speed
        Form(PULL * -1.0, ENGINE_SPEED, "engine speed", "falling", sd=0.6, needs=("engine_speed",)),
    ),
    "engine_brake": tuple(
        Form(
            -(acts * overall_ratio), of, by, "rising", level=by != "time", share=False, needs=needs, when=when
        )
        for acts, when in (
            (COASTING, "while coasting"),
            (COASTING * (BRAKE > 0.05), "while coasting with the brake on"),
            (COASTING * BRAKED, "while coasting since a touch of the brake"),
        )
        for overall_ratio, of, by, needs in (
            (lift(1.0), SPEED, "speed", ()),
            (OVERALL_RATIO, ENGINE_SPEED, "engine speed", ("ratio", "engine_speed")),
            (OVERALL_RATIO, minimum(Since((1.0 - acts,)), 6.0), "time", ("ratio",)),
        )
    ),
    "accessory_load": (
        *(
            Form(PER_POWER, _heated(PULL * SPEED, t), f"engine power over {t:.0f} s", "rising", share=False)
            for t in (60.0, 200.0)
        ),
        Form(
            PER_POWER, minimum(Since((BRAKE > 0.1,)), NEVER_S), "time since braking", "falling", share=False
        ),
        Form(PER_POWER, ENGINE_SPEED, "engine speed", "rising", share=False, needs=("engine_speed",)),
        *(
            Form(
                torque,
                _heated(PULL * SPEED, 60.0),
                "engine power over 60 s",
                "rising",
                share=False,
                needs=GEARED,
            )
            for torque in (PUMP, FAN)
        ),
        *(
            Form(torque, STOOD, "time since standing", "falling", share=False, needs=GEARED)
            for torque in (PUMP, FAN)
        ),
        Form(PUMP, STOOD, "time since standing", "any", share=False, needs=GEARED),
    ),
    "engine_friction": (
        Form(
            OVERALL_RATIO * -1.0,
            ENGINE_SPEED,
            "engine speed",
            "rising",
            level=True,
            share=False,
            needs=("ratio", "engine_speed"),
        ),
        Form(OVERALL_RATIO * -1.0, ELAPSED, "time since start", "falling", share=False, needs=("ratio",)),
        # pumping work that keeps the exhaust hot, and oil films that load makes thin
        Form(
            OVERALL_RATIO * -1.0,
            _heated(PULL * SPEED, 20.0),
            "engine power over 20 s",
            "falling",
            share=False,
            needs=("ratio",),
        ),
    ),
    "driveline_loss": (
        Form(PULL * -1.0, OVERALL_RATIO, "ratio", "any", needs=("ratio",)),
        Form(absolute(ENGINE) * -1.0, SPEED, "speed", "rising", level=True),
        Form(
            absolute(ENGINE) * -1.0,
            ENGINE_SPEED,
            "engine speed",
            "rising",
            level=True,
            needs=("engine_speed",),
        ),
        Form(absolute(ENGINE) * -1.0, absolute(ENGINE), "engine force", "any"),
    ),
    "shift_interruption": (
        Form(
            maximum(Lag((PULL,), 1.5), PULL) * -1.0,
            minimum(SHIFTED, 4.0),
            "time since a shift",
            "falling",
            needs=("gear",),
        ),
        # what comes back later than simulated: up and down may each take their own time
        *(
            Form(PULL * -1.0, minimum(since, 4.0), by, "falling", needs=("gear",), knots=SOON)
            for since, by in (
                (SHIFTED, "time since a shift"),
                (UP, "time since a shift up"),
                (DOWN, "time since a shift down"),
            )
        ),
    ),
    "torque_converter_slip": (
        Form(PULL * -1.0, minimum(SPEED, LOCKED_M_S), "speed", "falling"),
        Form(PULL, minimum(SPEED, LOCKED_M_S), "speed", "falling"),
        # no lock-up while the oil is cold; a converter that fills again
        Form(PULL * -1.0, ELAPSED, "time since start", "falling"),
        Form(PULL * -1.0, STOOD, "time since standing", "falling"),
    ),
    "wheel_slip": tuple(
        Form(force * -1.0, absolute(force), by, "rising", sd=0.6, knots=UPPER)
        for force, by in ((PULL, "traction force"), (GRIPPED, "force of the tyres"))
    ),
    "rotating_inertia": (Form(SIMULATED * -1.0, OVERALL_RATIO, "ratio", "rising", needs=("ratio",)),),
}


def curves(effect: str, e: Evidence) -> Iterator[OwnCurve]:
    """Every curve of a name that these recordings can show.

    None for a learned simulator: what it learned badly runs in curves too.
    """
    for k, form in enumerate(OWN.get(effect, ())):
        if e.model_discrepancy > 0 or not e.has(*form.needs):
            continue
        carrier, x = np.abs(form.carrier.rows(e)), form.of.rows(e)
        acts = e.valid & (carrier > ACTING * float(np.quantile(carrier[e.valid], 0.98))) & (carrier > 0)
        if acts.sum() < LEAST_ROWS:
            continue
        at = apart(knots(x[acts], form.knots))
        if len(at) > 1:
            scale = float(np.sqrt(np.mean(carrier[acts] ** 2)))
            yield OwnCurve(k, at, 1.0 if form.share else scale)


def knots(x: Array, quantiles: tuple[float, ...]) -> Array:
    """Quantiles of x (n,); where most of it stands at its limit, of the rest, and the limit itself."""
    limit = float(x.max())
    below = x[x < limit]
    if len(below) < LEAST_ROWS or len(below) > 0.5 * len(x):
        return np.asarray(np.quantile(x, quantiles))
    return np.append(np.quantile(below, quantiles), limit)


def apart(at: NDArray[np.floating[Any]]) -> tuple[float, ...]:
    """Ascending knots, without those too near the one before: between them a curve would follow noise."""
    out = [float(at[0])]
    for x in at[1:]:
        if x - out[-1] > NEAREST * (at[-1] - at[0]):
            out.append(float(x))
    return tuple(out)


def curve(form: Form, at: Sequence[float]) -> Iterator[tuple[Expression, list[float]]]:
    """The pieces a curve is made of, none of which may be negative, and each one's values at the knots."""
    values = np.eye(len(at)) if form.trend == "any" else np.triu(np.ones((len(at), len(at))))
    if form.trend == "falling":
        values = 1.0 - values + np.eye(len(at))
    for row in values:
        if form.trend == "any" or form.level or not row.all():
            yield Interpolated((form.of,), tuple(at), tuple(row.tolist())), row.tolist()
