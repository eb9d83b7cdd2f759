"""Model predictive control on a simulator of the truck, including its gear changes and lags.

Every step it runs the simulator over HORIZON_S, differentiates that run with respect to the pedal at KNOTS_S,
and takes one Gauss-Newton step from its last plan: the real-time iteration of Diehl, Bock and Schlöder
(2005), SIAM J. Control Optim. 43(5). Derivatives are finite differences between runs in one batch, so that
any simulator can be used and a deep truck's compiled step is used. A small pedal change may have no effect,
as in dead travel or at full load, and a downshift begins with a second without torque; pedals held constant
over the horizon are therefore tried too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.controllers.law import LEAST_GAP_M, Perception, Seen
from deeptruck_cacc.controllers.policy import TYPICAL, Observation
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model.simulators import Simulator

HORIZON_S = 4.0  # long enough for a downshift of a second without torque to pay
KNOTS_S = np.array([0.0, 0.2, 0.5, 1.0, 2.0, 4.0])  # the plan is straight between them
NUDGE = (
    0.1  # of the pedal's reach, for the derivatives: over a dead travel and the noise of a float32 network
)
LENGTHS = np.array([0.0, 1.0, 0.7, 0.5, 0.3, 0.15, 0.05])  # of a step tried side by side
HELD = np.array([-0.5, -0.1, 0.0, 0.15, 0.3, 0.6, 1.0])  # pedals tried for the whole horizon
STEPS = len(LENGTHS)
ROWS = STEPS + len(HELD)  # runs of a truck side by side; the plan and its six nudges are as many as LENGTHS
# Costs of a pedal change squared per second and of a metre below the least gap squared, where 1 (m/s)^2 off
# the ideal follower costs 1; chosen on validation scenes of a deep truck.
CHANGE_COST, TOO_NEAR = 0.02, 10.0
# m/s^2, by which a closed gap is planned to end; a plan is exceeded by a fifth, and 1 m/s^2 is not to be.
APPROACH = 0.8
DAMPING = 1e-3  # Levenberg's, of the pedals
CORRECTION_S = 0.5  # time constant of the acceleration that the truck has beyond the simulator


@dataclass
class Planner:
    """Plans one signed pedal (1 full engine, -1 full brake) on `simulator` and applies its beginning. Same
    contract as Policy.

    The simulator runs along with the truck: it is fed the measured speed and the commands given, and the
    difference of its acceleration is added to all plans.
    """

    simulator: Simulator
    _past: _Past | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.scale, self.dt = ActionScale.of(self.simulator), self.simulator.dt
        self._perceive = Perception(self.dt)
        self._least = -1.0 if self.interface.brake_unit else 0.0
        self._time: Array = self.dt * np.arange(1.0, round(HORIZON_S / self.dt) + 1, dtype=float)
        self._basis = _straight(self._time - self.dt)  # (n, knots)
        self._later = _straight(np.minimum(KNOTS_S + self.dt, KNOTS_S[-1]))

    @property
    def interface(self) -> TruckInterface:
        """The interface of the simulator."""
        return self.simulator.interface

    def reset(self) -> None:
        """Forget the past."""
        self._perceive.reset()
        self._past = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,); NaN if an observation is
        NaN."""
        seen, grade = self._perceive(observation)
        known = np.isfinite(seen.speed + seen.gap + seen.leader_speed + seen.target_gap)
        engine, brake = np.where(known[:, None], self._commands(self._pedal(seen, grade, known)), np.nan).T
        return engine, brake

    def _commands(self, pedal: Array) -> Array:
        """Commands (n, 2) in the interface's units for signed pedals (n,)."""
        return self.scale.commands(np.column_stack([2 * np.maximum(pedal, 0.0) - 1, -pedal]))

    def _pedal(self, seen: Seen, grade: Array, known: NDArray[np.bool_]) -> Array:
        """The pedals (batch,), 0 for observations that are not `known` (batch,)."""
        if self._past is None or len(self._past.lack) != len(grade):
            self._past = self._start(seen.speed)
        past = self._past
        off = np.nan_to_num(seen.speed - past.expected) / self.dt
        lack = past.lack + self.dt / CORRECTION_S * (off - past.lack)
        state = self.simulator.force(past.state, self._response(seen.speed))
        now = _Now(seen, grade, state, lack, past.plan[:, 0])
        plan = self._improved(past.plan @ self._later.T, now)
        plan = np.where(known[:, None], plan, 0.0)
        state, speed = self._step(state, np.repeat(plan[:, :1], ROWS, axis=1), grade)
        self._past = _Past(plan, state, speed[:, 0], lack)
        return plan[:, 0]

    def _start(self, speed: Array) -> _Past:
        still = np.nan_to_num(speed, nan=TYPICAL["speed"])
        nothing = np.zeros(len(speed))
        state = self.simulator.reset(np.nan_to_num(self._response(still)))
        return _Past(np.zeros((len(speed), len(KNOTS_S))), state, still, nothing)

    def _response(self, speed: Array) -> Array:
        """y (batch * ROWS, n_y) for speed (batch,), NaN otherwise."""
        y = np.full((len(speed) * ROWS, len(self.interface.y)), np.nan)
        y[:, SPEED] = np.repeat(speed, ROWS)
        return y

    def _improved(self, plan: Array, now: _Now) -> Array:
        """The plan (batch, knots) after one Gauss-Newton step with the best of LENGTHS, or the best
        of HELD."""
        nudge = np.where(plan + NUDGE > 1.0, -NUDGE, NUDGE)
        tried = np.repeat(plan[:, None], ROWS, axis=1)
        tried[:, 1:STEPS] += nudge[:, :, None] * np.eye(len(KNOTS_S))
        tried[:, STEPS:] = np.maximum(HELD, self._least)[:, None]
        residuals = self.residuals(tried, now)
        change = (residuals[:, 1:STEPS] - residuals[:, :1]) / nudge[:, :, None]
        step = _bounded_step(change.swapaxes(1, 2), residuals[:, 0], self._least - plan, 1.0 - plan)
        tried[:, :STEPS] = plan[:, None] + LENGTHS[:, None] * step[:, None]
        best = np.square(self.residuals(tried, now)).sum(axis=2).argmin(axis=1)
        return np.asarray(tried[np.arange(len(plan)), best])

    def residuals(self, plans: Array, now: _Now) -> Array:
        """The residuals whose squares add up to the cost, (batch, ROWS, n), for plans (batch, ROWS,
        knots)."""
        pedals, state, speeds = plans @ self._basis.T, now.state, []
        for k in range(len(self._time)):
            state, speed = self._step(state, pedals[:, :, k], now.grade)
            speeds.append(speed)
        seen = now.seen
        speed = np.maximum(np.stack(speeds, axis=2) + now.lack[:, None, None] * self._time, 0.0)
        leader, way = (x[:, None] for x in seen.leader(self._time))
        begun = np.broadcast_to(seen.speed[:, None, None], (*speed.shape[:2], 1))
        driven = self.dt * np.concatenate([begun, speed[:, :, :-1]], axis=2).cumsum(axis=2)
        gap = seen.gap[:, None, None] + way - driven
        time_gap = np.clip(seen.time_gap, 1.0, 6.0)[:, None, None]
        off = leader + approach(gap - time_gap * leader, time_gap, APPROACH)[0] - speed
        near = np.maximum(LEAST_GAP_M - gap, 0.0)
        before = np.broadcast_to(now.pedal[:, None, None], (*plans.shape[:2], 1))
        changes = np.diff(plans, axis=2, prepend=before) / np.sqrt(np.diff(KNOTS_S, prepend=-self.dt))
        weighted = [(self.dt, off), (TOO_NEAR * self.dt, near), (CHANGE_COST, changes)]
        return np.nan_to_num(np.concatenate([np.sqrt(cost) * x for cost, x in weighted], axis=2))

    def _step(self, state: Any, pedals: Array, grade: Array) -> tuple[Any, Array]:
        """One step of the simulator under pedals (batch, ROWS): its state and speed (batch, ROWS)."""
        u = self._commands(pedals.ravel())[:, : len(self.interface.u)]
        w = np.repeat(grade[:, None], ROWS, axis=0)[:, : len(self.interface.w)]
        state, y = self.simulator.step(state, u, w)
        return state, y[:, SPEED].reshape(pedals.shape)


