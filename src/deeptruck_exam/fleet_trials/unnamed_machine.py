"""Fifth effects for which no library name exists: what machines and their programs do by themselves."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "cam_hysteresis",
    name="unknown",
    forms="fifth",
    source="S-cam brakes give more torque on the way down than on the way up for one pressure, by friction"
    " of cam and shoes (Limpert, Brake Design and Safety, on mechanical efficiency; dynamometer traces of"
    " FMVSS 121): the play operator of Krasnosel'skii and Pokrovskii; dry bushings, sizes chosen here",
    ranges={"share": (0.25, 0.5), "least": (0.010, 0.025), "creeps_s": (2.0, 7.0)},
    needs=("suburban", "descent"),
)
class CamHysteresis(Hidden):
    """share: of the peak that is kept, above `least` of the weight; none is kept once the air is gone."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"shoe": np.zeros(batch), "peak": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, pressed = self.p, self.s, view.brake_force
        s.peak = np.maximum(s.peak - dt * (s.peak - pressed) / p.creeps_s, pressed)
        width = p.share * s.peak + p.least * weight(view)
        s.shoe = np.clip(s.shoe, pressed, pressed + width)
        s.shoe = np.where(pressed < 1e-3 * weight(view), s.shoe * (1.0 - dt / 0.3), s.shoe)
        return -np.maximum(s.shoe - pressed, 0.0) * moving(view)


@hidden(
    "engine_has_to_restart",
    name="unknown",
    forms="fifth",
    source="Stop-start systems of delivery trucks (SAE J3049 and makers' manuals): some seconds after the"
    " truck has come to rest the engine stops, and the first second or two of every launch goes to the"
    " starter, more when the brake is let go late; times are chosen here",
    ranges={"after_s": (0.8, 2.2), "cranks_s": (0.8, 1.8), "ramp_s": (0.4, 1.2), "odds": (0.75, 0.98)},
    needs=("suburban",),
)
class EngineHasToRestart(Hidden):
    """Not at every stop: a cold or needy battery keeps the engine on."""

    conceal = ("engine_speed", "engine_torque")

    def prepare(self) -> None:
        self.dice = self.setting.rng(481).random((self.setting.batch, 64))

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {
            "stood": zero,
            "off": zero.copy(),
            "since": np.full(batch, 1e3),
            "stops": np.zeros(batch, int),
        }

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        stands = view.speed < 0.05
        s.stops = np.where(stands & (s.stood == 0.0), (s.stops + 1) % 64, s.stops)
        s.stood = np.where(stands, s.stood + dt, 0.0)
        willing = self.dice[np.arange(len(s.stops)), s.stops] < p.odds
        asked = view.u[:, 0] > 0.01 * self.truck.full_command
        s.off = np.where(stands & (s.stood > p.after_s) & willing & ~asked, 1.0, s.off)
        wakes = (s.off > 0.0) & asked
        s.since = np.where(wakes, 0.0, s.since + dt)
        s.off = np.where(wakes, 0.0, s.off)
        back = np.clip((s.since - p.cranks_s) / p.ramp_s, 0.0, 1.0)
        missing = np.where((s.off > 0.0) & stands, 1.0, 1.0 - back)
        return -missing * np.maximum(view.traction_force, 0.0)


