"""Laws without a name: how a force may follow the recorded signals, whatever the physics.

A law is a carrier (the pull, the brake force, the square of speed ...) times any function of one variable, or
a slow or swinging follower of one of the forces. What is left beside a named mechanism is tried on all of
them, so that a name is only as good as the share it explains of what any law does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import (
    Change,
    Expression,
    Interpolated,
    Lag,
    Signal,
    Since,
    Slosh,
    absolute,
    lift,
    maximum,
    minimum,
)
from deeptruck_model.mismatch.mechanisms.base import (
    CandidateTerm,
    Column,
    Mechanism,
    candidate_terms,
)
from deeptruck_model.mismatch.mechanisms.own_forms import apart
from deeptruck_model.mismatch.mechanisms.symbols import (
    BRAKE,
    ELAPSED,
    ENGINE,
    GEAR,
    PULL,
    SIMULATED,
    SPEED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, Simple, Static
from deeptruck_model.mismatch.residual.evidence import Evidence

KNOTS = 5  # of a function of one variable
LEAST_CARRIER = 0.01  # rms
SINCE = "time since "
SOON_S = (0.0, 0.6, 1.2, 2.5, 5.0, 15.0, 60.0, 120.0)
NEVER_S = SOON_S[-1]  # what happened longer ago no longer matters
ACTING = 0.1  # m/s^2: a force that is on
CARRIERS: dict[str, tuple[Expression, float]] = {  # with the sd of the function it is multiplied by
    "force": (lift(1.0), 0.1),
    "engine": (PULL, 0.3),
    "overrun": (minimum(ENGINE, 0.0), 0.3),
    "brake": (BRAKE, 0.3),
    "coasting": ((ENGINE < 0.05) * (BRAKE < 0.05), 0.1),
    "speed squared": ((SPEED / 20.0) ** 2, 0.3),
    "simulated": (SIMULATED, 0.3),
}
CARRIED_BY: dict[str, frozenset[str]] = {  # coasting is known by both forces and is the engine's
    name: frozenset({"engine"}) if name == "coasting" else x.signals() for name, (x, _) in CARRIERS.items()
}
FORCES = {"engine": ENGINE, "brake": BRAKE, "simulated": SIMULATED}
SENSED = FORCES | {"slope": Signal("grade") * -GRAVITY}  # what a sensor may tell late
LAGS_S, ORDERS = (0.2, 0.5, 1.2, 3.0), (1, 3)
SWINGS_HZ = (0.15, 0.25, 0.4, 0.6, 0.9, 1.3, 1.8)


RECORDED = ("lever", "grade", "engine_command", "brake_command", "engine_speed", "gap", "ambient_temperature")
EVENTS = {
    "braking": BRAKE > ACTING,
    "the brake was off": BRAKE < ACTING / 2,
    "pulling": PULL > ACTING,
    "the engine was idle": PULL < ACTING / 5,
    "standing": SPEED < 0.5,
    "a shift": absolute(Change((GEAR,))) > 0.5,
}
POWERS = {"engine power": PULL * SPEED, "braking power": BRAKE * SPEED}
# What a law may be a function of, by the name people are told.
VARIABLES: dict[str, Expression] = (
    {"speed": SPEED, "engine": PULL, "brake": BRAKE, "elapsed": ELAPSED}
    | {name: Signal(name) for name in RECORDED}
    | {
        f"{n} over {t:.0f} s": Lag((x,), t, cold=True)
        for n, x in POWERS.items()
        for t in (3.0, 20.0, 100.0, 600.0)
    }
    | {"speed over 60 s": Lag((SPEED,), 60.0), "speed over 300 s": Lag((SPEED,), 300.0, cold=True)}
    | {SINCE + name: minimum(Since((x,)), NEVER_S) for name, x in EVENTS.items()}
)
NEEDS = {SINCE + "a shift": "gear"} | {name: name for name in RECORDED}


How = Literal["late", "late up or down", "swinging"]
HOWS: tuple[How, ...] = ("late", "late up or down", "swinging")


@dataclass(frozen=True)
class Law(Constants):
    """A carrier of `CARRIERS` times a function of a variable of `VARIABLES`, by its knots."""

    carrier: str
    of: str
    at: tuple[float, ...]


@dataclass(frozen=True)
class Follower(Constants):
    """What follows a force of `SENSED`."""

    force: str
    how: How


def _variants(e: Evidence) -> Iterator[Static]:
    """Every carrier with every variable, and every follower."""
    rms = {name: float(np.sqrt(np.mean(x.rows(e)[e.valid] ** 2))) for name, (x, _) in CARRIERS.items()}
    known = {of: x for of, x in VARIABLES.items() if of not in NEEDS or e.has(NEEDS[of])}
    for of, x in known.items():
        at = _knots(of, x.rows(e)[e.valid])
        for carrier in CARRIERS if len(at) > 2 else ():
            if rms[carrier] > LEAST_CARRIER and not (carrier == "simulated" and e.model_discrepancy > 0):
                yield Static(Law(carrier, of, at))
    for name, force in FORCES.items():
        if name == "simulated" and e.model_discrepancy > 0:
            continue  # what a learned simulator learned badly is in its acceleration too, and no law of it
        if float(np.std(force.rows(e)[e.valid])) > LEAST_CARRIER:
            for how in HOWS:
                if name != "simulated" or how == "swinging":  # what answers late throughout is the sensor
                    yield Static(Follower(name, how))


def _knots(of: str, x: NDArray[np.float64]) -> tuple[float, ...]:
    """Values of a variable x (n,) between which a law runs straight: as much driving between any two, but
    soon after an event, where most happens."""
    if of.startswith(SINCE):
        return tuple(t for t in SOON_S if x.min() <= t <= x.max())
    return apart(np.quantile(x, np.linspace(0.0, 1.0, KNOTS)))


def _columns(v: Simple) -> list[Column]:
    match v.constants:
        case Law() as law:
            return _of_law(law)
        case Follower(name, how):
            parts = _followers(SENSED[name], how)
            return [Column(x, 0.4, f"{how} {i}", sign=0) for i, x in enumerate(parts)]
    raise TypeError(f"{v!r} is no law")


def _of_law(law: Law) -> list[Column]:
    carrier, sd = CARRIERS[law.carrier]
    x, at = VARIABLES[law.of], law.at
    hats = [Interpolated((x,), at, tuple(row)) for row in np.eye(len(at)).tolist()]
    return [
        Column(carrier * hat, sd, f"{law.carrier} at {v:.3g}", sign=0)
        for v, hat in zip(at, hats, strict=True)
    ]


def _followers(force: Expression, how: How) -> list[Expression]:
    if how == "swinging":
        return [Slosh((force,), f, 0.1) for f in SWINGS_HZ]
    late: list[Expression] = [_late(force, tau, order) - force for tau in LAGS_S for order in ORDERS]
    split = [minimum(x, 0.0) for x in late[::2]] + [maximum(x, 0.0) for x in late[::2]]
    return late if how == "late" else split


LAW = Mechanism(
    "unknown",
    "F = c f(x)",
    "a force follows the recorded signals as no known one does",
    (),
    (),
    "",
    "vary one signal alone, with everything else held",
    _variants,
    _columns,
)


LATE_SENSOR = Mechanism(
    "late sensor",
    "a(t) -> a filtered",
    "filters make the response, or the slope, late",
    (),
    (),
    "",
    "",
    lambda e: (
        Static(Follower(name, "late")) for name in ("simulated", "slope") if name != "slope" or e.has("grade")
    ),
    _columns,
    kind="measurement_fault",
    force=False,
)


def laws(e: Evidence) -> list[CandidateTerm]:
    """Every law on this evidence; each pays for having been picked among them."""
    found = candidate_terms(LAW, e)
    return [replace(s, trials=float(len(found))) for s in found]


def leans_on(law: Constants) -> tuple[str, ...]:
    """The signals of a law by name, the most telling first. Raises TypeError for what is no law."""
    match law:
        case Follower(force):
            return (force,)
        case Law(carrier, of):
            return (of, *([carrier] if carrier in ("engine", "brake", "simulated") else []))
    raise TypeError(f"{law!r} is no law")


def acts_by(law: Constants) -> frozenset[str]:
    """The signals that a law is made of. Raises TypeError for what is no law."""
    match law:
        case Follower(force):
            return frozenset({force})
        case Law(carrier, of):
            return CARRIED_BY[carrier] | VARIABLES[of].signals()
    raise TypeError(f"{law!r} is no law")


def law_signal(name: str) -> Expression:
    """What is behind a name of `leans_on`."""
    return VARIABLES.get(name) or FORCES[name]


def _late(force: Expression, tau_s: float, order: int) -> Expression:
    for _ in range(order):
        force = Lag((force,), tau_s / order)
    return force
