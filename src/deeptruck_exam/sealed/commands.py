"""Frames that are joined, torque that steps softly over the lash, and two who meddle: a radio and a zone."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Hidden, Late, Sizes, State, TorqueFilter, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_joins_the_frames", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
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


@law("w_steps_over_the_lash", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(low=(0.02, 0.05), high=(0.2, 0.4), slow_per_s=(0.12, 0.28), quick_per_s=(0.6, 1.4), drops=(1.0, 2.0))
class StepsOverTheLash(TorqueFilter):
    """So that the teeth do not clash, torque passes slowly through a band near nothing and quickly above it;
    slower upwards than downwards. low, high: of the full command; drops: times as quick, downwards.
    Source: Fredriksson, Weiefors and Egardt, Powertrain Control for Active Damping of Driveline Oscillations,
    Vehicle System Dynamics 37 (2002), and Lagerberg and Egardt, Evaluation of Control Strategies for
    Automotive Powertrains with Backlash, AVEC (2002), on crossing it gently; rates are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        share = s.given / self.full
        out = np.clip((share - p.high) / 0.1, 0.0, 1.0) + np.clip((p.low - share) / 0.02, 0.0, 0.3)
        pace = (p.slow_per_s + (p.quick_per_s - p.slow_per_s) * out) * self.full * dt
        return np.asarray(np.clip(pedal, s.given - p.drops * pace, s.given + pace))


@law("w_hears_the_leader", needs="highway suburban hills", name="unknown", leader=True)
@sizes(gain=(0.25, 0.5), late_s=(0.3, 0.9), lags_s=(0.3, 0.8), reach_m=(45.0, 90.0), most=(0.02, 0.045))
class HearsTheLeader(Hidden, acts=0.0):
    """The leader says by radio how he speeds up and slows down, and the truck's own drive and brakes answer
    at once, beside whoever drives. gain: of his acceleration; most: of the weight.
    Source: Ploeg, Scheepers, van Nunen, van de Wouw and Nijmeijer, Design and Experimental Evaluation of
    Cooperative Adaptive Cruise Control, IEEE ITSC (2011), on feedforward of the leader's acceleration; gains
    and reach are chosen here."""

    def prepare(self) -> None:
        steps = max(1, round(0.4 / self.setting.dt))
        way = self.setting.leader_m
        pace = np.gradient(way, self.setting.dt, axis=1)
        change = np.gradient(pace, self.setting.dt, axis=1)
        total = np.cumsum(np.nan_to_num(change), axis=1)
        smooth = (total[:, 2 * steps :] - total[:, : -2 * steps]) / (2.0 * steps)
        self.heard = np.pad(smooth, ((0, 0), (2 * steps, 0)))
        self.late = round(self.p.late_s / self.setting.dt)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        heard = np.clip(self.heard[:, max(self.now(view) - self.late, 0)], -2.0, 1.5)
        near = np.clip((p.reach_m - self.gap(view)) / 15.0, 0.0, 1.0)
        s.acts = s.acts + dt * (p.gain * heard * near - s.acts) / p.lags_s
        force = p.most * np.tanh(s.acts / (9.81 * p.most))
        return np.asarray(force * weight(view) * np.clip(view.speed - 1.0, 0.0, 1.0))


@law("w_zone_without_engine", needs="suburban hills highway", name="unknown")
@sizes(least=(0.2, 0.4), back=(0.012, 0.028), frees=(0.6, 1.0), apart_m=(300.0, 900.0), changes_s=(0.6, 2.0))
class ZoneWithoutEngine(OnRoad, runs=0.0):
    """In zones that a map holds, a smaller motor drives and the engine stands. It gives less than was asked,
    turns no engine when coasting, and takes energy back once the pedal is up. least: of peak torque; back: of
    the weight; frees: of the engine's drag.
    Source: Soldo, Skugor and Deur, Synthesis of Optimal Battery State-of-Charge Trajectory for Blended
    Regime of Plug-in Hybrid Electric Vehicles in the Presence of Low-Emission Zones and Varying Road Grades,
    Energies 12 (2019); zones and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.5 * self.p.apart_m, 1.5 * self.p.apart_m)
        zones = smooth_stretches(self.rng(1124), self.rows(), gaps, (250.0, 800.0))
        self.road = np.where(zones > 0.25, 1.0, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.runs = s.runs + dt * (self.read(self.road, view) - s.runs) / p.changes_s
        asked = np.maximum(view.engine_torque, 0.0)
        lacks = np.maximum(asked - p.least * self.truck.peak_torque, 0.0)
        drag = p.frees * np.maximum(-view.engine_torque, 0.0)
        up = np.clip(1.0 - self.pedal(view) / 0.03, 0.0, 1.0) * np.clip((view.speed - 2.0) / 3.0, 0.0, 1.0)
        back = p.back * weight(view) * up * np.minimum(1.0, 12.0 / np.maximum(view.speed, 1.0))
        return (self.at_wheels(view, drag - lacks) - back) * s.runs * moving(view)
