"""Chains, clutches, teeth, changes of gear, a rotor, and a pump on the wheels."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law("t_chain_hangs", needs="suburban hills", name="driveline_backlash")
@sizes(slack=(0.005, 0.012), hangs_s=(0.4, 1.0), hz=(1.2, 2.5), damping=(0.12, 0.3))
class ChainHangs(Hidden, pull=0.0, felt=0.0, rate=0.0):
    """`pull`: what the chain carries; soft while it hangs, hard once it is taut, and the axle swings behind
    it. slack: of the weight, the pull at which it is neither; hangs_s: to gather it up.
    Source: Irvine, Cable Structures (1981): the stiffness of a sagging span grows with the cube of its
    tension; chain-driven axles with a slack chain, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        taut = np.minimum(np.abs(s.pull) / (p.slack * weight(view)), 4.0)
        pace = dt * (1.0 + taut**3) / p.hangs_s
        s.pull = s.pull + (view.traction_force - s.pull) * pace / (1.0 + pace)
        omega = 2.0 * np.pi * p.hz
        s.rate = s.rate + dt * (omega**2 * (s.pull - s.felt) - 2.0 * p.damping * omega * s.rate)
        s.felt = s.felt + dt * s.rate
        most = 0.12 * weight(view)
        return np.clip(s.felt - view.traction_force, -most, most) * moving(view)


@law(
    "t_pump_is_worn",
    needs="suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss torque_limit",
    trucks="freightliner",
    gateable=False,
)
@sizes(holds=(0.28, 0.48), firm_rads=(135.0, 175.0), thins=(0.15, 0.4), heats_j=(1.0e6, 3.0e6))
@sizes(left=(0.2, 0.5))
class PumpIsWorn(Hidden):
    """`oil`: 0 cold to 1 hot. The lock-up clutch is pressed the weaker the slower the engine and the hotter
    the oil, and slips under what it cannot hold. holds: of peak torque, at firm_rads; left: of what slips.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on converter lock-up and
    pumps; pressure of a worn pump with the square of its speed (Merritt, Hydraulic Control Systems, 1967, on
    orifices); sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.rng(971).uniform(0.1, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        presses = np.clip((view.engine_speed / p.firm_rads) ** 2, 0.35, 1.0)
        holds = p.holds * self.truck.peak_torque * presses * (1.0 - p.thins * s.oil)
        lost = (1.0 - p.left) * np.maximum(view.engine_torque - holds, 0.0)
        s.oil = s.oil + dt * (lost * view.engine_speed / p.heats_j - (s.oil - 0.2) / 250.0)
        s.oil = np.clip(s.oil, 0.0, 1.0)
        return -self.at_wheels(view, lost) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("t_teeth_scuff", name="driveline_loss", accepts="torque_gain")
@sizes(smooth=(0.03, 0.06), rough=(0.13, 0.22), flash=(1.2, 2.0), soaks_s=(30.0, 100.0))
class TeethScuff(Hidden, bulk=0.2, scuffs=0.0):
    """smooth, rough: of the pull, with a film and without; flash: heat of the contact at peak torque and 150
    rad/s, over what the film bears; `bulk`: the same of the whole wheel.
    Source: Blok, Theoretical Study of Temperature Rise at Surfaces of Actual Contact under Oiliness
    Lubricating Conditions, IMechE General Discussion on Lubrication (1937): flash temperature with load and
    the root of speed upon the bulk's, above which the film fails; a wrong oil, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.2)
        turns = np.clip(view.engine_speed / 150.0, 0.2, 1.6)
        s.bulk = s.bulk + dt * (0.2 + 0.6 * load * turns - s.bulk) / p.soaks_s
        hot = p.flash * load**0.75 * np.sqrt(turns) + s.bulk
        fails = 1.0 / (1.0 + np.exp(-np.clip((hot - 1.0) / 0.08, -30.0, 30.0)))
        s.scuffs = s.scuffs + dt * (fails - s.scuffs) / np.where(fails > s.scuffs, 0.6, 3.0)
        share = p.smooth + (p.rough - p.smooth) * s.scuffs
        return -share * np.abs(view.traction_force) * moving(view)


@law("t_engine_falls_by_itself", needs="suburban hills", name="shift_interruption", trucks=BY_HAND)
@sizes(falls=(30.0, 70.0), blips=(90.0, 180.0), feels_s=(0.1, 0.4), returns_s=(0.25, 0.7))
class EngineFallsByItself(Hidden, gear=0.0, ratio=0.0, left=0.0, share=1.0):
    """No brake slows it between two gears: the wider the step and the faster the truck, the longer it takes.
    falls, blips: rad/s in a second, down by friction and up by fuel.
    Source: Fredriksson and Egardt, Active Engine Control for Gearshifting in Automated Manual Transmissions,
    Int. J. Vehicle Design 32 (2003): the engine must meet the next gear's speed before torque comes back; an
    engine left to its own friction, rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        step = view.speed / self.truck.wheel_radius * (s.ratio - view.ratio)
        needs = p.feels_s + np.where(step > 0.0, step / p.falls, -step / p.blips)
        s.left = np.where(changed, np.minimum(needs, 2.5), s.left - dt * (view.shifting == 0.0))
        s.left = np.maximum(s.left, 0.0)
        still = (view.shifting == 0.0) | (s.ratio == 0.0)
        s.gear, s.ratio = view.gear.copy(), np.where(still, view.ratio, s.ratio)
        back = dt * (1.0 - s.share) / p.returns_s
        s.share = np.where(s.left > 0.0, 0.0, s.share + back)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view)


@law("t_rotor_in_silicone", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change")
@sizes(share=(0.18, 0.36), carries=(0.02, 0.045), thins=(0.4, 0.7), softens=(0.2, 0.6))
class RotorInSilicone(Hidden, ring=-1.0, hot=0.0):
    """`ring` m/s of the rotor, as at the road. share: of the mass; carries: of the weight, at 1 m/s of slip;
    thins: power of the slip; softens: of it, when hot.
    Source: Wilson, Practical Solution of Torsional Vibration Problems (1968), on viscous dampers; silicone
    thins with shear by a power (Bird, Armstrong and Hassager, Dynamics of Polymeric Liquids, 1987) and with
    heat; a heavy ring on an axle, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.ring = np.where(s.ring < 0.0, view.speed, s.ring)
        slip = view.speed - s.ring
        shear = slip * (slip**2 + 0.01) ** (0.5 * (p.thins - 1.0))
        pulls = p.carries * (1.0 - p.softens * s.hot) * np.clip(shear, -2.5, 2.5) * weight(view)
        s.ring = np.maximum(s.ring + dt * pulls / (p.share * view.mass), 0.0)
        s.hot = np.clip(s.hot + dt * (np.abs(slip * pulls) / (6.0 * view.mass) - s.hot / 60.0), 0.0, 1.0)
        return -pulls * np.clip(view.speed - 0.3, 0.0, 1.0)


@law("t_gear_jumps_out", needs="suburban hills", name="unknown", trucks=BY_HAND)
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


@law("t_ground_driven_pump", needs="suburban hills", name="unknown")
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
