"""Teeth that bounce, a converter that locks late, a worm axle, a gear that is held fast, a loose rotor, and a
spared clutch."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law("e_teeth_bounce", needs="suburban hills", name="driveline_backlash")
@sizes(flies=(250.0, 800.0), back=(0.45, 0.7), knocks_s=(0.12, 0.3), rests=(0.25, 0.6))
class TeethBounce(Hidden, at=1.0, rate=0.0, touches=1.0, knock=0.0):
    """`at`: -1 and 1 where the teeth touch, `rate` of the way between. They meet the other flank, bounce, and
    meet it again, each time more gently; nothing is driven in between, and each blow is felt. flies: 1/s2 for
    a pull of the weight; back: of the speed, after a blow; rests: 1/s at which they stay.
    Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts (1996), on hammering in gears
    with play and restitution; plays and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force / weight(view)
        s.rate = s.rate + dt * np.clip(p.flies * pull, -40.0, 40.0)
        at = s.at + dt * s.rate
        meets = (np.abs(at) >= 1.0) & (at * s.rate > 0.0)
        stays = meets & (np.abs(s.rate) < p.rests)
        blow = np.where(meets & ~stays, (1.0 + p.back) * s.rate / p.flies, 0.0)
        s.rate = np.where(stays, 0.0, np.where(meets, -p.back * s.rate, s.rate))
        s.at = np.clip(at, -1.0, 1.0)
        s.touches = s.touches + dt * (1.0 * (np.abs(s.at) >= 1.0) - s.touches) / 0.04
        s.knock = s.knock * np.exp(-dt / p.knocks_s) + blow / p.knocks_s
        felt = np.clip(s.knock, -0.12, 0.12) - (1.0 - s.touches) * pull
        return np.asarray(felt * weight(view) * moving(view))


