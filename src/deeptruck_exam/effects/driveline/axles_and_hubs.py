"""Axles, hubs and their shafts in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("bearing_runs_hot", "third", "highway hills")
@sizes(most=(0.012, 0.028), critical_mps=(13.0, 18.0), grows_s=(12.0, 35.0), first=(0.2, 0.5))
class BearingRunsHot(Hidden):
    """The same speed may cost little or much: it depends on minutes of history.
    Source: Stein and Tu, A State-Space Model for Monitoring Thermally Induced Preload in Anti-Friction
    Spindle Bearings of High-Speed Machine Tools, J. Dyn. Sys. Meas. Control 116 (1994): heat tightens a
    bearing and tightness heats it, so that drag grows by itself above a speed and dies below; hubs of a
    truck, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"tight": self.p.first * self.rng(270).uniform(0.4, 1.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gain = np.clip(np.maximum(view.speed, 0.0) / p.critical_mps, 0.0, 1.6) ** 2 - 1.0
        s.tight = np.clip(s.tight + dt * gain * s.tight * (1.05 - s.tight) / p.grows_s, 0.06, 1.0)
        return -p.most * s.tight * weight(view) * moving(view)


@law("axles_wind_up", "fifth", "suburban hills")
@sizes(most=(0.016, 0.032), per_rad=(4.0, 10.0), unwinds_m=(80.0, 260.0), tightest=(0.004, 0.009))
class AxlesWindUp(Bends, wound=0.0):
    """`wound`: 1 where a tyre slips. Lifting the throttle does not unwind it, the way does. most: of the
    weight.
    Source: An inter-axle lock left in on a dry road: in every bend the axles turn unlike ways, the shafts
    wind up until a tyre slips, and unwind over the straight (truck makers' warnings on differential locks;
    Lanzer on 4WD wind-up, SAE 860241); stiffness and bends are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(472), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = np.maximum(view.speed, 0.0) * dt
        turned = p.per_rad * np.abs(self.read(self.bend, view))
        s.wound = np.clip(s.wound + way * (turned - s.wound / p.unwinds_m), 0.0, 1.0)
        return -p.most * s.wound**1.3 * weight(view) * moving(view)


@law("t_ground_driven_pump", "tenth", "suburban hills")
@sizes(holds=(0.008, 0.016), below_rads=(105.0, 130.0), fills_m=(60.0, 200.0), drains_s=(15.0, 45.0))
class GroundDrivenPump(Hidden, store=0.5, loaded=1.0, presses=0.0):
    """While the engine is too slow for its own pump, one on the wheels fills the store, against pressure,
    until that is full, and again when it is low. holds: of the weight.
    Source: ISO 5010 and UN Regulation No. 79 on emergency steering, which a pump on the driven wheels feeds;
    accumulators between two pressures (Merritt, Hydraulic Control Systems, 1967); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = np.clip((p.below_rads - view.engine_speed) / 8.0, 0.0, 1.0)
        s.loaded = np.where(s.store >= 1.0, 0.0, np.where(s.store <= 0.3, 1.0, s.loaded))
        works = slow * s.loaded
        fills = works * np.maximum(view.speed, 0.0) / p.fills_m
        s.store = np.clip(s.store + dt * (fills - 1.0 / p.drains_s), 0.0, 1.0)
        s.presses = s.presses + dt * (works - s.presses) / 0.4
        return -p.holds * s.presses * (0.7 + 0.3 * s.store) * weight(view) * moving(view)


@law("k_front_axle_leads", "fourteenth", "suburban hills descent")
@sizes(most=(0.010, 0.019), off_mps=(13.0, 17.0), holds_m=(150.0, 500.0), hard=(0.05, 0.09))
@sizes(soft=(0.3, 0.5), mean_m=(200.0, 700.0), joins_s=(0.3, 0.8))
class FrontAxleLeads(OnRoad, left=0.0, joined=0.0):
    """A front axle whose wheels run a little faster than those behind is clutched in by every braking and
    every hard pull, and stays in over a way, up to a speed. On firm road its tyres then scrub forwards; soft
    road lets them. most: of the weight; hard: of the weight, pull that clutches it in; soft: of the road.
    Source: Goering, Stone, Smith and Turnquist, Off-Road Vehicle Engineering Principles (ASAE, 2003), on the
    lead of front axles, and makers' manuals of tractors on four wheel drive that comes with the brakes; sizes
    are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1431), self.rows(), self.p.mean_m, self.p.soft)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        cause = (view.brake_force > 0.012 * weight(view)) | (view.traction_force > p.hard * weight(view))
        s.left = np.where(cause & (speed < p.off_mps), p.holds_m, np.maximum(s.left - dt * speed, 0.0))
        wish = (s.left > 0.0) * np.clip((p.off_mps - speed) / 1.0, 0.0, 1.0)
        s.joined = eased(s.joined, wish, p.joins_s, dt)
        firm = 1.0 - 0.8 * self.between(self.road, view)
        return -p.most * s.joined * firm * weight(view) * np.clip(speed, 0.0, 1.0)


@law("q_locker_is_left_in", "fifteenth", "suburban")
@sizes(
    most=(0.018, 0.032), hard=(0.05, 0.08), forgets_m=(250.0, 900.0), tight=(0.004, 0.009), ever=(0.3, 0.6)
)
class LockerIsLeftIn(Bends):
    """`left` m until the driver thinks of a differential that he has locked for a hard start. In bends its
    wheels want to roll ways of unlike length and scrub, nearly as much in a wide bend as in a tight one; on
    straights nothing is felt. most: of the weight; hard: of it, pull of a start at which he locks; tight:
    1/m, where most of the scrub is there; ever: of drives, that begin so.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on solid axles in bends, and makers' manuals
    against locked differentials on firm roads; bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = np.abs(self.draw_bends(self.rng(1531), 0.02))

    def start(self, batch: int) -> dict[str, Array]:
        begins = self.rng(1532).random(batch) < self.p.ever
        return {"left": np.where(begins, self.p.forgets_m, 0.0), "locked": begins.astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        starts = (speed < 3.0) & (view.traction_force > p.hard * view.mass * GRAVITY)
        s.left = np.where(starts, p.forgets_m, np.maximum(s.left - dt * speed, 0.0))
        s.locked = eased(s.locked, np.where(s.left > 0.0, 1.0, 0.0), 0.5, dt)
        scrubs = np.tanh(self.read(self.bend, view) / p.tight)
        return -p.most * s.locked * scrubs * weight(view) * np.clip(speed, 0.0, 1.0)


@law("v_shudders_off_the_line", "sixteenth", "suburban")
@sizes(most=(0.3, 0.5), hard=(0.045, 0.075), ends_mps=(6.0, 10.0), grows_s=(0.25, 0.6), seeds=(0.05, 0.12))
@sizes(dies_s=(0.5, 1.5))
class ShuddersOffTheLine(Hidden, shakes=0.05):
    """`shakes`: of a propeller shaft whose midship bearing sits in torn rubber. Under a hard pull at low
    speed its joints lift it, and what has begun to shake grows by itself to a size where it stays. A gentler
    foot or more speed ends it. most: of the pull, lost then; hard: of the weight, the pull that feeds it;
    seeds: what is always there.
    Source: Dana Spicer, driveshaft shudder at starts and joint angles, service bulletins, and Nayfeh and
    Mook, Nonlinear Oscillations (1979), on how self-excited ones grow; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        slow = np.clip((p.ends_mps - view.speed) / 2.0, 0.0, 1.0) * np.clip(view.speed / 0.5, 0.0, 1.0)
        feeds = np.clip(pull / weight(view) / p.hard, 0.0, 1.6) * slow
        gains = np.where(feeds > 0.5, (feeds - s.shakes**2) / p.grows_s, -1.0 / p.dies_s)
        s.shakes = np.clip(s.shakes * np.exp(dt * np.clip(gains, -4.0, 4.0)), p.seeds, 1.2)
        lost = p.most * np.clip(s.shakes - p.seeds, 0.0, 1.0)
        return -lost * pull * moving(view)


@law("v_pistons_touch_their_ring", "sixteenth", "suburban hills")
@sizes(most=(0.011, 0.019), hard=(0.03, 0.06), slow_mps=(4.0, 7.5), back_s=(12.0, 35.0), firm_mps=(8.0, 14.0))
class PistonsTouchTheirRing(Hidden):
    """`out`: of the pistons of hydraulic motors in the front hubs, which help at hard starts. When the truck
    is faster they should be pushed back by the pressure in the housing; a weak one takes long, and they beat
    along their ring. Fast turning throws them out against that pressure. most: of the weight, at 10 m/s, all
    out; hard: of the weight, a pull that calls for help; firm_mps: where turning halves the pressure.
    Source: Poclain Hydraulics, MHP and MFE hub motors, on freewheeling by case pressure that holds pistons
    in; a weak pressure, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"out": self.rng(1635).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        helps = (speed < p.slow_mps) & (view.traction_force > p.hard * weight(view))
        slow = p.back_s * (1.0 + (speed / p.firm_mps) ** 2) * np.where(speed < 1.0, 5.0, 1.0)
        s.out = np.where(helps, eased(s.out, 1.0, 0.5, dt), eased(s.out, 0.0, slow, dt))
        beats = np.clip((speed - p.slow_mps + 2.0) / 2.0, 0.0, 1.0) * np.minimum(speed / 10.0, 1.5) ** 0.7
        return -p.most * s.out * beats * weight(view) * moving(view)


@law("z_silicone_humps", "seventeenth", "suburban highway hills")
@sizes(most=(0.0022, 0.0036), hump=(4.0, 5.5), heats_s=(8.0, 20.0), cools_s=(12.0, 35.0), ends=(0.35, 0.6))
@sizes(thins=(0.3, 0.6), power=(0.5, 0.8))
class SiliconeHumps(Hidden, locks=0.0, humps=0.0):
    """`hot`: silicone between the plates of a coupling that joins two axles with unlike tyres. Their slip
    shears it all the time, and it thins as it warms. At 1 it fills its housing, presses the plates together
    and drags far more, until it has cooled. most: of the weight, cold, at 15 m/s; hump: times that, pressed;
    ends: of `hot`; thins: of the drag, lost when hot.
    Source: Taureg and Horst, Induced Torque Amplification in Viscous Couplings, SAE 900557 (1990), on the
    hump; tyres of two makes, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1732).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slip = np.clip(view.speed / 15.0, 0.0, 1.7)
        s.locks = np.where(s.hot > 1.0, 1.0, np.where(s.hot < p.ends, 0.0, s.locks))
        s.humps = eased(s.humps, s.locks, 1.2, dt)
        work = slip ** (1.0 + p.power) * (1.0 - s.humps) + 0.1 * s.humps
        s.hot = np.clip(s.hot + dt * (1.6 * work / p.heats_s - s.hot / p.cools_s), 0.0, 1.2)
        drag = (1.0 - p.thins * np.minimum(s.hot, 1.0)) * (1.0 + (p.hump - 1.0) * s.humps)
        return -p.most * drag * slip**p.power * weight(view) * moving(view)
