"""Commands that arrive late because a bus, its gateways or its frames are slow."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Late, Sizes, State, eased
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, name="command_delay", accepts="clock_offset")


@law("slow_bus", "second", "suburban hills descent")
@sizes(period_s=(0.35, 0.8), dead_s=(0.12, 0.35), lost=(0.03, 0.15))
class SlowBus(Late):
    """Commands are sampled, held until the next message, and some messages are lost.
    Source: Sampling, hold and message loss of a networked control loop: Hespanha, Naghshtabrizi and Xu, A
    Survey of Recent Results in Networked Control Systems, Proc. IEEE 95 (2007); sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(120), self.p
        slots = int(self.setting.duration_s / p.period_s) + 5
        arrive = p.period_s * np.arange(slots) + rng.uniform(0.0, 0.3 * p.period_s, slots)
        self.arrive = arrive[np.append(True, rng.random(slots - 1) > p.lost)]
        self.steps = max(1, round(p.dead_s / STEP_S))
        self.length = self.steps + 1

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "held": np.zeros((batch, 2)), "message": 0}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.held = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        while s.message < len(self.arrive) and time >= self.arrive[s.message]:
            s.held, s.message = self.ago(s, self.steps).copy(), s.message + 1
        return np.asarray(s.held)


@law("two_gateways", "fourth", "suburban hills descent")
@sizes(engine_s=(0.25, 0.6), brake_s=(0.45, 1.0), poll_s=(0.08, 0.3))
class TwoGateways(Late):
    """Torque and brake requests go through unlike gateways, each polled by a task of its own period; the
    phase of the poll drifts through the sender's.
    Source: Chains of unsynchronised cyclic tasks (Feiertag, Richter, Nordlander and Jonsson, A Compositional
    Framework for End-to-End Path Delay Calculation, CRTS 2008): a queue and a poll for each of SAE J1939-71's
    TSC1 and XBR, of other length each; retrofit gateways, sizes chosen here."""

    def prepare(self) -> None:
        p = self.p
        self.steps = (max(1, round(p.engine_s / STEP_S)), max(1, round(p.brake_s / STEP_S)))
        self.length = max(self.steps) + 1
        self.period = (p.poll_s, 0.618 * p.poll_s)
        self.phase = self.rng(320).uniform(0.0, p.poll_s, 2)

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "held": np.zeros((batch, 2)), "next_s": self.phase.copy()}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.held = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        for j in (0, 1):
            if time >= s.next_s[j]:
                s.held[:, j] = self.ago(s, self.steps[j])[:, j]
                s.next_s[j] = time + self.period[j]
        return np.asarray(s.held)


@law("s_busy_bus", "eighth", "suburban hills descent")
@sizes(base_s=(0.25, 0.5), busy_s=(0.1, 0.35), calms_s=(2.0, 8.0))
class BusyBus(Late):
    """The more the commands have moved of late, the later they come.
    Source: Tindell, Burns and Wellings, Calculating Controller Area Network Message Response Times, Control
    Engineering Practice 3 (1995): waiting grows with the load of the bus; loads are chosen here."""

    length = 200

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "busy": np.zeros(batch), "late": np.full(batch, self.p.base_s)}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.was = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        moved = np.minimum(np.abs(u - s.was).sum(axis=1) / (0.05 * self.full), 1.0)
        s.was = u.copy()
        s.busy = np.minimum(s.busy + 0.25 * moved, 1.0) * (1.0 - dt / p.calms_s)
        s.late = s.late + np.clip(p.base_s + p.busy_s * s.busy - s.late, -dt, dt)
        back = np.rint(s.late / STEP_S).astype(int)
        return np.asarray(s.past[(s.at - back) % self.length, np.arange(len(u))])


@law("w_joins_the_frames", "twelfth", "suburban hills descent")
@sizes(every_s=(0.3, 0.7), line_s=(0.1, 0.3), uneven=(0.2, 0.5))
class JoinsTheFrames(Late):
    """Commands come in frames some time apart, and are played one frame late along the line from each to the
    next, so that nothing jumps. uneven: of the time between frames.
    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems (1998), on first-order holds,
    here one that waits for the next frame; drive by wire of remote trucks, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        mean = self.p.every_s / STEP_S
        spread = self.rng(1121).uniform(-self.p.uneven, self.p.uneven, 4000)
        self.frames = np.maximum(np.rint(mean * (1.0 + spread)), 5.0).astype(int)
        self.line = round(self.p.line_s / STEP_S)

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.old, s.new, s.since, s.frame = u.copy(), u.copy(), 0, 0

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        s.since += 1
        if s.since >= self.frames[s.frame % len(self.frames)]:
            s.old, s.new = s.new, self.ago(s, self.line).copy()
            s.since, s.frame = 0, s.frame + 1
        share = s.since / self.frames[s.frame % len(self.frames)]
        return np.asarray(s.old + share * (s.new - s.old))


@law("q_gateway_falls_asleep", "fifteenth", "suburban hills highway")
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


@law("v_brakes_go_first", "sixteenth", "suburban hills descent")
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
