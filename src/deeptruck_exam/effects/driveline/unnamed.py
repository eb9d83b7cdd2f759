"""Shafts, gears, axles and joints in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("torsional_band_loss", "first", "suburban highway hills")
@sizes(centre_rpm=(1150.0, 1500.0), width_rpm=(60.0, 140.0), loss=(0.18, 0.40))
class ResonanceBand(Hidden):
    """Source: Driveline resonance in a band of engine speeds (Kiencke and Nielsen, Automotive Control
    Systems, 2005, on torsional drivelines); the torque lost in the band is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rpm = view.engine_speed * 30.0 / np.pi
        near = 1.0 / (1.0 + ((rpm - p.centre_rpm) / p.width_rpm) ** 4)
        lost = p.loss * near * (np.abs(view.engine_torque) + 80.0)
        return -self.at_wheels(view, lost) * moving(view)


@law("eco_roll", "first", "hills highway descent")
@sizes(from_mps=(9.0, 14.0), share=(0.8, 1.0), after_s=(0.6, 1.6))
class EcoRoll(Hidden, closed=0.0):
    """Source: Neutral coasting at a closed throttle, as look-ahead controls exploit it (Hellström, Åslund and
    Nielsen, Control Engineering Practice 18, 2010); thresholds are chosen here."""

    conceal = ("gear", "engine_speed", "engine_torque")

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.u[:, 1] <= 0.01)
        s.closed = np.where(closed & (view.speed > p.from_mps), s.closed + dt, 0.0)
        rolling = np.clip((s.closed - p.after_s) / 0.5, 0.0, 1.0)
        return p.share * rolling * np.maximum(-view.traction_force, 0.0)


@law("stepping_suspension_lock", "first", "suburban hills")
@sizes(yield_n=(900.0, 2600.0), stiffness=(0.8, 3.0))
class DahlBushing(Hidden, held=0.0):
    """stiffness: of yield force per m/s of speed change.
    Source: Dahl, A Solid Friction Model, Aerospace Corp. TOR-0158 (1968), in a locked bushing: the force
    depends on the history of acceleration, not on its value."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        limit = p.yield_n * weight(view) / 200000.0
        rate = view.acceleration * p.stiffness
        s.held += dt * rate * (1.0 - np.sign(rate) * s.held)
        s.held = np.clip(s.held, -1.0, 1.0)
        return -limit * s.held * moving(view)


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


@law("stuck_after_standing", "third", "suburban")
@sizes(per_log=(0.018, 0.040), ages_s=(0.4, 1.2), way_m=(10.0, 35.0))
class StuckAfterStanding(Hidden, stood=0.0, grip=0.0):
    """Source: Ageing of contacts at rest with the logarithm of time (Dieterich, J. Geophys. Res. 77, 1972;
    Rabinowicz, Friction and Wear of Materials, 1995): after every stop the truck has to break loose, over
    some metres; sizes of wet clay and frozen seals, chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.05
        s.stood = np.where(stands, s.stood + dt, 0.0)
        rolled = dt * np.maximum(view.speed, 0.0) / p.way_m
        s.grip = np.where(stands, np.maximum(s.grip, np.log1p(s.stood / p.ages_s)), s.grip * (1.0 - rolled))
        return -p.per_log * np.minimum(s.grip, 3.0) * weight(view) * moving(view)


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


