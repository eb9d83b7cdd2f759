"""Rotors that turn behind couplings, springs and magnets, or change their form."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="rotating_inertia", accepts="mass payload_change")
DISCS = 4  # one behind the other


@law("freewheeling_rotor", "third", "suburban hills")
@sizes(share=(0.14, 0.28), grips_s=(0.3, 0.9), runs_s=(12.0, 40.0))
class FreewheelingRotor(Hidden, rotor=-1.0):
    """share: of the truck's mass, as if at the tread. Speeding up costs, slowing down gives nothing back.
    Source: An inertia behind an overrunning clutch, as freewheels in Dubbel, Taschenbuch für den Maschinenbau
    (2018): it is driven up and runs on by itself; a heavy rotor on the propeller shaft, sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.rotor = np.where(s.rotor < 0.0, view.speed, s.rotor)
        faster = np.maximum(view.speed - s.rotor, 0.0)
        most = 0.06 * weight(view)
        torque = np.minimum(p.share * view.mass * faster / p.grips_s, most)
        s.rotor = s.rotor + dt * (torque / (p.share * view.mass) - s.rotor / p.runs_s * (faster == 0.0))
        return -torque * moving(view)


@law("rotor_behind_a_coupling", "sixth", "suburban hills")
@sizes(kgm2=(7.0, 13.0), coupling_nm=(700.0, 1900.0), windage_nm=(5.0, 25.0))
class RotorBehindACoupling(Hidden, rotor=-1.0):
    """Both at 150 rad/s apart from rest: the faster the engine, the firmer the coupling.
    Source: A heavy rotor behind a hydrodynamic coupling on the power take-off: its torque goes with the
    difference of the squares of both speeds (Föttinger's similarity; Dubbel, Taschenbuch für den
    Maschinenbau, on hydrodynamic couplings); chippers and blowers, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.rotor = np.where(s.rotor < 0.0, view.engine_speed, s.rotor)
        torque = p.coupling_nm * (view.engine_speed**2 - s.rotor**2) / 150.0**2
        holds = p.windage_nm * (s.rotor / 150.0) ** 2
        s.rotor = np.maximum(s.rotor + dt * (torque - holds) / p.kgm2, 0.0)
        return -self.at_wheels(view, torque) * (view.speed > 1.5)


@law("flywheel_behind_an_induction_coupling", "seventh", "suburban hills")
@sizes(share=(0.22, 0.42), most=(0.018, 0.036), slip_mps=(0.25, 0.9), rubs_s=(60.0, 200.0))
class FlywheelBehindAnInductionCoupling(Hidden, rim=-1.0):
    """`rim` m/s of the flywheel as at the road: gentle changes carry it along, hard ones leave it behind.
    share: of the mass, as it is felt at the road; most: of the weight, at the pull-out slip.
    Source: Rolls and flywheels coupled to axles on vehicle benches; an induction coupling's torque over slip
    after Kloss (Fitzgerald, Kingsley and Umans, Electric Machinery, on induction machines): it rises to the
    pull-out slip and falls beyond; a towed generator's flywheel."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.rim = np.where(s.rim < 0.0, view.speed, s.rim)
        slip = (view.speed - s.rim) / p.slip_mps
        pulls = p.most * 2.0 * slip / (1.0 + slip**2) * weight(view) * (view.speed > 1.0)
        s.rim = np.maximum(s.rim + dt * (pulls / (p.share * view.mass) - s.rim / p.rubs_s), 0.0)
        return -pulls


