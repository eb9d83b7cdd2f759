"""A gearbox brake that rubs on, torque rods that are worn, clutches that have drained, a lock-up in upper
gears alone, and water that a drum has to carry round; a motor for the first metres."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
CHANGES = 83  # throws of dice for each drive
GEARS = 20


@law(
    "u_gearbox_brake_rubs_on",
    needs="hills suburban highway",
    name="driveline_loss",
    accepts="torque_gain engine_friction",
)
@sizes(
    nm=(170.0, 280.0), wears_rad=(900.0, 3000.0), stays=(0.25, 0.45), often=(0.6, 0.85), heavy=(0.04, 0.06)
)
class GearboxBrakeRubsOn(Hidden, gear=0.0, changes=0.0, rubs=0.5):
    """A small brake slows the countershaft for each change of gear, and should then let go. It often stays on
    by some amount, a new one with each change, and its lining is rubbed free by the turns that follow. nm: of
    torque at the gearbox's input, at most; wears_rad: until two thirds are free; stays: of it, that never is;
    often: share of changes after which it stays on; heavy: of the weight, at most.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on countershaft brakes;
    one that sticks, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(2131)
        shape = (self.setting.batch, CHANGES)
        self.dice = rng.uniform(0.4, 1.0, shape) * (rng.random(shape) < self.p.often)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (np.abs(view.gear - s.gear) > 0.5) & (view.shifting < 0.5)
        s.gear = np.where(changed, view.gear, s.gear)
        s.changes = s.changes + changed
        new = self.dice[np.arange(len(s.rubs)), s.changes.astype(int) % CHANGES]
        frees = 1.0 - dt * np.maximum(view.engine_speed, 0.0) / p.wears_rad
        s.rubs = np.where(changed, new, s.rubs * frees)
        nm = p.nm * (p.stays + (1.0 - p.stays) * s.rubs)
        return -np.minimum(self.at_wheels(view, nm), p.heavy * weight(view)) * moving(view)


@law("u_torque_rods_are_worn", needs="suburban hills", name="driveline_backlash")
@sizes(crosses=(0.035, 0.06), least_s=(0.35, 0.6), share=(0.8, 1.0), returns=(0.3, 0.6), gives_s=(0.15, 0.4))
class TorqueRodsAreWorn(Hidden, at=1.0, owed=0.0):
    """The rods that hold the driven axle have torn bushes. `at`: -1 and 1 where the axle lies against its
    stops, behind and ahead. Whenever pull turns to braking, by engine or by linings, it creeps across, and
    the truck feels nothing of the force meanwhile. Then it strikes, and gives part of that back at once.
    crosses: force over weight, for which least_s are needed from the middle; returns: what the blow gives.
    Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical Properties
    of Truck Leaf Springs, SAE 800905, on axles that are wound and moved by torque; torn bushes, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.clip((view.traction_force - view.brake_force) / weight(view), -0.15, 0.15)
        was = s.at
        s.at = np.clip(s.at + dt * np.clip(force / p.crosses, -1.5, 1.5) / p.least_s, -1.0, 1.0)
        free = np.clip((1.0 - np.abs(s.at)) / 0.1, 0.0, 1.0)
        lacks = p.share * free * force
        struck = (np.abs(s.at) >= 1.0) & (np.abs(was) < 1.0)
        gives = np.where(np.abs(s.at) >= 1.0, s.owed * p.returns / p.gives_s, 0.0)
        s.owed = np.where(struck, s.owed, np.where(free > 0.0, s.owed + dt * lacks, s.owed - dt * gives))
        s.owed = np.clip(s.owed, -0.06, 0.06) * np.where(free > 0.0, 1.0, np.exp(-dt / p.gives_s))
        felt = np.clip(gives, -0.06, 0.06) - lacks
        return felt * weight(view) * np.clip(view.speed, 0.0, 1.0)


@law("u_clutches_have_drained", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(extra_s=(1.0, 1.8), drains_s=(15.0, 45.0), cut=(0.85, 1.0), back_s=(0.1, 0.3))
class ClutchesHaveDrained(Hidden, gear=0.0, left=0.0, open=0.0):
    """Each gear has a wet clutch of its own, which drains slowly while its gear is not used. When the gear
    comes again the clutch has to be filled first, for the longer, the longer that is ago. `idle` s since each
    gear was used. extra_s: beyond the known time, for an empty clutch; cut: of the pull.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), and Hebbale and Kao,
    Adaptive Control of Shifts in Automatic Transmissions, ASME DSC 57 (1995), on the filling of clutches;
    clutches that leak, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        idle = self.p.drains_s * self.rng(2132).uniform(0.0, 3.0, (batch, GEARS))
        return {**super().start(batch), "idle": idle}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rows, now = np.arange(len(s.left)), np.clip(np.rint(view.gear), 0, GEARS - 1).astype(int)
        closes = (np.abs(view.gear - s.gear) > 0.5) & (view.shifting < 0.5) & (view.speed > 0.5)
        fills = p.extra_s * (1.0 - np.exp(-s.idle[rows, now] / p.drains_s)) * (s.gear > 0.5)
        s.left = np.where(closes, fills, np.maximum(s.left - dt, 0.0))
        s.gear = np.where(view.shifting < 0.5, view.gear, s.gear)
        s.idle = s.idle + dt
        s.idle[rows, now] = np.where(view.shifting < 0.5, 0.0, s.idle[rows, now])
        s.open = np.where(s.left > 0.0, 1.0, eased(s.open, 0.0, p.back_s, dt))
        return -p.cut * s.open * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "u_locks_in_upper_gears_alone",
    needs="suburban hills",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(from_ratio=(1.1, 1.8), slips=(0.4, 0.6), at_rads=(120.0, 160.0), shuts_s=(0.4, 1.5))