class _Past(NamedTuple):
    """State kept between calls: plan (batch, knots), the simulator's state and the speed it expects now
    (batch,), and the acceleration error of the simulator (batch,)."""

    plan: Array
    state: Any
    expected: Array
    lack: Array


class _Now(NamedTuple):
    """The initial state of a plan, each (batch,); `pedal` is the present one."""

    seen: Seen
    grade: Array
    state: Any
    lack: Array
    pedal: Array


def _straight(time: Array) -> Array:
    """Linear interpolation weights (n, knots) of a plan at time (n,)."""
    return np.stack([np.interp(time, KNOTS_S, unit) for unit in np.eye(len(KNOTS_S))], axis=1)


def _bounded_step(jacobian: Array, residuals: Array, low: Array, high: Array) -> Array:
    """Damped Gauss-Newton steps (batch, knots) within low..high, which include 0.

    jacobian (batch, n, knots), residuals (batch, n).
    """
    turned, damping = jacobian.swapaxes(1, 2), DAMPING * np.eye(jacobian.shape[2])
    step = -np.linalg.solve(turned @ jacobian + damping, turned @ residuals[..., None])[..., 0]
    for k in np.flatnonzero(((step < low) | (step > high)).any(axis=1)):
        rows = np.vstack([jacobian[k], np.sqrt(damping)])
        aim = np.append(-residuals[k], np.zeros(len(damping)))
        step[k] = lsq_linear(rows, aim, (low[k] - 1e-9, high[k] + 1e-9), method="bvls").x
    return np.clip(step, low, high)
