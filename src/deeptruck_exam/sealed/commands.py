"""A gateway that falls asleep, and torque that comes slowly after coasting."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Late, Sizes, State, TorqueFilter, eased
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, family="sealed")


@law("q_gateway_falls_asleep", needs="suburban hills highway", name="command_delay", accepts="clock_offset")
@sizes(usual_s=(0.3, 0.5), wakes_s=(0.7, 1.4), quiet_s=(1.2, 2.5), least=(0.02, 0.035))
class GatewayFallsAsleep(Late):
    """Commands that change little for a while let the gateway fall asleep: it holds what it sent last. The
    next change has to wake it; what came meanwhile is passed on at double pace, until all has been sent.
    usual_s: when awake; least: of the full command, a change that keeps it awake.
    Source: ISO 11898-6 (2013), selective wake-up of CAN nodes, and AUTOSAR, Specification of CAN Network
    Management, on bus sleep after a silence; a slow one, times are chosen here."""

    length = 500

    def start(self, batch: int) -> dict[str, Any]:
        names = ("quiet", "wakes", "asleep")
        return {**super().start(batch), **{name: np.zeros(batch) for name in names}}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.kept, s.held = u.copy(), u.copy()
        s.behind = np.zeros(len(u), np.int64)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        usual = min(round(p.usual_s / dt), self.length // 3)
        change = np.abs(u - s.kept)
        moved = (change[:, 0] > p.least * self.full) | (change[:, 1] > p.least * 5.0)
        s.kept = np.where(moved[:, None], u, s.kept)
        s.quiet = np.where(moved, 0.0, s.quiet + dt)
        s.wakes = np.where(moved & (s.asleep > 0.5), p.wakes_s, np.maximum(s.wakes - dt, 0.0))
        rests = (s.quiet > p.quiet_s) & (s.behind <= usual)
        s.asleep = np.where(moved, 0.0, np.where(rests, 1.0, s.asleep))
        grown = np.minimum(s.behind + 1, self.length - 2)
        caught_up = np.maximum(s.behind - 1, usual)
        s.behind = np.where(s.asleep > 0.5, usual, np.where(s.wakes > 0.0, grown, caught_up))
        old = s.past[(s.at - s.behind) % self.length, np.arange(len(u))]
        holds = (s.asleep > 0.5) | (s.wakes > 0.0)
        s.held = np.where(holds[:, None], s.held, old)
        return np.asarray(s.held)


@law("q_slow_after_coasting", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(
    warm_per_s=(0.3, 0.55),
    cold_per_s=(0.05, 0.1),
    chills_s=(4.0, 12.0),
    warms_s=(4.0, 10.0),
    falls=(1.0, 2.0),
)
class SlowAfterCoasting(TorqueFilter):
    """`chilled`: the catalyst, that cool air has been pumped through while the pedal was up. A cool one lets
    nitrogen oxides pass, so the controller lets torque rise slowly until the engine has warmed it again.
    warm_per_s, cold_per_s, falls: of the full command in a second.
    Source: Guzzella and Onder, Introduction to Modeling and Control of Internal Combustion Engine Systems
    (2010), on catalysts that need heat and on limits of transients; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.chilled = np.where(u[:, 0] > 0.05 * self.full, 0.2, 0.7)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        load = np.clip(s.given / self.full, 0.0, 1.0)
        coasts = load < 0.02
        slow = np.where(coasts, p.chills_s, p.warms_s / (0.15 + load))
        s.chilled = eased(s.chilled, np.where(coasts, 1.0, 0.0), slow, dt)
        pace = p.warm_per_s * (p.cold_per_s / p.warm_per_s) ** s.chilled
        full = self.full * dt
        return np.asarray(np.clip(pedal, s.given - p.falls * full, s.given + pace * full))