@law(
    "e_locks_when_it_is_let",
    needs="suburban hills",
    name="torque_converter_slip",
    accepts="driveline_loss torque_limit",
    trucks="freightliner",
    gateable=False,
)
@sizes(gentle=(0.25, 0.45), waits_s=(1.0, 2.5), last_s=(12.0, 25.0), slips=(0.14, 0.26), left=(0.3, 0.7))
class LocksWhenItIsLet(Hidden, gear=0.0, since=0.0, open=0.0):
    """Every change of gear opens the lock-up clutch. It shuts again only once torque is gentle, or after a
    long time. gentle: of peak torque; slips: of the torque, lost at peak torque; left: of the engine's drag,
    while it is open.
    Source: Hahn and Lee, Nonlinear Robust Control of Torque Converter Clutch Slip System for Passenger
    Vehicles Using Advanced Torque Estimation Algorithms, Vehicle System Dynamics 37 (2002), on engagement
    under torque; one that avoids it, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0)
        s.gear = view.gear.copy()
        s.since = np.where(changed, 0.0, np.minimum(s.since + dt, 100.0))
        load = view.engine_torque / self.truck.peak_torque
        shuts = ((s.since > p.waits_s) & (np.abs(load) < p.gentle)) | (s.since > p.last_s)
        wants = np.where(changed, 1.0, np.where(shuts, 0.0, np.rint(s.open)))
        pace = np.where(wants > s.open, 0.15, 0.8)
        s.open = np.where(changed, np.maximum(s.open, 0.6), s.open + dt * (wants - s.open) / pace)
        lost = p.slips * np.sqrt(np.clip(load, 0.0, 1.1)) * np.maximum(view.engine_torque, 0.0)
        drag = (1.0 - p.left) * np.minimum(view.engine_torque, 0.0)
        rolls = np.clip(view.speed - 1.0, 0.0, 1.0)
        return -self.at_wheels(view, s.open * (lost + drag)) * rolls


@law("e_worm_axle", name="driveline_loss", accepts="torque_gain")
@sizes(lead=(0.42, 0.6), rubs=(0.05, 0.09), least=(0.012, 0.022), film_mps=(2.0, 5.0), warms_s=(80.0, 250.0))
class WormAxle(Hidden, warm=0.0):
    """The worm slides on its wheel: slowly with much friction, fast with little. What drives it from the
    other side loses more than what it drives. lead: rad, of its thread; film_mps: of sliding; cold oil rubs
    by half more.
    Source: Merritt, Gears (1954), and Buckingham, Analytical Mechanics of Gears (1949): efficiency is tan l /
    tan(l + r) forwards and tan(l - r) / tan l backwards, with a friction that falls with sliding; worm axles
    of heavy trucks, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = s.warm + dt * (1.0 - s.warm) * np.clip(view.speed / 10.0, 0.0, 1.5) / p.warms_s
        slides = 0.6 * np.maximum(view.speed, 0.0)
        rubs = (p.least + p.rubs * np.exp(-((slides / p.film_mps) ** 0.7))) * (1.5 - 0.5 * s.warm)
        angle = np.arctan(rubs)
        forwards = 1.0 - np.tan(p.lead) / np.tan(p.lead + angle)
        backwards = 1.0 - np.tan(p.lead - angle) / np.tan(p.lead)
        lost = np.where(view.traction_force > 0.0, forwards, backwards)
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("e_gear_is_held_fast", needs="suburban hills", name="shift_interruption", trucks=BY_HAND)
@sizes(per_pull_s=(2.5, 6.0), tries_s=(0.15, 0.4), returns_s=(0.3, 0.8), feels_s=(0.25, 0.6))
class GearIsHeldFast(Hidden, gear=0.0, pull=0.0, before=0.0, left=0.0, share=1.0):
    """Teeth that are pressed do not let go of their gear: the harder the pull before a change, the longer
    until the next gear drives. per_pull_s: for a pull of a tenth of the weight, which is as much as it bears
    in a low gear.
    Source: Bóka, Márialigeti, Lovas and Trencséni, Face Dog Clutch Engagement at Low Mismatch Speed,
    Periodica Polytechnica Transportation Engineering 38 (2010), on dogs of automated truck gearboxes, and
    shafts that have to unwind before; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        open_, pull = view.shifting > 0.0, np.abs(view.traction_force) / weight(view)
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        s.gear = view.gear.copy()
        s.before = np.where(open_, s.before, s.before + dt * (pull - s.before) / p.feels_s)
        needs = p.tries_s + p.per_pull_s * np.clip(s.before / 0.1, 0.0, 1.0) ** 1.5
        s.left = np.where(changed, np.minimum(needs, 1.6), s.left - dt * ~open_)
        s.left = np.maximum(s.left, 0.0)
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.returns_s)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law(
    "e_rotor_with_lost_motion", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change"
)
@sizes(share=(0.16, 0.3), play_m=(0.05, 0.25), hz=(1.3, 2.6), damping=(0.15, 0.4), bearing=(0.0005, 0.002))
class RotorWithLostMotion(Hidden, ring=-1.0, ahead=0.0):
    """`ring` m/s of the rotor, `ahead` m of it before the truck, both as at the tread. Within its play it
    turns alone; then it is carried along, or runs on against the other stop. share: of the mass; bearing: of
    the weight, that slows it.
    Source: Kobrinskii, Dynamics of Mechanisms with Elastic Connections and Impact Systems (1969); a heavy
    drum behind worn dogs, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.ring = np.where(s.ring < 0.0, view.speed, s.ring)
        omega = 2.0 * np.pi * p.hz
        beyond = s.ahead - np.clip(s.ahead, -p.play_m, p.play_m)
        faster = s.ring - view.speed
        touches = np.clip(np.abs(beyond) / 0.01, 0.0, 1.0)
        pulls = omega**2 * beyond + 2.0 * p.damping * omega * faster * touches
        pulls = np.clip(pulls, -3.0, 3.0)
        slows = p.bearing / p.share * 9.81 * np.clip(s.ring, 0.0, 1.0)
        s.ring = np.maximum(s.ring - dt * (pulls + slows), 0.0)
        s.ahead = np.clip(s.ahead + dt * faster, -p.play_m - 0.6, p.play_m + 0.6)
        return np.asarray(p.share * view.mass * pulls * np.clip(view.speed - 0.3, 0.0, 1.0))


@law("e_clutch_is_spared", needs="suburban hills", name="torque_limit", trucks=BY_HAND, shown=True)
@sizes(least=(0.26, 0.42), bears_jpkg=(6.0, 14.0), cools_s=(120.0, 300.0))
class ClutchIsSpared(Hidden):
    """`hot`: of what the clutch bears. The engine turns faster than the gear in every start; the work of that
    slip heats the clutch, and a hot one is given less torque. least: of peak torque; bears_jpkg: for each kg
    of truck.
    Source: Dolcini, Canudas de Wit and Béchart, Dry Clutch Control for Automotive Applications (2010), on the
    energy of engagement, and protection of automated clutches in makers' manuals; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(1043).uniform(0.3, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.speed, 0.0) * view.ratio / self.truck.wheel_radius
        slips = np.clip(view.engine_speed - turns, 0.0, 120.0) * (view.speed < 4.0) * (1.0 - view.shifting)
        work = np.maximum(view.engine_torque, 0.0) * slips / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.bears_jpkg - s.hot / p.cools_s), 0.0, 1.2)
        most = (1.1 - (1.1 - p.least) * np.clip(s.hot, 0.0, 1.0) ** 0.8) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0))