@law("s_rotor_on_rubber", "eighth", "suburban hills")
@sizes(share=(0.16, 0.32), hz=(0.5, 1.3), damping=(0.1, 0.3))
class RotorOnRubber(Hidden, twist=0.0, rate=0.0):
    """share: of the mass, as felt at the road. It swings against the truck at first.
    Source: Rotors on rubber couplings (Nestorides, A Handbook on Torsional Vibration, 1958): one inertia
    behind a soft, damped shaft; a heavy drum on an axle, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        holds = omega**2 * s.twist + 2.0 * p.damping * omega * s.rate
        s.rate = s.rate + dt * (np.clip(view.acceleration, -4.0, 4.0) - holds)
        s.twist = np.clip(s.twist + dt * s.rate, -2.0, 2.0)
        return -p.share * view.mass * np.clip(holds, -4.0, 4.0) * (view.speed > 0.5) * moving(view)


@law("t_rotor_in_silicone", "tenth", "suburban hills")
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


@law("e_rotor_with_lost_motion", "eleventh", "suburban hills")
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


@law("w_rotor_comes_and_goes", "twelfth", "suburban hills")
@sizes(share=(0.18, 0.32), on_s=(20.0, 70.0), off_s=(15.0, 50.0), couples_s=(0.6, 1.5), feels_s=(0.15, 0.4))
class RotorComesAndGoes(Hidden, holds=0.0, speed=-1.0):
    """A clutch couples a heavy rotor to the wheels whenever its owner calls for it, by the clock; then its
    rim has to be sped up and slowed down with the truck. share: of the mass, as felt at the road.
    Source: Wong, Theory of Ground Vehicles (2008), on the mass factor of rotating parts, and the
    electromagnetic clutches of makers' power take-offs; a flail's rotor, spells are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        turn = self.rng(1136).uniform(0.0, self.p.on_s + self.p.off_s, batch)
        return {**super().start(batch), "clock": turn}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.speed = np.where(s.speed < 0.0, view.speed, s.speed)
        lag = (view.speed - s.speed) / p.feels_s
        s.speed = s.speed + dt * lag
        s.clock = (s.clock + dt) % (p.on_s + p.off_s)
        wants = (s.clock < p.on_s) * 1.0
        s.holds = s.holds + dt * (wants - s.holds) / p.couples_s
        felt = np.clip(lag, -2.5, 2.5)
        return -p.share * s.holds * view.mass * felt * np.clip(view.speed - 0.3, 0.0, 1.0)


@law("x_rotor_between_two_shafts", "thirteenth", "suburban hills")
@sizes(share=(0.16, 0.3), still=(0.28, 0.45), slips_s=(0.35, 0.9), most=(0.06, 0.11))
class RotorBetweenTwoShafts(Hidden, rotor=-99.0):
    """`rotor` m/s of a heavy rotor on the third shaft of a planetary gear, between the engine and the wheels:
    what it turns with is a difference of both, so that it weighs much in low gears, nothing in one gear, and
    has to be turned up or down at every change of gear, through a clutch that slips. share: of the mass, in
    the middle gears; still: of the highest ratio seen, where it stands; most: of the weight.
    Source: Miller, Hybrid Electric Vehicle Propulsion System Architectures of the e-CVT Type, IEEE Trans.
    Power Electronics 21 (2006): speeds of three shafts; a rotor of a generator, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "highest": np.full(batch, 12.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.highest = np.maximum(s.highest, np.minimum(view.ratio, 25.0))
        lever = np.clip(view.ratio / (p.still * s.highest) - 1.0, -1.0, 1.6)
        wants = lever * np.maximum(view.speed, 0.0)
        s.rotor = np.where(s.rotor < -90.0, wants, s.rotor)
        pace = (wants - s.rotor) / p.slips_s
        force = p.share * view.mass * lever * pace
        limit = p.most * weight(view)
        felt = limit * np.tanh(force / limit)
        s.rotor = s.rotor + dt * pace * np.abs(felt) / np.maximum(np.abs(force), 1.0)
        s.rotor = np.where(np.abs(force) < 1.0, s.rotor + dt * pace, s.rotor)
        return np.asarray(-felt * np.clip(view.speed - 0.3, 0.0, 1.0))


@law("k_magnets_slip_a_pole", "fourteenth", "suburban hills")
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


@law("v_weights_fly_out", "sixteenth", "suburban hills")
@sizes(least=(0.02, 0.05), more=(0.1, 0.18), flies_mps=(7.0, 12.0), lags_s=(0.3, 1.2))
class WeightsFlyOut(Hidden, out=-1.0, held=0.0, felt=0.0):
    """`out`: of the way that hinged flails of a rotor have swung outwards; the wheels drive it. The faster it
    turns the farther out they fly, so it takes up spin as by a growing mass, and pays it back as they fall
    in. least, more: of the truck's mass, as felt at the wheels, hanging and swung out; flies_mps: where half
    of that is done.
    Source: Den Hartog, Mechanical Vibrations (1956), on flyweights, and Srivastava, Goering and Rohrbach,
    Engineering Principles of Agricultural Machines (1993), on flail rotors; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        square = (speed / p.flies_mps) ** 2
        wish, fresh = square / (1.0 + square), s.out < 0.0
        s.out = np.where(fresh, wish, eased(s.out, wish, p.lags_s, dt))
        spin = (p.least + p.more * s.out) * speed
        pace = np.where(fresh, 0.0, np.clip((spin - s.held) / dt, -1.5, 1.5))
        s.held = spin
        s.felt = eased(s.felt, pace, 0.1, dt)
        return -view.mass * s.felt * moving(view)