class LocksInUpperGearsAlone(Hidden, open=0.0):
    """The lock-up clutch of an old gearbox shuts in upper gears alone; below them the fluid carries all. Its
    slip goes with torque over the square of the engine's speed. from_ratio: of the gearbox, from which it
    stays open; slips: at peak torque and at_rads; shuts_s: in an upper gear.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up by gear and on
    the performance number of converters; a loose converter, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        low = view.ratio / self.truck.final_drive > p.from_ratio
        s.open = np.where(low, eased(s.open, 1.0, 0.15, dt), eased(s.open, 0.0, p.shuts_s, dt))
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** 2
        slip = np.minimum(p.slips * load * turns, 0.75)
        drives = slip * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, s.open * drives) * moving(view)


@law(
    "u_drum_carries_its_water_round",
    needs="suburban hills",
    name="rotating_inertia",
    accepts="mass payload_change",
)
@sizes(water=(0.3, 0.5), shell=(0.04, 0.09), spins_s=(3.0, 7.0), at_mps=(8.0, 12.0), sinks_s=(25.0, 70.0))
class DrumCarriesItsWaterRound(Hidden, rim=-1.0):
    """The wheels drive a washing drum full of water. Thin layers at its ends carry the water along, the
    faster, the faster both turn by the root of that; its own weight and what swims in it slow it down. `rim`
    m/s of the water as at the road. water, shell: of the mass; spins_s: at at_mps.
    Source: Greenspan, The Theory of Rotating Fluids (1968), on spin-up by layers at the ends; a drum on a
    truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rim = np.where(s.rim < 0.0, speed, s.rim)
        turns = np.maximum(0.5 * (speed + s.rim), 0.2)
        carries = (speed - s.rim) * np.sqrt(turns / p.at_mps) / p.spins_s
        s.rim = np.maximum(s.rim + dt * (carries - s.rim / p.sinks_s), 0.0)
        felt = p.water * carries + p.shell * view.acceleration
        return -np.clip(felt, -2.0, 2.0) * view.mass * moving(view)


@law("u_motor_for_the_first_metres", needs="suburban", name="unknown")
@sizes(hands_mps=(4.5, 7.5), more=(0.25, 0.5), dips=(0.6, 0.9), dips_s=(0.8, 1.6), tires_s=(25.0, 60.0))
class MotorForTheFirstMetres(Hidden, hot=0.3, was=0.0, dip=0.0, help=0.0):
    """Up to a speed a motor drives beside the engine, which is spared there: together they pull more than
    known, as long as the motor is cool. At the handover the engine alone lacks for a moment. `hot`: of what
    the motor bears. more: of the pull; dips: of the pull, lost at the handover; hands_mps: its speed.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on parallel hybrids that start by
    their motor; a rough handover, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = np.clip((p.hands_mps - view.speed) / 0.5, 0.0, 1.0)
        pull = np.maximum(view.traction_force, 0.0)
        works = slow * np.clip(pull / (0.08 * weight(view)), 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (works / (0.3 * p.tires_s) - s.hot / p.tires_s), 0.0, 1.2)
        hands = (s.was < p.hands_mps) & (view.speed >= p.hands_mps) & (view.acceleration > 0.0)
        s.was = view.speed.copy()
        s.dip = np.where(hands, 1.0, np.maximum(s.dip - dt / p.dips_s, 0.0))
        s.help = eased(s.help, slow * np.clip(1.6 * (1.0 - s.hot), 0.0, 1.0), 0.2, dt)
        share = p.more * s.help - p.dips * np.sqrt(s.dip)
        return share * pull * np.clip(view.speed, 0.0, 1.0)
