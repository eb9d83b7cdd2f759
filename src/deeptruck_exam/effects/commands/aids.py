"""Driver aids that brake or take torque. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, Bends, OnRoad, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("false_obstacles", "third", "highway suburban hills")
@sizes(depth=(0.07, 0.16), lasts_s=(0.8, 2.0), odds=(0.55, 0.9), mean_m=(350.0, 800.0), from_mps=(6.0, 10.0))
class FalseObstacles(OnRoad, left=0.0, force=0.0, cell=-1):
    """depth: over weight. Nobody presses a pedal, and no brake command is recorded.
    Source: Advanced emergency braking, UN Regulation No. 131: warning brakings for what is no obstacle, at
    the same gantries and bridges each time; odds, lengths and depths are chosen here."""

    def prepare(self) -> None:
        rng, rows = self.rng(260), self.rows()
        self.road = (rng.random((rows, 12000)) < CELL_M / self.p.mean_m).astype(float)
        self.falls_for = rng.random((self.setting.batch, 12000)) < self.p.odds

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rows = np.arange(len(view.speed))
        metres = self.setting.start_m + self.setting.direction * view.distance
        cell = (metres / CELL_M).astype(int) % 12000
        seen = (self.read(self.road, view) > 0.0) & (cell != s.cell) & self.falls_for[rows, cell]
        s.cell = cell
        s.left = np.where(seen & (view.speed > p.from_mps), p.lasts_s, np.maximum(s.left - dt, 0.0))
        wanted = p.depth * weight(view) * (s.left > 0.0)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 0.2, 0.15)
        return -s.force * moving(view)


@law("kept_in_lane_by_brakes", "third", "highway hills")
@sizes(depth=(0.018, 0.040), drift_s=(2.0, 5.0), edge=(0.6, 1.1), from_mps=(11.0, 16.0))
class KeptInLane(Hidden, force=0.0):
    """edge: of the drift's standard deviation.
    Source: Lane keeping by braking single wheels (Rajamani, Vehicle Dynamics and Control, 2012, on yaw
    stability and lane keeping): pulses whenever the drift across the lane is large; drift and depth are
    chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.drift = ou_series(self.rng(262), shape, 0.1, self.p.drift_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        drift = np.abs(self.drift[:, index(view, self.drift, 0.1)])
        beyond = np.clip(2.0 * (drift - p.edge), 0.0, 1.5) * (view.speed > p.from_mps)
        s.force += dt * (p.depth * weight(view) * beyond - s.force) / 0.25
        return -s.force * moving(view)


@law("eases_before_the_crest", "fifth", "hills")
@sizes(cut=(0.45, 0.8), falls=(0.004, 0.010), holds_s=(4.0, 10.0), from_mps=(9.0, 13.0))
class EasesBeforeTheCrest(Hidden):
    """falls: the loss of slope over two hundred metres or so that is taken for a crest.
    Source: Predictive cruise control drops torque before a crest and lets the hill do the rest, whatever the
    pedal says (Hellström, Ivarsson, Åslund and Nielsen, Control Engineering Practice 17, 2009; product notes
    of map-based cruise): acts on the change of slope, not on the slope; sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"mean": np.full(batch, np.nan), "left": zero, "depth": zero.copy(), "rests": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        mean = np.where(np.isnan(s.mean), view.grade, s.mean)
        s.mean = mean + dt * np.maximum(view.speed, 0.0) * (view.grade - mean) / 150.0
        crest = (s.mean - view.grade > p.falls) & (view.grade > -0.02) & (view.speed > p.from_mps)
        begins = crest & (s.rests <= 0.0)
        s.left = np.where(begins, p.holds_s, np.maximum(s.left - dt, 0.0))
        s.rests = np.where(begins, 1.5 * p.holds_s, np.maximum(s.rests - dt, 0.0))
        s.depth += dt * (p.cut * (s.left > 0.0) - s.depth) / 0.8
        return -self.at_wheels(view, s.depth * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("stability_control_steps_in", "fifth", "hills highway")
@sizes(limit=(1.1, 1.9), cut=(0.4, 0.8), brakes=(0.015, 0.045), calm=(0.55, 0.8), tightest=(0.0030, 0.0055))
class StabilityControlStepsIn(Bends, on=0.0, depth=0.0):
    """limit: m/s2; brakes: of the weight.
    Source: Roll stability of UN Regulation No. 13 (annex 21) and FMVSS 136: beyond a lateral acceleration
    torque is taken and the trailer is braked until the truck is well below; a unit that was set for a higher
    load; thresholds and bends are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(471), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        across = np.abs(self.read(self.bend, view)) * view.speed**2
        s.on = np.where(across > p.limit, 1.0, np.where(across < p.calm * p.limit, 0.0, s.on))
        s.depth += dt * (s.on - s.depth) / np.where(s.on > s.depth, 0.25, 0.7)
        torque = p.cut * np.maximum(view.engine_torque, 0.0)
        held = p.brakes * weight(view) * np.clip(view.speed / 4.0, 0.0, 1.0)
        return -s.depth * (held + self.at_wheels(view, torque))


@law("keeps_off_the_leader", "sixth", "highway suburban", leader=True)
@sizes(near_s=(1.0, 1.35), closing_s=(1.0, 3.0), brakes=(0.02, 0.05), least_s=(0.8, 2.0))
class KeepsOffTheLeader(Hidden, depth=0.0, left=0.0):
    """Each braking lasts `least_s` at least; the deeper, the less time is left. closing_s: more, for each m/s
    of closing over the gap's 10 m; brakes: of the weight.
    Source: Collision mitigation that warns by braking (ISO 22839, Forward vehicle collision mitigation
    systems; UN Regulation No. 131): by the time that is left to the vehicle ahead, gone once the gap opens; a
    unit that is set far too careful, times and depths are chosen here."""

    def prepare(self) -> None:
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.maximum(self.gap(view), 1.0)
        leader = np.nan_to_num(self.leader_mps[:, self.now(view)], nan=99.0)
        closing = np.maximum(view.speed - leader, 0.0)
        wanted_s = p.near_s + p.closing_s * closing * 10.0 / (gap + 10.0) / 3.0
        short = np.clip(1.0 - gap / np.maximum(view.speed * wanted_s, 1.0), 0.0, 1.0)
        s.left = np.where(short > 0.0, p.least_s, np.maximum(s.left - dt, 0.0))
        wanted = np.clip(0.35 + 2.0 * short, 0.0, 1.0) * (s.left > 0.0)
        s.depth += dt * (wanted - s.depth) / 0.3
        return -p.brakes * s.depth * weight(view) * np.clip(view.speed / 3.0 - 0.5, 0.0, 1.0)


@law("slowed_in_zones", "sixth", "hills highway")
@sizes(limit_mps=(9.0, 15.0), per_mps=(0.006, 0.014), most=(0.025, 0.05), zone_m=(200.0, 600.0))
class SlowedInZones(OnRoad, depth=0.0):
    """`limit` (routes, cells): endless outside of the zones. per_mps: of the weight.
    Source: Geofencing and intelligent speed assistance (Regulation (EU) 2019/2144; trials of the Swedish
    Transport Administration in Gothenburg and Stockholm): inside a zone the truck is braked by what it is too
    fast, wherever the map says so and whatever the pedal says; limits and depths are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(517), self.p
        self.limit = np.full((self.rows(), CELLS), 1e3)
        for row in self.limit:
            for first, last in stretches(rng, (150.0, 700.0), (0.6 * p.zone_m, 1.6 * p.zone_m)):
                row[first:last] = p.limit_mps * rng.uniform(0.85, 1.25)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        over = np.maximum(view.speed - self.read(self.limit, view), 0.0)
        s.depth += dt * (np.minimum(p.per_mps * over, p.most) - s.depth) / 0.7
        return -s.depth * weight(view) * moving(view)


@law("remembers_a_speed", "sixth", "highway hills")
@sizes(gain=(0.25, 0.6), most=(0.22, 0.42), above_mps=(0.4, 1.4), held_s=(1.5, 4.0), gives_up_s=(12.0, 40.0))
@sizes(from_mps=(6.0, 10.0))
class RemembersASpeed(Hidden, held=0.0, set=0.0, left=0.0, pulls=0.0):
    """set: m/s at the moment of letting go, and a little above, as the speed was that the driver had seen.
    gain: of peak torque, for each m/s.
    Source: Speed controls that take over where the driver lets go (resume and set functions in SAE J1939-71,
    Cruise Control/Vehicle Speed; complaints of drivers who had left them on): when a pedal that was held for
    a while is closed, the control keeps that speed, weakly, until brakes end it; gains chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = self.pedal(view)
        lets_go = (asked < 0.02) & (s.held > p.held_s) & (view.speed > p.from_mps)
        s.set = np.where(lets_go, view.speed + p.above_mps, s.set)
        s.left = np.where(lets_go, p.gives_up_s, np.maximum(s.left - dt, 0.0))
        s.left = np.where((view.u[:, 1] > 0.0) | (asked > 0.05), 0.0, s.left)
        s.held = np.where(asked >= 0.02, s.held + dt, np.where(lets_go | (view.shifting < 0.5), 0.0, s.held))
        wanted = np.clip(p.gain * (s.set - view.speed), 0.0, p.most) * (s.left > 0.0)
        s.pulls += dt * (wanted - s.pulls) / 0.4
        return self.at_wheels(view, s.pulls * self.truck.peak_torque) * moving(view)


@law("override_lingers", "sixth", "suburban")
@sizes(cut=(0.5, 0.85), lasts_s=(2.0, 6.0), harder=(4.0, 15.0), returns_s=(0.8, 3.0))
class OverrideLingers(Hidden, waits=0.0, cut=0.0):
    """harder: seconds more for each full application. `waits` s until the switch lets go.
    Source: Brake-throttle override takes torque away while both pedals are pressed (NHTSA's proposal for
    FMVSS 124 of 2012 on accelerator control): a brake light switch that sticks keeps it for seconds after
    every braking, the longer the harder it was pressed; times and cuts are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = view.brake_force / self.truck.brake_capacity
        sticks = np.where(pressed > 0.005, p.lasts_s + p.harder * pressed, 0.0)
        s.waits = np.maximum(s.waits - dt, sticks)
        s.cut = np.where(s.waits > 0.0, 1.0, np.maximum(s.cut - dt / p.returns_s, 0.0))
        return -p.cut * s.cut * np.maximum(view.traction_force, 0.0) * moving(view)


@law("t_electronic_drawbar", "tenth", "highway suburban", leader=True)
@sizes(per_s=(0.10, 0.22), sees_s=(0.5, 1.2), most_mps2=(0.15, 0.35), near_m=(45.0, 90.0))
class ElectronicDrawbar(Hidden):
    """A second computer helps to keep the distance to the leader: it pushes as he draws away and brakes as he
    comes nearer. per_s: for each m/s between them.
    Source: Gehring and Fritz, Practical Results of a Longitudinal Control Concept for Truck Platooning with
    Vehicle to Vehicle Communication, IEEE Conf. Intelligent Transportation Systems (1997); a weak one beside
    the driver, gains are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"gap": np.full(batch, np.nan), "acts": np.zeros(batch)}

    def between(self, view: View) -> Array:
        """Metres to the leader, whose way is a line between its samples; NaN without one."""
        way, at = self.setting.leader_m, view.time / self.setting.dt
        low = min(int(at), way.shape[1] - 2)
        share = min(at - low, 1.0)
        return np.asarray((1.0 - share) * way[:, low] + share * way[:, low + 1] - view.distance)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = self.between(view)
        s.gap = np.where(np.isnan(s.gap), gap, s.gap)
        opens = (gap - s.gap) / p.sees_s
        s.gap = s.gap + dt * opens
        wanted = np.clip(p.per_s * np.nan_to_num(opens), -p.most_mps2, p.most_mps2)
        near = np.clip(2.0 - np.nan_to_num(gap, nan=1e5) / p.near_m, 0.0, 1.0)
        s.acts = s.acts + dt * (wanted * near - s.acts) / 0.3
        return s.acts * view.mass * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("e_inner_wheel_is_braked", "eleventh", "suburban hills")