@hidden(
    "eases_before_the_crest",
    name="unknown",
    forms="fifth",
    source="Predictive cruise control drops torque before a crest and lets the hill do the rest, whatever the"
    " pedal says (Hellström, Ivarsson, Åslund and Nielsen, Control Engineering Practice 17, 2009; product"
    " notes of map-based cruise): acts on the change of slope, not on the slope; sizes chosen here",
    ranges={"cut": (0.45, 0.8), "falls": (0.004, 0.010), "holds_s": (4.0, 10.0), "from_mps": (9.0, 13.0)},
    needs=("hills",),
)
class EasesBeforeTheCrest(Hidden):
    """falls: the loss of slope over two hundred metres or so that is taken for a crest."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"mean": np.full(batch, np.nan), "left": zero, "depth": zero.copy(), "rests": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        mean = np.where(np.isnan(s.mean), view.grade, s.mean)
        s.mean = mean + dt * np.maximum(view.speed, 0.0) * (view.grade - mean) / 150.0
        crest = (s.mean - view.grade > p.falls) & (view.grade > -0.02) & (view.speed > p.from_mps)
        begins = crest & (s.rests <= 0.0)
        s.left = np.where(begins, p.holds_s, np.maximum(s.left - dt, 0.0))
        s.rests = np.where(begins, 1.5 * p.holds_s, np.maximum(s.rests - dt, 0.0))
        s.depth += dt * (p.cut * (s.left > 0.0) - s.depth) / 0.8
        return -wheel_force(self.setting, view, s.depth * np.maximum(view.engine_torque, 0.0)) * moving(view)


@hidden(
    "generator_on_the_trailer_axle",
    name="unknown",
    forms="fifth",
    source="Axle generators that feed a refrigerated trailer (product papers of recuperating trailer axles"
    " and of hub generators): a constant power, so that the drag is the larger the slower the truck, up to"
    " a limit; on and off with the box's thermostat; sizes are chosen here",
    ranges={
        "power_w": (14000.0, 34000.0),
        "most": (0.012, 0.022),  # of the weight
        "on_mps": (2.0, 5.0),
        "cools_s": (20.0, 60.0),
        "warms_s": (15.0, 50.0),
    },
    needs=("suburban", "highway", "hills"),
)
class GeneratorOnTheTrailerAxle(Hidden):
    def prepare(self) -> None:
        self.first = self.setting.rng(482).uniform(0.1, 0.9, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"box": self.first.copy(), "on": (self.first > 0.5).astype(float), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.on = np.where(s.box > 1.0, 1.0, np.where(s.box < 0.0, 0.0, s.on))
        turns = view.speed > p.on_mps
        s.box = s.box + dt * np.where(turns & (s.on > 0.0), -1.0 / p.cools_s, 1.0 / p.warms_s)
        s.box = np.clip(s.box, -0.05, 1.05)
        drag = np.minimum(p.power_w / np.maximum(view.speed, 1.0), p.most * weight(view))
        s.force += dt * (drag * s.on * turns - s.force) / 0.5
        return -s.force * moving(view)


@hidden(
    "hole_in_the_blending",
    name="unknown",
    forms="fifth",
    source="Blending of electric and friction brakes: where the motors hand over, as the truck slows and at"
    " the first touch, the pads still have to cross their clearance (von Albrichsfeld and Karner, Brake"
    " System for Hybrid and Electric Vehicles, SAE 2009-01-1217): a hole of less than a second; sizes chosen"
    " here",
    ranges={"depth": (0.5, 0.8), "at_mps": (3.0, 6.5), "lasts_s": (0.6, 1.5), "touch": (0.3, 0.7)},
    needs=("suburban",),
)
class HoleInTheBlending(Hidden):
    """Once in each application at the first touch, and once at the speed of the handover."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"hole": zero, "size": zero.copy(), "was": zero.copy(), "speed": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        braked = (view.brake_force > 0.01 * weight(view)).astype(float)
        hands_over = (s.speed >= p.at_mps) & (view.speed < p.at_mps) & (braked > 0.0)
        touched = (braked > s.was) & (view.speed > p.at_mps)
        s.size = np.where(hands_over, 1.0, np.where(touched, p.touch, s.size))
        s.hole = np.where(hands_over | touched, p.lasts_s, np.maximum(s.hole - dt, 0.0))
        s.was, s.speed = braked, view.speed.copy()
        shape = np.sin(0.5 * np.pi * np.clip(s.hole / p.lasts_s, 0.0, 1.0))
        return p.depth * s.size * shape * view.brake_force * moving(view)
