"""The capabilities that a shield assumes of the truck: a promise measured on a simulator, and its
brake fade.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.shield import Promise
from deeptruck_cacc.safety.truck_limits import measure
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

DESCENT, DESCENT_S, STOP_S = -0.05, 300.0, 3.0
RESERVE = 0.05
SPEEDS = np.array([12.0, 15.0, 18.0])  # m/s, held on the descent


def believed(simulator: Simulator, *, hot: bool = False) -> Promise:
    """The promise measured on this simulator; with `hot` on a descent of 5 % as well, with the fade it has
    there."""
    if not hot:
        return measure(simulator)
    return with_fade(measure(simulator, worst_grade=DESCENT), simulator)


def with_fade(promise: Promise, simulator: Simulator) -> Promise:
    """The promise with the share of braking that is left after five minutes downhill.

    The heat is estimated as the shield estimates it, so both have the same error; fade begins with the first
    joule.
    """
    cold, _ = _stop(simulator, promise, 1.0)
    hot, heat = _stop(simulator, promise, DESCENT_S)
    left = float(np.clip(np.min(hot / cold), 0.05, 1.0))
    lost = (1.0 - left) * (1 + RESERVE)
    least = max(1.0 - 1.5 * lost, 0.1)  # the stop itself heats further
    return replace(promise, fade_from=0.0, fade_per_heat=lost / float(heat.min()), least_braking_share=least)


def _stop(simulator: Simulator, promise: Promise, seconds: float) -> tuple[Array, Array]:
    """Mean deceleration of full braking after `seconds` of constant speed downhill, and the heat (J/kg)."""
    scale, dt, batch = ActionScale.of(simulator), simulator.dt, len(SPEEDS)
    y = np.zeros((batch, len(simulator.interface.y)))
    y[:, SPEED] = SPEEDS
    state, w = simulator.reset(y), np.full((batch, len(simulator.interface.w)), DESCENT)
    heat, held, begin = np.zeros(batch), np.zeros(batch), SPEEDS
    for k in range(round((seconds + STOP_S) / dt)):
        braking = k * dt >= seconds
        begin = y[:, SPEED] if not braking else begin
        held = np.clip(held + 0.02 * (y[:, SPEED] - SPEEDS) * dt, 0.0, 1.0)
        share = np.ones(batch) if braking else np.clip(held + 0.2 * (y[:, SPEED] - SPEEDS), 0.0, 1.0)
        u = np.column_stack([np.full(batch, scale.engine_low), share * scale.brake_high])
        state, y = simulator.step(state, u, w)
        if not braking:
            heat = promise.heat_after(heat, share, y[:, SPEED])
    return (begin - y[:, SPEED]) / STOP_S, heat