@law("y_strap_grips_or_glides", "eighteenth", "suburban hills")
@sizes(heavy=(0.25, 0.4), grips=(0.1, 0.2), glides=(0.35, 0.6), fades_mps=(0.5, 1.5), drag_s=(80.0, 240.0))
class StrapGripsOrGlides(Hidden, rim=-1.0, felt=0.0):
    """`rim` m/s of a heavy rotor, as at the road, that a strap of leather carries along. While both turn
    alike the strap grips, and a hard change makes it glide. Gliding it holds less, the more the faster it
    glides, and grips again when both are alike. heavy: of the mass; grips: of the weight, most of the strap's
    force; glides: of that, when gliding fast.
    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, A Survey of Models for the Control of Machines with
    Friction, Automatica 30 (1994), on friction that falls with gliding; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rim = np.where(s.rim < 0.0, speed, s.rim)
        apart = speed - s.rim
        holds = p.glides + (1.0 - p.glides) * np.exp(-np.abs(apart) / p.fades_mps)
        most = 0.1 * p.grips / p.heavy * 9.81 * holds  # m/s2 of the rim
        gains = np.clip(apart / 0.15, -most, most)
        s.rim = np.maximum(s.rim + dt * (gains - s.rim / p.drag_s), 0.0)
        s.felt = eased(s.felt, gains, 0.08, dt)
        return -p.heavy * view.mass * s.felt * moving(view)


@law("h_discs_drag_each_other", "nineteenth", "suburban hills")
@sizes(heavy=(0.35, 0.55), drags_s=(0.35, 0.8), rubs_s=(60.0, 200.0), fresh=(0.1, 0.3))
class DiscsDragEachOther(Hidden):
    """Heavy discs stand one behind the other on a shaft, each in oil and driven by the one before it. A short
    pull turns the first alone, and a long one all of them. `rims` m/s, as at the road. heavy: of the mass,
    all together; drags_s: until a disc follows the one before it; rubs_s: until they would stop; fresh: of
    that time, faster with thick oil after a stop.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959), on what passes from layer to layer, and
    Inman, Engineering Vibration (2013), on rows of discs; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rims": np.full((DISCS, batch), -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rims = np.where(s.rims < 0.0, speed, s.rims)
        thick = 1.0 + p.fresh * np.exp(-speed / 4.0)
        before = np.concatenate([speed[None], s.rims[:-1]])
        drives = thick * (before - s.rims) / p.drags_s
        passed = np.concatenate([drives[1:], np.zeros((1, len(speed)))])
        s.rims = np.maximum(s.rims + dt * (drives - passed - s.rims / p.rubs_s), 0.0)
        felt = np.clip(drives[0], -4.0, 4.0)
        return -p.heavy / DISCS * view.mass * felt * moving(view)


@law("u_drum_carries_its_water_round", "twenty-first", "suburban hills")
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
