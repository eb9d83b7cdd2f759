"""A store that runs over, a motor that moves by pulses, and a pedal whose rest is learned."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Late, Sizes, State, TorqueFilter, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("z_store_runs_over", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(least_s=(0.3, 0.5), most_s=(1.2, 2.0), gains=(0.015, 0.05), drops=(0.6, 1.0))
class StoreRunsOver(Late):
    """Commands go through a store between two computers whose clocks differ. The sender's is the quicker one,
    so that the store fills and all comes later and later. When it is full a block of commands is thrown away,
    and the delay falls at once. gains: s of delay in a second; drops: of the store, thrown away.
    Source: Messerschmitt, Synchronization in Digital System Design, IEEE J. Selected Areas in Communications
    8 (1990), on elastic stores that run over and slip; a poor clock, times are chosen here."""

    length = 400

    def start(self, batch: int) -> dict[str, Any]:
        rng = self.rng(1721)
        first = rng.uniform(self.p.least_s, self.p.most_s, len(self.setting.start_m))
        return {**super().start(batch), "held_s": np.resize(first, batch)}

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        s.held_s = s.held_s + p.gains * dt
        over = s.held_s > p.most_s
        s.held_s = np.where(over, p.most_s - p.drops * (p.most_s - p.least_s), s.held_s)
        back = np.minimum(np.rint(s.held_s / dt), self.length - 2).astype(np.int64)
        return np.asarray(s.past[(s.at - back) % self.length, np.arange(len(u))])


@law(
    "z_motor_moves_by_pulses", needs="suburban hills highway", name="command_rate_limit", accepts="turbo_lag"
)
@sizes(per_s=(0.25, 0.5), period_s=(0.8, 1.6), band=(0.25, 0.5), least=(0.06, 0.15))
class MotorMovesByPulses(TorqueFilter):
    """A motor of one speed moves the throttle, and a relay gives it a pulse in each period: the longer, the
    farther away it is. Between pulses the throttle stays. So far changes are ramps, and near the end they are
    small stairs. per_s: of the full command, while it turns; band: of it, an error that keeps the relay on;
    least: of the period, the shortest pulse.
    Source: Bennett, A History of Control Engineering 1930-1955 (1993), and manuals of step controllers for
    motor valves, on pulses by the error; periods are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.left = np.zeros(len(u))
        s.clock = np.resize(self.rng(1722).uniform(0.0, self.p.period_s, len(self.setting.start_m)), len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        s.clock = s.clock + dt
        begins = s.clock >= p.period_s
        s.clock = np.where(begins, s.clock - p.period_s, s.clock)
        off = np.abs(pedal - s.given) / self.full
        pulse = p.period_s * np.clip(off / p.band, p.least, 1.0)
        s.left = np.where(begins, pulse, s.left - dt)
        step = np.where(s.left > 0.0, p.per_s * self.full * dt, 0.0)
        return np.asarray(np.clip(pedal, s.given - step, s.given + step))


@law("z_learns_where_the_pedal_rests", needs="suburban hills highway", name="unknown")
@sizes(believes=(0.7, 0.9), up_s=(15.0, 40.0), down_s=(1.0, 4.0), most=(0.2, 0.35))
class LearnsWhereThePedalRests(Hidden):
    """`rest`: where the computer believes the pedal to be when no foot is on it. It takes the lowest of
    late for that. So a foot that has long been on the pedal becomes the new zero, and only the way above it
    counts. A lifted foot teaches it better in seconds. believes: of a steady pedal, that it takes for rest;
    most: of the pedal's way.
    Source: Bosch Automotive Handbook (2014), on accelerator pedal modules and the learning of their
    released position; one that learns too fast, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rest": self.rng(1723).uniform(0.02, 0.5, batch) * self.p.most}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = np.clip(self.pedal(view), 0.0, 1.0)
        wish = np.minimum(p.believes * pedal, p.most)
        s.rest = eased(s.rest, wish, np.where(wish > s.rest, p.up_s, p.down_s), dt)
        counts = np.clip((pedal - s.rest) / (1.0 - s.rest), 0.0, 1.0)
        lacks = 1.0 - counts / np.maximum(pedal, 0.02)
        return -self.at_wheels(view, np.clip(lacks, 0.0, 1.0) * np.maximum(view.engine_torque, 0.0)) * moving(
            view
        )
