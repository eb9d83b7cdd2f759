"""Sixth effects for which no library name exists: what engines and pedals do by themselves."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


def pedal(law: Hidden, view: View) -> Array:
    """Engine command as a share of the most, 0..1."""
    return np.clip(view.u[:, 0] / law.truck.full_command, 0.0, 1.0)


@hidden(
    "fast_idle_pushes",
    name="unknown",
    forms="sixth",
    source="Fast idle of a cold engine, or one left on after work with the power take-off (Diesel-Engine"
    " Management, Bosch, on idle-speed control): while the truck slows in gear with closed pedal, the"
    " governor pushes against the brakes; set speeds and droop are chosen here",
    ranges={
        "set": (112.0, 138.0),  # rad/s
        "droop_nm": (8.0, 20.0),  # for each rad/s
        "most_nm": (200.0, 420.0),
        "falls_s": (200.0, 600.0),
    },
    needs=("suburban", "descent"),
)
class FastIdlePushes(Hidden):
    """The set speed falls to 100 rad/s as the engine warms."""

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        held = 100.0 + (p.set - 100.0) * np.exp(-view.time / p.falls_s)
        closed = 1.0 - np.clip(pedal(self, view) / 0.03, 0.0, 1.0)
        torque = np.clip(p.droop_nm * (held - view.engine_speed), 0.0, p.most_nm) * closed
        return wheel_force(self.setting, view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@hidden(
    "pedal_sticks_where_it_rests",
    name="unknown",
    forms="sixth",
    source="Sticking pedals recalled in January 2010 (NHTSA; NASA Engineering and Safety Center, Technical"
    " Support to NHTSA on Unintended Acceleration, 2011): a pedal held in one place for a while comes back"
    " late or not at all, until it is moved far or the driver brakes; forces and times are chosen here",
    ranges={"sticks": (0.16, 0.34), "sets_s": (1.5, 5.0), "same": (0.03, 0.06), "creeps_s": (3.0, 9.0)},
    needs=("suburban", "hills", "highway"),
)
class PedalSticksWhereItRests(Hidden):
    """stuck: share of the command that the engine still gets; `rests` s near one place."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"stuck": np.zeros(batch), "rests": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = pedal(self, view)
        below = s.stuck - asked
        s.rests = np.where(np.abs(below) < p.same, s.rests + dt, np.maximum(s.rests - dt, 0.0))
        breaks = (below > p.sticks * (1.0 - np.exp(-s.rests / p.sets_s))) | (view.u[:, 1] > 0.0)
        s.rests = np.where(breaks & (below > p.same), 0.0, s.rests)
        creeps = asked + below * (1.0 - dt / p.creeps_s)
        s.stuck = np.where((below < 0.0) | breaks, asked, creeps)
        more = np.minimum(np.maximum(s.stuck - asked, 0.0), 0.5)
        return wheel_force(self.setting, view, more * self.truck.peak_torque) * moving(view)


@hidden(
    "burns_its_own_oil",
    name="unknown",
    forms="sixth",
    source="Oil of worn seals and breathers gathers in the charge air cooler while an engine coasts and burns"
    " when load blows it out (workshop manuals on oil carry-over; diesel runaway, in Heywood's terms a fuel"
    " that nobody meters): more torque than asked, for seconds; amounts are chosen here",
    ranges={
        "most": (0.16, 0.32),  # of peak torque
        "gathers_s": (6.0, 18.0),
        "burns_s": (3.0, 9.0),
        "from_load": (0.12, 0.3),
    },
    needs=("hills", "suburban"),
)
class BurnsItsOwnOil(Hidden):
    """The longer it has coasted, the more there is to burn."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.setting.rng(515).uniform(0.2, 1.0, batch), "burns": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        blows = np.clip((load - p.from_load) / 0.25, 0.0, 1.0) * s.oil
        gathers = (load < 0.02) * np.clip(view.engine_speed / 150.0, 0.3, 1.5) * (1.0 - s.oil) / p.gathers_s
        s.oil = np.clip(s.oil + dt * (gathers - blows / p.burns_s), 0.0, 1.0)
        s.burns += dt * (blows - s.burns) / 0.4
        return wheel_force(self.setting, view, p.most * s.burns * self.truck.peak_torque) * moving(view)


@hidden(
    "remembers_a_speed",
    name="unknown",
    forms="sixth",
    source="Speed controls that take over where the driver lets go (resume and set functions in SAE J1939-71,"
    " Cruise Control/Vehicle Speed; complaints of drivers who had left them on): when a pedal that was held"
    " for a while is closed, the control keeps that speed, weakly, until brakes end it; gains chosen here",
    ranges={
        "gain": (0.25, 0.6),  # of peak torque, for each m/s
        "most": (0.22, 0.42),
        "above_mps": (0.4, 1.4),
        "held_s": (1.5, 4.0),
        "gives_up_s": (12.0, 40.0),
        "from_mps": (6.0, 10.0),
    },
    needs=("highway", "hills"),
)
class RemembersASpeed(Hidden):
    """set: m/s at the moment of letting go, and a little above, as the speed was that the driver had seen."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"held": zero, "set": zero.copy(), "left": zero.copy(), "pulls": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = pedal(self, view)
        lets_go = (asked < 0.02) & (s.held > p.held_s) & (view.speed > p.from_mps)
        s.set = np.where(lets_go, view.speed + p.above_mps, s.set)
        s.left = np.where(lets_go, p.gives_up_s, np.maximum(s.left - dt, 0.0))
        s.left = np.where((view.u[:, 1] > 0.0) | (asked > 0.05), 0.0, s.left)
        s.held = np.where(asked >= 0.02, s.held + dt, np.where(lets_go | (view.shifting < 0.5), 0.0, s.held))
        wanted = np.clip(p.gain * (s.set - view.speed), 0.0, p.most) * (s.left > 0.0)
        s.pulls += dt * (wanted - s.pulls) / 0.4
        return wheel_force(self.setting, view, s.pulls * self.truck.peak_torque) * moving(view)


@hidden(
    "override_lingers",
    name="unknown",
    forms="sixth",
    source="Brake-throttle override takes torque away while both pedals are pressed (NHTSA's proposal for"
    " FMVSS 124 of 2012 on accelerator control): a brake light switch that sticks keeps it for seconds after"
    " every braking, the longer the harder it was pressed; times and cuts are chosen here",
    ranges={"cut": (0.5, 0.85), "lasts_s": (2.0, 6.0), "harder": (4.0, 15.0), "returns_s": (0.8, 3.0)},
    needs=("suburban",),
)
class OverrideLingers(Hidden):
    """harder: seconds more for each full application. `waits` s until the switch lets go."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"waits": np.zeros(batch), "cut": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pressed = view.brake_force / self.truck.brake_capacity
        sticks = np.where(pressed > 0.005, p.lasts_s + p.harder * pressed, 0.0)
        s.waits = np.maximum(s.waits - dt, sticks)
        s.cut = np.where(s.waits > 0.0, 1.0, np.maximum(s.cut - dt / p.returns_s, 0.0))
        return -p.cut * s.cut * np.maximum(view.traction_force, 0.0) * moving(view)