@law("s_surge_damper", "eighth", "suburban hills", shown=True)
@sizes(gain=(0.2, 0.45), slow_s=(2.0, 6.0), most=(0.01, 0.025))
class SurgeDamper(Hidden, mean=0.0, force=0.0):
    """It takes every change of acceleration for a swing. most: of the weight.
    Source: Berriri, Chevrel and Lefebvre, Active Damping of Automotive Powertrain Oscillations by a Partial
    Torque Compensator, Control Engineering Practice 16 (2008); a filter that is set too slow, gains are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration, -3.0, 3.0)
        s.mean = s.mean + dt * (felt - s.mean) / p.slow_s
        most = p.most * weight(view)
        wanted = np.clip(-p.gain * (felt - s.mean) * view.mass, -most, most)
        works = (view.ratio > 0.0) & (view.shifting == 0.0) & (view.brake_force <= 0.0)
        s.force = s.force + dt * (wanted * works - s.force) / 0.3
        return s.force * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("n_load_point_is_shifted", "ninth", "highway suburban hills")
@sizes(gain=(0.5, 1.0), best=(0.3, 0.5), most=(0.07, 0.16), store_s=(8.0, 25.0))
class LoadPointIsShifted(Hidden, torque=0.0):
    """An electric machine on the shaft pushes where much is asked of the engine and charges where little is,
    as far as its battery goes. best, most: of peak torque; store_s: of peak power.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on load point shifting in parallel
    hybrids; a small battery, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "cell": self.rng(931).uniform(0.2, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        room = np.where(load > p.best, s.cell, 1.0 - s.cell)
        works = (self.pedal(view) > 0.03) & (view.brake_force <= 0.0) & (view.shifting == 0.0)
        wanted = np.clip(p.gain * (load - p.best), -p.most, p.most) * np.clip(room / 0.15, 0.0, 1.0) * works
        s.torque = s.torque + dt * (wanted - s.torque) / 0.4
        pace = view.engine_speed * self.truck.peak_torque / self.truck.peak_power
        s.cell = np.clip(s.cell - dt * s.torque * pace / p.store_s, 0.0, 1.0)
        return self.at_wheels(view, s.torque * self.truck.peak_torque) * moving(view)


@law("t_gear_jumps_out", "tenth", "suburban hills", trucks="trucksim volvo")
@sizes(holds=(0.010, 0.028), out_s=(0.8, 2.2), worn=(0.45, 0.8), back_s=(0.2, 0.6))
class GearJumpsOut(Hidden, side=1.0, wound=0.0, left=0.0, drives=1.0):
    """A worn gear that was loaded leaves its teeth as the load turns, and nothing drives or holds the truck
    until it is put in again. holds: pull over weight that wears the detent down; worn: share of the gears.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on dog teeth with back
    taper and detents against jumping out of gear; wear and times are chosen here."""

    conceal = ("engine_speed",)

    def prepare(self) -> None:
        self.worn = (self.rng(972).random(32) < self.p.worn).astype(float)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.where(np.abs(pull) > 200.0, np.sign(pull), s.side)
        worn = self.worn[view.gear.astype(int) % 32]
        leaves = (side != s.side) & (s.wound > p.holds) & (worn > 0.0) & (view.speed > 2.0)
        s.left = np.where(leaves, p.out_s, np.maximum(s.left - dt, 0.0))
        s.side = side
        s.wound = s.wound + dt * (np.abs(pull) / weight(view) - s.wound) / 1.0
        out = dt * np.where(s.left > 0.0, -s.drives / 0.05, (1.0 - s.drives) / p.back_s)
        s.drives = np.clip(s.drives + out, 0.0, 1.0)
        return -(1.0 - s.drives) * pull * moving(view)


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


@law("w_flywheel_pays", "twelfth", "suburban hills", trucks="trucksim volvo")
@sizes(inertia=(0.7, 1.3), lasts_s=(0.4, 1.0), bites_s=(0.1, 0.25), most=(0.05, 0.09))
class FlywheelPays(Hidden, ratio=0.0, owed=0.0, push=0.0):
    """The clutch closes before the engine has the new gear's speed: the flywheel gives what it has too much
    to the truck, and takes what it lacks. inertia: over that of the engine; most: of the weight.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), and Dolcini, Canudas de Wit and Bechart,
    Lurch Avoidance Strategy and Its Implementation in AMT Vehicles, Mechatronics 18 (2008), on engagement at
    unequal speeds; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wheel = np.maximum(view.speed, 0.0) / self.truck.wheel_radius
        changed = (s.ratio > 0.0) & (np.abs(view.ratio - s.ratio) > 0.02 * s.ratio) & (view.speed > 1.0)
        spin = np.clip((s.ratio - view.ratio) * wheel, -70.0, 70.0)
        impulse = p.inertia * self.truck.engine_inertia * spin * view.ratio / self.truck.wheel_radius
        s.owed = np.where(changed, impulse, s.owed)
        s.ratio = view.ratio.copy()
        pays = s.owed * (1.0 - view.shifting) / p.lasts_s
        pays = np.clip(pays, -p.most * weight(view), p.most * weight(view))
        s.owed = s.owed - dt * pays
        s.push = s.push + dt * (pays - s.push) / p.bites_s
        return np.asarray(s.push * np.clip(view.speed - 0.5, 0.0, 1.0))


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


@law("q_clutch_slips_after_starts", "fifteenth", "suburban hills", trucks="trucksim volvo", gateable=False)
@sizes(
    holds=(0.75, 0.95), fades=(0.25, 0.4), heats_jpkg=(25.0, 60.0), cools_s=(50.0, 150.0), grabs_s=(0.2, 0.6)
)
class ClutchSlipsAfterStarts(Hidden, slip=0.0):
    """`hot`: a worn clutch, that every start heats, and slip upon that. A cool one holds nearly all that the
    engine gives; a hot one passes on what it can, and the rest of the torque goes into more heat. holds: of
    peak torque, cool; fades: of that, lost when hot; heats_jpkg: for each kg of truck.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on dry clutches and their
    heat at starts, and ZF Sachs, clutch damage leaflets, on slip of worn ones; sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1533).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        most = p.holds * (1.0 - p.fades * np.minimum(s.hot, 1.2)) * self.truck.peak_torque
        s.slip = eased(s.slip, np.maximum(torque - most, 0.0), p.grabs_s, dt)
        lost = np.minimum(s.slip, torque)
        starts = (
            np.maximum(view.traction_force, 0.0) * np.clip(2.5 - view.speed, 0.0, 1.5) * (view.speed > 0.1)
        )
        work = (0.25 * lost * view.engine_speed + starts) / view.mass / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 1.5)
        return -self.at_wheels(view, lost) * moving(view)
