"""Sixth forms in the brakes: fluid that boils, a link that fails, a valve that leaks, a stalk set by eye."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import spells, within
from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "fluid_boils",
    name="brake_fade",
    forms="sixth",
    source="Limpert, Brake Design and Safety, on brake fluid vaporization, and the wet boiling points of"
    " FMVSS 116: heat soaks from the discs into the calipers, also while nobody brakes, and vapour there"
    " takes the first part of every stroke; hydraulic brakes of a distribution truck, sizes chosen here",
    ranges={
        "stroke": (0.03, 0.075),  # of full braking, lost with all calipers full of vapour
        "boils_k": (26.0, 50.0),
        "soaks_s": (20.0, 50.0),
        "span_k": (10.0, 25.0),
    },
    needs=("descent",),
)
class FluidBoils(Hidden):
    """Two thirds of a gentle brake are lost, a hard one by the same force."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"disc": np.full(batch, 20.0), "fluid": np.full(batch, 12.0), "vapour": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        speed = np.maximum(view.speed, 0.0)
        lost = np.minimum(p.stroke * s.vapour * truck.brake_capacity, 0.65 * view.brake_force)
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        # the discs of a distribution truck weigh a third of drums
        heat = (view.brake_force - lost) * speed - film * s.disc
        s.disc += dt * heat / (0.35 * truck.brake_heat_capacity)
        s.fluid += dt * (s.disc - s.fluid) / p.soaks_s
        boils = np.clip((s.fluid - p.boils_k) / p.span_k, 0.0, 1.0)
        s.vapour += dt * (boils - s.vapour) / np.where(boils > s.vapour, 3.0, 12.0)
        return lost * moving(view)


@hidden(
    "falls_back_on_air",
    name="brake_lag",
    forms="sixth",
    source="Electronically controlled trailers fall back on the pneumatic control line where the data line of"
    " ISO 7638 fails (UN Regulation No. 13, on electric control lines): a dead time and a steady fill through"
    " a relay valve; a corroded plug that comes and goes, sizes chosen here",
    ranges={
        "share": (0.5, 0.8),  # of the brakes behind the plug
        "dead_s": (0.25, 0.6),
        "fills_per_s": (0.05, 0.15),  # of full braking
        "vents_s": (0.4, 1.2),
    },
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class FallsBackOnAir(Hidden):
    """As quick as the simulator knows it while the plug has contact."""

    def prepare(self) -> None:
        rng = self.setting.rng(503)
        self.fails = spells(rng, self.setting.batch, (40.0, 110.0), (8.0, 35.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"inside": np.zeros(batch), "asks": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.brake_capacity
        asked = view.brake_force / full
        # the dead time is met once in each application
        s.asks = np.where(asked > 0.002, s.asks + dt, 0.0)
        up = np.minimum(np.maximum(asked - s.inside, 0.0), dt * p.fills_per_s * (s.asks > p.dead_s))
        down = np.maximum(s.inside - asked, 0.0) * dt / p.vents_s
        fails = within(self.fails, view.time) > 0.5
        s.inside = np.where(fails, s.inside + up - down, asked)
        return p.share * full * (asked - s.inside) * moving(view)


@hidden(
    "leaks_into_the_chambers",
    name="dragging_brake",
    forms="sixth",
    source="The recall of 2013 of Bendix ATR-6 traction relay valves, which leaked inside in the cold and let"
    " brakes drag: air gathers in the chambers while nobody brakes, and every application blows it off and"
    " seats the valve for a while (Limpert, Brake Design and Safety, on relay and quick release valves);"
    " times and forces are chosen here",
    ranges={
        "force": (0.011, 0.023),  # of the weight
        "gathers_s": (4.0, 12.0),
        "seated_s": (2.0, 9.0),  # the mean; no two applications seat it alike
        "opens": (0.1, 0.4),  # of the leak, below which the chamber's spring holds the shoes off
    },
    needs=("suburban", "descent", "hills"),
)
class LeaksIntoTheChambers(Hidden):
    """The longer nobody has braked, the more it drags."""

    def prepare(self) -> None:
        dice = self.setting.rng(504).exponential(1.0, (self.setting.batch, 128))
        self.seated = self.p.seated_s * np.clip(dice, 0.2, 3.0)

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"air": zero, "since": zero.copy(), "count": np.zeros(batch, int)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        braked = view.brake_force > 0.004 * weight(view)
        s.count = (s.count + (braked & (s.since > 0.0))) % 128
        s.since = np.where(braked, 0.0, s.since + dt)
        tight = self.seated[np.arange(len(s.count)), s.count]
        s.air += dt * np.where(braked, -s.air / 0.3, (s.since > tight) * (1.0 - s.air) / p.gathers_s)
        pressed = np.maximum(s.air - p.opens, 0.0) / (1.0 - p.opens)
        return -p.force * pressed * weight(view) * moving(view)


@hidden(
    "stalk_set_by_eye",
    name="engine_brake",
    forms="sixth",
    source="Drivers set the stalk of an engine brake by the hill in sight when they lift, and think again"
    " later (AAMVA Commercial Driver License Manual, on mountain driving and retarders); torque with a power"
    " of engine speed as suppliers' curves of bleeder brakes show; stages and sizes are chosen here",
    ranges={
        "torque_nm": (500.0, 1050.0),  # of all stages, at 190 rad/s
        "power": (1.3, 2.1),
        "from_slope": (0.004, 0.014),
        "steeper": (0.009, 0.016),  # for each stage more
        "again_s": (5.0, 14.0),
    },
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class StalkSetByEye(Hidden):
    """Three stages; on the flat and uphill none, however long the pedal is closed."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"stage": zero, "waits": zero.copy(), "torque": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0)
        s.waits = np.where(closed, s.waits - dt, 0.6)
        looks = closed & (s.waits <= 0.0)
        stage = np.clip(np.ceil((-view.grade - p.from_slope) / p.steeper), 0.0, 3.0)
        s.stage = np.where(closed, np.where(looks, stage, s.stage), 0.0)
        s.waits = np.where(looks, p.again_s, s.waits)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        wanted = p.torque_nm * s.stage / 3.0 * turns**p.power
        s.torque += dt * (wanted - s.torque) / 0.25
        return -wheel_force(self.setting, view, s.torque) * moving(view)
