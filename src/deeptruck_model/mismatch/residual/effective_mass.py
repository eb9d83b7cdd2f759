"""The effective-mass gain: the acceleration due to a force on the truck is less than force over mass.

Wheels and engine accelerate with the truck, with more inertia in lower gears; and brakes that hold a
commanded deceleration compensate any other force within a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array, Indices
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Expression, Lag, Signal, lift
from deeptruck_model.simulators import Simulator, free_run
from deeptruck_model.trucks.compiled import entry

HELD_UNIT = "m/s^2"  # of a brake command that is a deceleration
BRAKED = 0.05  # m/s^2: the brake switch
HOLD_S, ORDER = 0.25, 3  # valves, and the controller that holds the deceleration: lags in a row
RELEASED_S = 1.0  # for which such brakes still compensate a force after the pedal is let go
ASKED, ASKED_AT, ASKED_S = 1.5, 15.0, 3.0  # m/s^2, from m/s, for s
ASKED_MORE = 0.005  # of rolling resistance or slope

EFFECTIVE_MASS_GAIN = Signal("effective_mass_gain", missing=1.0)
HOLDS = Signal("holds", missing=0.0)  # one while brakes hold a commanded deceleration
MADE_UP = Signal("made up", missing=0.0)  # the share of a steady force that they have compensated by then


@dataclass(frozen=True, eq=False)
class WithEffectiveMass(Expression):
    """The acceleration that a force per mass causes, (n,).

    A steady force times `effective_mass_gain`. While brakes hold a deceleration, they compensate a change of
    the force, which therefore acts for a limited time.
    """

    inputs: tuple[Expression, ...]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        force, gain, holds, made_up = values
        if not holds.any():
            return force * gain
        late = _late(holds * force, np.array([s.start for s in e.drives]), float(np.exp(-e.dt / HOLD_S)))
        return force * gain + made_up * force - holds * late

    def begin(self, batch: int) -> Any:
        return np.zeros((ORDER, batch))

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        force, gain, holds, made_up = values
        keep, after, late = np.exp(-dt / HOLD_S), np.empty_like(memory), holds * force
        for k in range(ORDER):
            late = after[k] = keep * memory[k] + (1.0 - keep) * late
        return force * gain + made_up * force - holds * late, after


@entry
def _late(held_force: Array, starts: Indices, keep: float) -> Array:
    """The part of a force that brakes have compensated while they hold, (n,); restarted in each recording, at
    one of `starts`."""
    out, memory, following = np.empty_like(held_force), np.zeros(ORDER), 0
    for i in range(len(held_force)):
        if following < len(starts) and i == starts[following]:
            memory[:] = 0.0
            following += 1
        late = held_force[i]
        for k in range(ORDER):
            late = memory[k] = keep * memory[k] + (1.0 - keep) * late
        out[i] = late
    return out


def with_effective_mass(force: Expression) -> Expression:
    """The acceleration that a force per mass causes, along a recording or in a simulation."""
    return WithEffectiveMass((force, EFFECTIVE_MASS_GAIN, HOLDS, MADE_UP))


def free(inside: Mapping[str, Array]) -> Array | None:
    """Ratio of the mass to the effective mass with rotating inertia, if the simulator reports what it
    needs."""
    known = {"mass", "effective_mass"} <= inside.keys()
    return inside["mass"] / inside["effective_mass"] if known else None


def holds(simulator: Simulator) -> bool:
    """Whether the brakes hold a commanded deceleration, and so compensate other forces.

    A command in m/s^2 may also be a force in another unit, so the truck is tested: whether it decelerates
    more with more rolling resistance, or, if it has none but takes slope as an input, on an uphill slope. Any
    other truck with such a command is assumed to hold the deceleration.
    """
    interface, own = simulator.interface, simulator.parameters().get("rolling_resistance")
    if interface.brake_unit != HELD_UNIT or (own is None and not interface.grade):
        return interface.brake_unit == HELD_UNIT
    n, more = round(ASKED_S / simulator.dt) + 1, ASKED_MORE
    u, w = np.zeros((1, n, len(interface.u))), np.zeros((1, n, len(interface.w)))
    u[:, :, interface.u.index("brake_command")] = ASKED
    steeper, other = w.copy(), simulator
    if own is None:
        steeper[:, :, interface.w.index("grade")] = more
    else:
        try:
            other = simulator.with_parameters({"rolling_resistance": own + more})
        except InputError:  # of one near its upper bound
            more = -own / 2.0
            other = simulator.with_parameters({"rolling_resistance": own + more})
    y0 = np.zeros((1, len(interface.y)))
    y0[:, SPEED] = ASKED_AT
    own_mean, other_mean = (
        free_run(truck, u, slope, y0).y[0, n // 2 :, ACCELERATION].mean()
        for truck, slope in ((simulator, w), (other, steeper))
    )
    return bool((own_mean - other_mean) / more < 0.5 * GRAVITY)


def held(holds: bool) -> Expression:
    """Share of a force that is not compensated by brakes: one if they hold no deceleration."""
    if not holds:
        return lift(1.0)
    braking = Signal("brake_command") > BRAKED
    made_up: Expression = braking
    for _ in range(ORDER):
        made_up = Lag((made_up,), HOLD_S, cold=True)
    return 1.0 - braking * made_up


def holding(holds: bool, signals: Mapping[str, Array], left: Array) -> dict[str, Array]:
    """The signals of brakes that hold a deceleration, (n,) each; none if they do not, or are not recorded.
    `left` is the result of `held`."""
    if not holds:
        return {}
    braking = np.nan_to_num(signals["brake_command"]) > BRAKED
    return {"holds": braking.astype(float), "made up": 1.0 - left}


def rows(simulator: Simulator, e: Evidence, turning: Array, held_by_brakes: bool) -> Array:
    """Acceleration for a unit force per mass along the recordings, (n,); `turning` is the gain without the
    action of the brakes. While the brakes hold a deceleration it follows the simulator's response to more
    rolling resistance."""
    out: Array = turning * held(held_by_brakes).rows(e)
    change, own = e.sensitivity.get("rolling_resistance"), simulator.parameters().get("rolling_resistance")
    if not held_by_brakes or change is None or not own:
        return out
    near = e.since(np.nan_to_num(e["brake_command"]) > BRAKED) < RELEASED_S
    return np.where(near, np.clip(-change / (GRAVITY * own), -0.3, 1.0), out)
