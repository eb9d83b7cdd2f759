"""A locker that crosses over, open clutches that drag, a splitter that follows, slip against boom, magnets
that slip a pole, a front axle that leads, and a trailer that carries itself."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law("k_locker_crosses_over", needs="suburban hills", name="driveline_backlash")
@sizes(way_m=(10.0, 24.0), pushes=(0.6, 1.5), winds_s=(0.15, 0.35), opens_s=(0.08, 0.15))
class LockerCrossesOver(Hidden, at=1.0, given=0.0):
    """`at`: -1 and 1 where the claws of a locking differential hold for holding back and for driving. When
    the torque turns, cams have to cross over: wheels do that as they roll, over a way, and a hard pull helps;
    until the claws have met nothing is passed on. way_m: of half the crossing; pushes: of it, in a second by
    a tenth of the weight.
    Source: Eaton, Detroit Locker and NoSPIN Differential, Owner's Manual, on the change from drive to coast;
    a worn one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.clip(pull / (0.002 * weight(view)), -1.0, 1.0)
        hard = np.clip(10.0 * np.abs(pull) / weight(view), 0.0, 1.0)
        crosses = np.maximum(view.speed, 0.0) / p.way_m + p.pushes * hard
        s.at = np.clip(s.at + dt * side * crosses, -1.0, 1.0)
        holds = np.clip((s.at * side - 0.7) / 0.3, 0.0, 1.0)
        s.given = eased(s.given, holds * pull, np.where(holds > 0.0, p.winds_s, p.opens_s), dt)
        return np.asarray((s.given - pull) * np.clip(view.speed, 0.0, 1.0))


