"""Shafts, gears, axles and joints in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
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


@law("z_rubber_tracks", "seventeenth", "suburban hills")
@sizes(
    bends=(0.08, 0.15), stiff=(0.001, 0.003), flaps=(0.01, 0.016), from_mps=(6.0, 10.0), slack=(0.015, 0.035)
)
@sizes(warms_s=(30.0, 90.0))
class RubberTracks(Hidden, tight=0.0, flap=0.0):
    """`tight`: pull over weight in rubber tracks in place of the driven wheels. Tight rubber is hard to bend
    round its wheels, so that each pull and push costs a share of itself. A slack track flaps above a speed,
    and `flap` takes time to grow and to die. `warm` rubber bends more easily. bends: of the pull; stiff,
    flaps: of the weight; slack: of it, the pull that ends flapping.
    Source: Wong, Theory of Ground Vehicles (2008), on internal losses of tracks by tension and speed, and
    Mattracks, conversions of trucks to rubber tracks; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1733).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pull = np.clip(np.abs(view.traction_force) / weight(view), 0.0, 0.15)
        s.tight = eased(s.tight, pull, 0.3, dt)
        s.warm = eased(s.warm, np.clip(speed / 15.0, 0.0, 1.2), p.warms_s, dt)
        slack = np.clip(1.0 - s.tight / p.slack, 0.0, 1.0)
        s.flap = eased(s.flap, slack * np.clip((speed - p.from_mps) / 5.0, 0.0, 1.0), 0.8, dt)
        cost = (p.stiff + p.bends * s.tight) * (1.0 - 0.4 * np.minimum(s.warm, 1.0)) + p.flaps * s.flap
        return -cost * weight(view) * moving(view)


@law("y_shaft_whirls", "eighteenth", "suburban highway hills")
@sizes(
    most=(0.015, 0.025), whirls_mps=(10.0, 15.0), narrow=(0.1, 0.18), grows_s=(1.0, 3.0), calms_s=(2.0, 7.0)
)
@sizes(bows=(0.2, 0.5), warms_s=(20.0, 60.0))
class ShaftWhirls(Hidden, wide=0.0):
    """A long shaft whirls near the speed of its own bending, touches its guard and rubs. `wide`: of the
    whirl, which grows within seconds and dies slowly. `bow`: rubbing heats one side and bows the shaft, so
    that the next whirl begins farther off. most: of the weight, in full whirl; narrow: of the speed; bows:
    wider when bowed.
    Source: Genta, Dynamics of Rotating Systems (2005), on whirl near critical speeds, and Newkirk, Shaft
    Rubbing, Mechanical Engineering 48 (1926), on bows by heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "bow": self.rng(1835).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        narrow = p.narrow * (1.0 + 2.0 * p.bows * s.bow)
        off = (np.maximum(view.speed, 0.0) / p.whirls_mps - 1.0) / narrow
        wish = 1.0 / (1.0 + off**2)
        s.wide = eased(s.wide, wish, np.where(wish > s.wide, p.grows_s, p.calms_s), dt)
        s.bow = eased(s.bow, s.wide, p.warms_s, dt)
        return -p.most * s.wide**1.5 * (0.6 + 0.4 * s.bow) * weight(view) * moving(view)
