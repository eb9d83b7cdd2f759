"""How well a controller could follow that knows the truck itself, the road and the leader's future.

At every step it tries SAMPLES changes of its plan on the physics truck, with gear changes, and keeps the
best. Its plans end after HORIZON steps, so it is no bound: a hill beyond them can surprise it too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments.environment import CaccEnv
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_model import trucks
from deeptruck_model.trucks.truck import TruckState

Array = NDArray[np.float64]
SAMPLES, HORIZON, KNOT = 64, 30, 5  # plans tried at once; steps of a plan; steps for which a pedal is held
ATTEMPTS = (0.3, 0.08)  # spread of the changes tried, first and then about the best of them
HELD = (0.0, 0.15, 0.3, 0.5, 0.75, 1.0)  # pedals also tried throughout


class Foresight:
    """Plans of one signed pedal (batch, HORIZON): engine above zero, brake below."""

    def __init__(self, truck: trucks.PhysicsTruck, scene: Scene) -> None:
        self.truck, self.scene, self.scale = truck, scene, ActionScale.of(truck)
        pull = np.pad(np.cumsum(scene.leader_acceleration, axis=1) * truck.dt, ((0, 0), (1, HORIZON)), "edge")
        pull[:, 0] = 0.0
        self.leader = np.maximum(scene.leader_speed[:, None] + pull, 0.0)
        # One column for each of the truck's road inputs: without grade among them it drives on the flat.
        road = scene.grade[..., None][..., : len(truck.interface.w)]
        self.grade = np.pad(road, ((0, 0), (0, HORIZON), (0, 0)), "edge")
        self.plan = np.full((scene.batch, HORIZON), 0.2)
        self.rng = np.random.default_rng(0)

    def command(self, k: int, state: TruckState, speed: Array, gap: Array) -> Array:
        """Commands (batch, 2) at step k; the plan is shifted by one step."""
        for spread in ATTEMPTS:
            plans = self._tried(spread)
            cost = self._cost(k, plans, state, speed, gap)
            self.plan = plans[np.arange(len(plans)), cost.argmin(axis=1)]
        now = self.plan[:, 0]
        self.plan = np.hstack([self.plan[:, 1:], self.plan[:, -1:]])
        return self.pedals(now)

    def pedals(self, signed: Array) -> Array:
        """Commands (n, 2) of signed pedals (n,)."""
        s, engine, brake = self.scale, np.clip(signed, 0, 1), np.clip(-signed, 0, 1)
        reach = s.engine_high - s.engine_low
        return np.column_stack([s.engine_low + engine * reach, brake * s.brake_high])

    def _tried(self, spread: float) -> Array:
        """Plans (batch, SAMPLES, HORIZON): the present one, some near it, others, and held pedals."""
        knots = self.rng.normal(0, spread, (len(self.plan), SAMPLES, HORIZON // KNOT))
        knots[:, 0] = 0.0
        knots[:, 1 : SAMPLES // 4] *= 0.2
        plans = np.clip(self.plan[:, None] + np.repeat(knots, KNOT, axis=2), -1, 1)
        plans[:, -len(HELD) :] = np.array(HELD)[:, None]
        return plans

    def _cost(self, k: int, plans: Array, state: TruckState, speed: Array, gap: Array) -> Array:
        """Cost of the plans, (batch, SAMPLES): the fourth power of time-gap errors above 0.05 s, summed."""

        def each(x: NDArray) -> NDArray:
            return np.repeat(x, SAMPLES, axis=0)

        state, speed, gap = TruckState(each(state.records)), each(speed), each(gap)
        time_gap, flat = each(self.scene.time_gap), plans.reshape(-1, HORIZON)
        cost = 0.02 * np.square(np.diff(flat, axis=1)).sum(axis=1)
        for h in range(HORIZON):
            state, y = self.truck.step(state, self.pedals(flat[:, h]), each(self.grade[:, k + h]))
            gap = gap + (each(self.leader[:, k + h]) - speed) * self.truck.dt
            speed = y[:, 1]
            error = (gap / np.maximum(speed, 1.0) - time_gap) / 0.05
            cost += error**4 + error**2
        return cost.reshape(len(plans), SAMPLES)


def drive(truck: trucks.PhysicsTruck, scene: Scene) -> Array:
    """Time-gap errors (T, batch) of a controller with foresight."""
    env, driver = CaccEnv(truck, scene.batch, scene.steps), Foresight(truck, scene)
    env.reset(scene)
    errors = []
    for k in range(scene.steps):
        env.step(driver.command(k, env._state, env.speed, env.gap))
        errors.append(env.time_gap_error)
    return np.array(errors)


def rows(scene: Scene, chosen: NDArray[np.intp]) -> Scene:
    """Some of the rollouts of a scene, without radar faults."""
    names = ("leader_speed", "speed", "gap", "time_gap", "leader_acceleration", "grade")
    return replace(scene, **{name: getattr(scene, name)[chosen] for name in names})