@law("k_open_clutches_drag", name="driveline_loss", accepts="torque_gain")
@sizes(nm=(70.0, 130.0), at_rads=(105.0, 135.0), thick=(0.5, 1.1), warms_s=(80.0, 240.0), airs_s=(0.4, 1.2))
@sizes(floods_s=(3.0, 9.0))
class OpenClutchesDrag(Hidden, warm=0.0, air=0.0):
    """Clutches in oil that are open shear the oil between their plates: drag grows with speed until oil is
    flung out and air comes in, and then falls away; oil floods them again only slowly. Odd gears leave more
    of them open. nm: at `at_rads` with warm oil; thick: more, with cold oil.
    Source: Yuan, Guo, Hu and Prakash, An Improved Hydrodynamic Model for Open Wet Transmission Clutches, J.
    Fluids Engineering 129 (2007); a gearbox of many clutches, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = 0.3 + np.clip(np.abs(view.traction_force) * view.speed / self.truck.peak_power, 0.0, 1.0)
        s.warm = eased(s.warm, 1.0, p.warms_s / work, dt)
        turns = np.maximum(view.engine_speed, 0.0) / p.at_rads
        wish = np.clip((turns - 1.0) / 0.2, 0.0, 1.0)
        s.air = eased(s.air, wish, np.where(wish > s.air, p.airs_s, p.floods_s), dt)
        packs = 0.7 + 0.3 * (np.rint(view.gear) % 2.0)
        torque = (
            p.nm * (1.0 + p.thick * (1.0 - s.warm)) * np.minimum(turns, 1.4) * (1.0 - 0.85 * s.air) * packs
        )
        return -self.at_wheels(view, torque) * moving(view)


@law("k_splitter_follows", needs="suburban hills", name="shift_interruption", trucks=BY_HAND)
@sizes(open_s=(0.6, 1.2), waits_s=(2.0, 5.0), light=(0.015, 0.04), ramps_s=(0.3, 0.8))
class SplitterFollows(Hidden, gear=0.0, waits=0.0, open=0.0, share=1.0):
    """A half gear was chosen along with the last change, but its claws come out only when torque lets them
    go: once the driver eases the pedal, or when the computer has lost patience, there is a second gap.
    waits_s: at the longest; light: of the weight, pull at which they come out.
    Source: Eaton Fuller, Driver Instructions of 13 and 18 speed transmissions, on splitter shifts that are
    preselected and wait for a break in torque; automated, times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.5)
        s.gear = view.gear.copy()
        s.waits = np.where(changed, dt, np.where(s.waits > 0.0, s.waits + dt * (view.shifting < 0.5), 0.0))
        light = (view.traction_force < p.light * weight(view)) & (s.waits > 0.8)
        goes = light | (s.waits > p.waits_s)
        s.open = np.where(goes, p.open_s, np.maximum(s.open - dt, 0.0))
        s.waits = np.where(goes, 0.0, s.waits)
        s.share = np.clip(s.share + dt * np.where(s.open > 0.0, -1.0 / 0.12, 1.0 / p.ramps_s), 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law(
    "k_slips_against_boom",
    needs="hills suburban",
    name="torque_converter_slip",
    accepts="driveline_loss torque_limit",
    trucks="freightliner",
    gateable=False,
)
@sizes(slip_rads=(16.0, 30.0), boom_rads=(125.0, 160.0), wide_rads=(10.0, 30.0), finds_s=(0.4, 1.2))
@sizes(cold=(0.3, 0.8), warms_s=(80.0, 240.0))
class SlipsAgainstBoom(Hidden, slip=0.0, warm=0.0):
    """The lock-up clutch is steered to a slip wherever the engine would boom: at low speed and under load;
    above that it is shut. Cold oil lets it overshoot. slip_rads: at full torque; boom_rads: below which it
    slips; cold: more of it, with cold oil.
    Source: Kono, Itoh, Nakamura, Yoshizawa and Osawa, Torque Converter Clutch Slip Control System, SAE
    950672; a truck's, and much slip, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.4 + load), dt)
        low = np.clip((p.boom_rads - view.engine_speed) / p.wide_rads, 0.0, 1.0)
        wish = p.slip_rads * low * np.sqrt(load) * (1.0 + p.cold * (1.0 - s.warm))
        s.slip = eased(s.slip, wish, p.finds_s, dt)
        lost = np.minimum(s.slip / np.maximum(view.engine_speed, 75.0), 0.5)
        torque = lost * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("k_magnets_slip_a_pole", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change")
@sizes(share=(0.14, 0.24), most=(0.025, 0.045), pole_m=(0.3, 0.6), damps=(0.08, 0.2))
class MagnetsSlipAPole(Hidden, rotor=-99.0, angle=0.0):
    """`rotor` m/s of a heavy rotor as at the tread, that magnets take along without touching: they hold like
    a spring up to an angle, and beyond the most they can pull they slip from pole to pole until the rotor has
    the truck's speed again. share: of the mass; most: of the weight; pole_m: of the way, for an angle of 1;
    damps: of critical, by eddy currents.
    Source: Furlani, Permanent Magnet and Electromechanical Devices (2001), on synchronous couplings whose
    torque goes with the sine of the angle; a rotor of a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rotor = np.where(s.rotor < -50.0, speed, s.rotor)
        stiff = p.most * GRAVITY / p.share
        eddies = 2.0 * p.damps * np.sqrt(stiff / p.pole_m)
        pull = stiff * np.sin(s.angle)
        behind = speed - s.rotor
        after = (behind - dt * pull) / (1.0 + dt * eddies)
        gains = np.clip((behind - after) / dt, -4.0, 4.0)
        s.rotor = s.rotor + dt * gains
        s.angle = (s.angle + dt * after / p.pole_m + np.pi) % (2.0 * np.pi) - np.pi
        return -p.share * view.mass * gains * np.clip(speed, 0.0, 1.0)


@law("k_front_axle_leads", needs="suburban hills descent", name="unknown")
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


@law("k_trailer_carries_itself", needs="suburban hills", name="unknown")
@sizes(share=(0.3, 0.5), gain=(0.4, 0.7), lags_s=(0.4, 1.0), most=(0.025, 0.045), store_jpkg=(60.0, 160.0))
class TrailerCarriesItself(Hidden, acts=0.0):
    """A trailer with a driven axle feels what the kingpin pulls and takes part of that on itself, driving or
    holding back, as far as its battery goes: `store`, 0 empty to 1 full. share: of the mass, in the trailer;
    gain: of the pull; most: of the weight; store_jpkg: for each kg of truck.
    Source: makers' descriptions of electrified trailers that are steered by a force sensor in the kingpin,
    and Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on limits of charge; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "store": self.rng(1432).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = view.grade + self.truck.rolling_resistance
        pulls = p.share * (np.clip(view.acceleration, -2.0, 2.0) / GRAVITY + slope)
        wish = p.most * np.tanh(p.gain * pulls / p.most)
        room = np.where(wish > 0.0, s.store, 1.0 - s.store)
        s.acts = eased(s.acts, wish * np.clip(room / 0.15, 0.0, 1.0), p.lags_s, dt)
        used = s.acts * GRAVITY * np.maximum(view.speed, 0.0) / p.store_jpkg
        s.store = np.clip(s.store - dt * np.where(used > 0.0, used, 0.7 * used), 0.0, 1.0)
        return s.acts * weight(view) * np.clip(view.speed - 0.5, 0.0, 1.0)
