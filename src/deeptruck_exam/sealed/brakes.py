"""Drums that open like bells, fluid with air in it, a short cable, and helpers in stops and turns."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, index, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_drums_open_like_bells", needs="descent", name="brake_fade")
@sizes(heats_jpkgk=(3.5, 7.0), bears_k=(60.0, 120.0), loss=(0.4, 0.65), wears_jpkg=(700.0, 2500.0))
@sizes(cools_s=(250.0, 500.0))
class DrumsOpenLikeBells(Hidden, hot=0.0):
    """`hot`: K above cold; `worn`: K at which the linings fit the drum. A drum that is hotter or colder than
    that touches them at one edge alone, until they have worn to its shape. heats_jpkgk: for each kg of truck;
    bears_k: misfit at which half of `loss` is lost.
    Source: Day, Harding and Newcomb, Combined Thermal and Mechanical Analysis of Drum Brakes, Proc. IMechE D
    198 (1984), on bell-mouthing, and Day, Braking of Road Vehicles (2014), on linings that wear to shape;
    wheels that turn cool better; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "worn": self.rng(1011).uniform(0.0, 60.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        misfit = ((s.hot - s.worn) / p.bears_k) ** 2
        lost = p.loss * misfit / (1.0 + misfit)
        speed = np.maximum(view.speed, 0.0)
        work = (1.0 - lost) * view.brake_force * speed / view.mass
        cools = (0.4 + np.sqrt(np.minimum(speed, 25.0) / 15.0)) / (1.4 * p.cools_s)
        s.hot = s.hot + dt * (work / p.heats_jpkgk - s.hot * cools)
        s.worn = s.worn + dt * work * (s.hot - s.worn) / p.wears_jpkg
        return lost * view.brake_force * moving(view)


@law("e_air_in_the_fluid", needs="suburban descent", name="brake_lag", accepts="command_delay clock_offset")
@sizes(air=(0.12, 0.3), bar=(0.03, 0.08), stiff=(0.3, 0.6), flows_s=(0.25, 0.55), share=(0.75, 1.0))
class AirInTheFluid(Hidden, volume=0.0):
    """`volume`: what has been pushed into the lines. It presses the air together first, so that gentle
    braking comes latest. air: of the volume at full braking; bar: pressure of the air at rest over that of
    full braking; stiff: of the lines without air; flows_s: to fill them at full pressure.
    Source: Yu, Chen and Lu, The Variation of Oil Effective Bulk Modulus with Pressure in Hydraulic Systems,
    J. Dyn. Sys. Meas. Control 116 (1994), on fluid with air in it, and Limpert, Brake Design and Safety, on
    air over hydraulic brakes; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = np.clip(view.brake_force / full, 0.0, 1.2)
        held = self.pressure(p, s.volume)
        differs = asked - held
        springs = np.where(differs > 0.0, differs, 1.5 * (differs - 0.05))  # of the shoes, that help it out
        s.volume = np.clip(s.volume + dt * np.clip(springs, -0.5, 0.5) / p.flows_s, 0.0, 2.0)
        return p.share * full * differs * moving(view)

    def pressure(self, p: Sizes, volume: Array) -> Array:
        """Over that of full braking: air takes p.air * q / (q + p.bar), the lines p.stiff * q."""
        b = p.air + p.stiff * p.bar - volume
        root = np.sqrt(np.maximum(b**2 + 4.0 * p.stiff * p.bar * volume, 0.0))
        return np.asarray(np.maximum((root - b) / (2.0 * p.stiff), 0.0))


@law("e_cable_is_too_short", needs="suburban descent", name="dragging_brake")
@sizes(drags=(0.008, 0.016), tight=(0.1, 0.5), squats=(0.5, 1.1), bumps=(0.3, 0.6), grows_jpkg=(150.0, 500.0))
class CableIsTooShort(Hidden, travel=0.0, pace=0.0, grown=0.0):
    """`travel` of the axle pulls the cable of the parking brake: by pull, slope and bumps, on springs. The
    drag warms the drum, which grows away from its shoes. drags: of the weight, for a travel of 1; tight: at
    rest; squats: for 1 m/s2 along the frame; grows_jpkg: work for each kg of truck.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on squat and bounce, and Limpert, Brake Design
    and Safety, on cables of parking brakes; sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.bumps = ou_series(self.rng(1012), shape, 0.1, 0.8)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = np.clip(view.acceleration + GRAVITY * view.grade, -2.5, 2.5)
        rough = p.bumps * self.bumps[:, index(view, self.bumps, 0.1)] * np.clip(view.speed / 12.0, 0.0, 1.5)
        omega = 2.0 * np.pi * 1.2
        s.pace = s.pace + dt * (omega**2 * (p.squats * along + rough - s.travel) - 0.7 * omega * s.pace)
        s.travel = np.clip(s.travel + dt * s.pace, -3.0, 3.0)
        pulls = np.clip(p.tight + s.travel - s.grown, 0.0, 2.0)
        work = p.drags * GRAVITY * pulls * np.maximum(view.speed, 0.0)
        s.grown = np.clip(s.grown + dt * (work / p.grows_jpkg - s.grown / 150.0), 0.0, 1.0)
        return -p.drags * pulls * weight(view) * moving(view)


@law("e_brake_closes_the_loop", needs="suburban descent", name="unknown")
@sizes(per_s=(0.5, 1.2), most=(0.35, 0.6), waits_s=(0.3, 0.7), lets_go_s=(0.2, 0.5))
class BrakeClosesTheLoop(Hidden, pressed=0.0, felt=0.0, adds=0.0):
    """The pedal asks for a slowing on the flat: more brake downhill and less uphill, until it is met. per_s:
    of what is lacking; most: of the brake force, added or taken.
    Source: Wrede and Decker, Brake by Wire for Commercial Vehicles, SAE 922489, and Breuer and Bill, Brake
    Technology Handbook (SAE, 2008), on deceleration control of electronic brakes of commercial vehicles;
    gains are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braking = view.brake_force > 0.002 * weight(view)
        s.pressed = np.where(braking, s.pressed + dt, 0.0)
        s.felt = s.felt + dt * (-view.acceleration - s.felt) / 0.25
        known = view.brake_force + view.rolling_force + view.drag_force
        lacks = np.clip(known / view.mass - s.felt, -2.0, 2.0) * (s.pressed > p.waits_s) * (view.speed > 1.5)
        most = p.most * view.brake_force / view.mass
        moves = np.where(braking, p.per_s * lacks, -s.adds / p.lets_go_s)
        s.adds = np.clip(s.adds + dt * moves, np.minimum(-most, 0.0), most + 0.02)
        return -s.adds * view.mass * np.where(braking, 1.0, 0.0) * np.clip(view.speed - 0.5, 0.0, 1.0)


@law("e_inner_wheel_is_braked", needs="suburban hills", name="unknown")
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