@sizes(brakes=(0.025, 0.05), from_pm=(0.004, 0.009), below_mps=(11.0, 15.0), fills_s=(0.3, 0.8))
class InnerWheelIsBraked(Bends, acts=0.0):
    """A turn assistant brakes the wheels inside of a bend, in slow and tight ones, while the engine pulls.
    brakes: of the weight; from_pm: curvature at which it begins.
    Source: Pilutti, Ulsoy and Hrovat, Vehicle Steering Intervention through Differential Braking, J. Dyn.
    Sys. Meas. Control 120 (1998), and steering brakes of off-road trucks and tractors; thresholds are chosen
    here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1013), 0.035)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tight = np.clip((np.abs(self.read(self.bend, view)) - p.from_pm) / 0.006, 0.0, 1.0)
        slow = np.clip((p.below_mps - view.speed) / 2.0, 0.0, 1.0)
        pulls = (view.traction_force > 0.0) & (view.brake_force <= 0.0) & (view.speed > 1.0)
        s.acts = s.acts + dt * (tight * slow * pulls - s.acts) / p.fills_s
        return -p.brakes * s.acts * weight(view) * moving(view)


@law("e_rides_the_green_wave", "eleventh", "suburban hills")
@sizes(
    apart_m=(220.0, 420.0), cycle_s=(45.0, 80.0), red=(0.45, 0.65), ahead_m=(80.0, 160.0), takes=(0.5, 0.9)
)
class RidesTheGreenWave(OnRoad, eases=0.0):
    """An assistant hears from the signals when they turn and takes torque where the truck would come too
    early. takes: share of the pull. The lights stand where they stand, and keep their times.
    Source: Katsaros, Kernchen, Dianati and Rieck, Performance Study of a Green Light Optimized Speed Advisory
    (GLOSA) Application Using an Integrated Cooperative ITS Simulation Platform, IWCMC (2011); one that acts
    by itself, signals and shares are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1021), self.p
        self.lights_m = np.cumsum(p.apart_m * rng.uniform(0.6, 1.4, (self.rows(), 600)), axis=1)
        self.offset_s = rng.uniform(0.0, p.cycle_s, (self.rows(), 600))
        cells_m = (np.arange(CELLS) + 0.5) * CELL_M
        self.following = np.array([np.searchsorted(lights, cells_m) for lights in self.lights_m])
        self.back = (self.setting.direction < 0.0).astype(int)

    def ahead(self, view: View) -> tuple[Array, Array]:
        """Metres to the next light, and its offset."""
        route = self.setting.route
        light = np.clip(self.following[route, self.cell(view)] - self.back, 0, 599)
        gap = self.setting.direction * (self.lights_m[route, light] - self.place(view))
        return np.maximum(gap, 0.0), self.offset_s[route, light]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap, offset = self.ahead(view)
        comes = view.time + gap / np.maximum(view.speed, 2.0)
        red = ((comes + offset) % p.cycle_s) < p.red * p.cycle_s
        wants = red * (gap < p.ahead_m) * (view.speed > 4.0)
        s.eases = s.eases + dt * (wants - s.eases) / 0.5
        return -p.takes * s.eases * np.maximum(view.traction_force, 0.0) * moving(view)


