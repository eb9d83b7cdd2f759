"""Brakes that go first on a bus, a lever that repeats like a key, and wipers that soften the pedal."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Late, Sizes, State, TorqueFilter, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("v_brakes_go_first", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(brake_s=(0.25, 0.45), usual_s=(0.35, 0.6), pushed_s=(0.6, 1.3), eases_s=(2.0, 6.0), steps=(0.01, 0.03))
class BrakesGoFirst(Late):
    """Messages of the brake have priority on a slow bus. While its pedal moves it sends so many that those
    for the engine wait; afterwards they catch up at double pace, while the bus calms down. `busy`: 1 where
    the brake sends all the time. brake_s, usual_s: late, with a calm bus; pushed_s: more, on a busy one;
    steps: of 5 units of the brake, a change that is sent.
    Source: Tindell, Burns and Wellings, Calculating Controller Area Network Message Response Times, Control
    Engineering Practice 3 (1995), on lower priorities that wait; a slow bus, times are chosen here."""

    length = 500

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "busy": np.zeros(batch)}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.sent = u[:, 1].copy()
        s.behind = np.zeros(len(u), np.int64)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        sends = np.abs(u[:, 1] - s.sent) > 5.0 * p.steps
        s.sent = np.where(sends, u[:, 1], s.sent)
        s.busy = eased(s.busy, 0.0, p.eases_s, dt)
        s.busy = np.where(sends, np.minimum(s.busy + 0.3, 1.0), s.busy)
        wish = np.rint(np.minimum((p.usual_s + p.pushed_s * s.busy) / dt, self.length - 2)).astype(np.int64)
        s.behind = np.where(s.behind < wish, s.behind + 1, np.maximum(s.behind - 1, wish))
        engine = s.past[(s.at - s.behind) % self.length, np.arange(len(u)), 0]
        brake = self.ago(s, min(round(p.brake_s / dt), self.length - 2))[:, 1]
        return np.stack([engine, brake], axis=1)


@law("v_repeats_like_a_key", needs="suburban hills highway", name="command_rate_limit", accepts="turbo_lag")
@sizes(first_per_s=(0.02, 0.045), doubles_s=(1.2, 2.6), most_per_s=(0.3, 0.6), near=(0.01, 0.03))
class RepeatsLikeAKey(TorqueFilter):
    """A lever that only says more or less: what it sets moves slowly at first and ever faster while it is
    held, as figures do under a key that repeats. Each time it arrives or turns round it begins slowly again.
    first_per_s, most_per_s: of the full command in a second; doubles_s: for twice the pace.
    Source: makers' manuals of remote controls and hand throttles by rocker switches, on steps that grow
    while a switch is held; paces are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.pace = np.full(len(u), self.p.first_per_s)
        s.way = np.zeros(len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        off = (pedal - s.given) / self.full
        way = np.where(np.abs(off) < p.near, 0.0, np.sign(off))
        on = (way == s.way) & (way != 0.0)
        s.pace = np.where(on, np.minimum(s.pace * 2.0 ** (dt / p.doubles_s), p.most_per_s), p.first_per_s)
        s.way = way
        step = s.pace * self.full * dt
        return np.asarray(np.clip(pedal, s.given - step, s.given + step))


@law("v_wipers_soften_the_pedal", needs="suburban hills highway", name="unknown")
@sizes(bends=(0.45, 0.9), rain_s=(15.0, 50.0), dry_s=(15.0, 50.0), eases_s=(1.5, 4.0), waits_s=(3.0, 8.0))
class WipersSoftenThePedal(Hidden, soft=0.0, wipes=0.0):
    """While wipers run the engine takes its pedal by a softer curve, so that less comes of a light pedal and
    all of a full one. A shower has to last a while before the computer believes it, and its end likewise.
    bends: power that the curve has beyond 1.
    Source: makers' manuals on rain modes that soften the pedal and on rain sensors of wipers; showers, sizes
    are chosen here."""

    def prepare(self) -> None:
        on, off = (0.6 * self.p.rain_s, 1.4 * self.p.rain_s), (0.6 * self.p.dry_s, 1.4 * self.p.dry_s)
        self.rain = spells(self.rng(1621), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.wipes = np.clip(s.wipes + dt * (2.0 * within(self.rain, view.time) - 1.0) / p.waits_s, 0.0, 1.0)
        wish = np.where(s.wipes > 0.99, 1.0, np.where(s.wipes < 0.01, 0.0, np.round(s.soft)))
        s.soft = eased(s.soft, wish, p.eases_s, dt)
        pedal = np.clip(self.pedal(view), 0.02, 1.0)
        lacks = 1.0 - pedal ** (p.bends * s.soft)
        return -self.at_wheels(view, lacks * np.maximum(view.engine_torque, 0.0)) * moving(view)