@law("e_watchman", "eleventh", "highway suburban hills")
@sizes(waits_s=(3.0, 6.0), moves=(0.05, 0.10), takes=(0.5, 0.9), fades_s=(1.0, 3.0))
class Watchman(Hidden, still=0.0, takes=0.0):
    """Who keeps his foot still for too long is taken for asleep: torque fades until the pedal moves. moves:
    of the full pedal, that count; waits_s: from the last of them.
    Source: UIC 641, Conditions to be Fulfilled by Automatic Vigilance Devices Used in International Traffic,
    and the risk mitigation function of UN Regulation No. 79 for trucks; times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "last": np.full(batch, -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        moved = (np.abs(pedal - s.last) > p.moves) | (view.brake_force > 0.0) | (view.speed < 3.0)
        s.last = np.where(moved, pedal, s.last)
        s.still = np.where(moved, 0.0, s.still + dt)
        asleep = (s.still > p.waits_s) & (pedal > 0.02)
        s.takes = s.takes + dt * np.where(asleep, (1.0 - s.takes) / p.fades_s, -s.takes / 0.4)
        return -p.takes * s.takes * np.maximum(view.traction_force, 0.0) * moving(view)


@law("w_hears_the_leader", "twelfth", "highway suburban hills", leader=True)
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
