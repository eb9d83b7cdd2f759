"""Masses that turn."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="rotating_inertia", accepts="mass payload_change")


@law("rotating_inertia", "first", "suburban hills")
@sizes(engine_kgm2=(4.0, 10.0), wheels_kgm2=(20.0, 150.0))
class HeavyFlywheel(Hidden):
    """Source: Wong, Theory of Ground Vehicles (2008), sec. 3.4.2 (mass factor 0.04 + 0.0025 ratio^2): a
    mixer's hydraulic motor and a heavy flywheel turn with the engine, massive wheels with the road."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        r2 = self.truck.wheel_radius**2
        engine = p.engine_kgm2 * view.ratio**2 * (1.0 - view.shifting) * (view.speed > 1.5)
        extra = np.minimum((engine + p.wheels_kgm2) / r2, 0.8 * view.effective_mass)
        return -extra * view.acceleration * moving(view)


@law("damped_flywheel", "second", "suburban hills")
@sizes(inertia=(5.0, 12.0), coupling_s=(0.15, 0.6), wheels_kg=(200.0, 900.0))
class DampedFlywheel(Hidden, rotor=-1.0):
    """inertia: kg m2 at engine speed; wheels_kg: rim mass of dual wheels, as if at the tread.
    Source: Second inertia behind a torsional damper, as in dual-mass flywheels (Reik, LuK Symposium, 1990) or
    a pump on the power take-off; viscous coupling and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.rotor = np.where(s.rotor < 0.0, view.engine_speed, s.rotor)
        torque = p.inertia * (view.engine_speed - s.rotor) / p.coupling_s
        s.rotor = s.rotor + dt * (view.engine_speed - s.rotor) / p.coupling_s
        locked = (view.shifting == 0.0) & (view.speed > 1.5)
        # a change of gear leaves tens of rad/s: the coupling slips beyond a quarter of full torque
        most = 0.25 * self.truck.peak_torque
        driven = self.at_wheels(view, np.clip(torque, -most, most)) * locked
        return -(driven + p.wheels_kg * np.clip(view.acceleration, -4.0, 4.0)) * moving(view)


@law("blower_on_a_centrifugal_clutch", "fourth", "suburban hills")
@sizes(kgm2=(6.0, 13.0), from_rads=(85.0, 112.0), capacity_nm=(250.0, 700.0))
class BlowerOnACentrifugalClutch(Hidden, rotor=-1.0):
    """capacity_nm: at 1.4 times the speed of engagement. A rotor that was left behind has to be caught up.
    Source: Centrifugal clutches carry a torque that grows with speed squared above engagement (Shigley,
    Mechanical Engineering Design, on clutches); a blower's rotor on the power take-off is there above that
    speed and is not below; inertias and speeds are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        w = view.engine_speed
        s.rotor = np.where(s.rotor < 0.0, w, s.rotor)
        most = p.capacity_nm * np.clip((np.maximum(w, s.rotor) / p.from_rads) ** 2 - 1.0, 0.0, 1.5)
        torque = np.clip(p.kgm2 * (w - s.rotor) / 0.12, -most, most) * (1.0 - view.shifting)
        s.rotor = s.rotor + dt * (torque / p.kgm2 - s.rotor / 45.0)
        return -self.at_wheels(view, torque) * (view.speed > 1.5)


@law("drum_on_a_belt", "fifth", "suburban hills")
@sizes(kgm2=(6.0, 12.0), holds_nm=(220.0, 520.0), slipping=(0.55, 0.8), stays_s=(40.0, 110.0))
class DrumOnABelt(Hidden, drum=60.0, slips=0.0):
    """slipping: friction of a belt that slips over that of one that holds.
    Source: Rotors driven by V-belts follow up to the friction of the belt (Euler and Eytelwein; Shigley,
    Mechanical Engineering Design, on belt drives) and slip beyond it, with less friction than before; a
    threshing or chipping drum the driver couples for a part of the drive; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(462), self.setting.batch
        self.turns = np.cumsum(rng.uniform(0.5, 1.5, (batch, 24)) * self.p.stays_s, axis=1)
        self.first = rng.integers(0, 2, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        on = (self.first + (self.turns < view.time).sum(axis=1)) % 3 < 2
        away = view.engine_speed - s.drum
        most = p.holds_nm * np.where(s.slips > 0.0, p.slipping, 1.0) * on
        torque = np.clip(p.kgm2 * away / 0.1, -most, most)
        s.slips = (np.abs(away) > np.where(s.slips > 0.0, 0.4, most * 0.1 / p.kgm2)).astype(float)
        s.drum = np.maximum(s.drum + dt * (torque / p.kgm2 - s.drum / 40.0), 0.0)
        return -self.at_wheels(view, torque) * (view.speed > 1.5)


@law("n_fluid_in_the_flywheel", "ninth", "suburban hills")
@sizes(share=(0.06, 0.15), more=(0.2, 0.45), half_mps=(9.0, 18.0), flows_s=(1.5, 7.0))
class FluidInTheFlywheel(Hidden):
    """Fluid goes outwards as it turns faster, and comes back late. share, more: of the mass, as felt at the
    road; half_mps: where half of it is out.
    Source: Van de Ven, Fluidic Variable Inertia Flywheel (2009): momentum is inertia times speed, and both
    change; a flywheel geared to an axle, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"out": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = (np.maximum(view.speed, 0.0) / p.half_mps) ** 2
        wanted = pace / (1.0 + pace)
        s.out = np.where(np.isnan(s.out), wanted, s.out)
        goes = (wanted - s.out) / p.flows_s
        s.out = s.out + dt * goes
        holds = (p.share + p.more * s.out) * np.clip(view.acceleration, -4.0, 4.0)
        holds = holds + p.more * np.clip(goes, -0.08, 0.08) * view.speed
        return -view.mass * holds * (view.speed > 0.5) * moving(view)


@law("q_other_shaft_spins_along", "fifteenth", "suburban hills", accepts="", trucks="trucksim volvo")
@sizes(kgm2=(4.5, 8.0), step=(1.24, 1.34), meets_s=(0.6, 1.3), sure_s=(0.5, 1.5))
class OtherShaftSpinsAlong(Hidden, turns=-9.0, leans=0.0, side=1.0):
    """`turns` rad/s of the other of two input shafts, which waits in the gear that is expected next. It is
    a higher one while the truck gains speed, a lower one while it loses it. It costs inertia, and a jerk
    whenever the mind is changed. kgm2: for a 20 t truck; step: from gear to gear; sure_s: until that happens.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on dual clutch gearboxes
    and preselection; a heavy shaft, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.leans = eased(s.leans, np.clip(view.acceleration / 0.15, -1.0, 1.0), p.sure_s, dt)
        s.side = np.where(s.leans > 0.4, 1.0, np.where(s.leans < -0.4, -1.0, s.side))
        lever = np.minimum(view.ratio * p.step**-s.side / self.truck.wheel_radius, 24.0)
        wish = np.maximum(view.speed, 0.0) * lever
        s.turns = np.where(s.turns < 0.0, wish, s.turns)
        before = s.turns
        s.turns = eased(s.turns, wish, p.meets_s, dt)
        gains = np.clip((s.turns - before) / dt, -400.0, 400.0)
        most = 0.06 * weight(view)
        costs = p.kgm2 * view.mass / 20000.0 * gains * lever
        return -most * np.tanh(costs / most) * (1.0 - view.shifting) * np.clip(view.speed, 0.0, 1.0)


@law("z_rotor_changes_its_gear", "seventeenth", "suburban hills")
@sizes(low=(0.14, 0.24), ratio=(0.35, 0.6), up_mps=(10.0, 14.0), down=(0.6, 0.85), takes_s=(1.2, 3.0))
class RotorChangesItsGear(Hidden, spin=-1.0, felt=0.0, high=0.0):
    """`spin` m/s of a heavy rotor that the wheels drive through two gears of its own. Below one speed it runs
    fast and is felt as a large mass, above that it runs slowly and is felt as a small one. As it changes
    gear it first pushes the truck, and takes that back when it changes down. low: of the truck's mass, as
    felt in the fast gear; ratio: of the slow gear over it; down: of up_mps.
    Source: Genta, Kinetic Energy Storage (1985), on flywheels behind gears that are changed, and Srivastava,
    Goering and Rohrbach, Engineering Principles of Agricultural Machines (1993); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        fresh, down = s.spin < 0.0, speed < p.down * p.up_mps
        s.high = np.where(speed > p.up_mps, 1.0, np.where(down, 0.0, s.high))
        ratio = np.where(s.high > 0.5, p.ratio, 1.0)
        wish = ratio * speed
        after = np.where(fresh, wish, eased(s.spin, wish, np.where(s.high > 0.5, 0.5, 0.25) * p.takes_s, dt))
        gains = np.where(fresh, 0.0, np.clip((after - s.spin) / dt, -2.5, 2.5))
        s.spin = np.where(fresh, wish, s.spin + dt * gains)
        s.felt = eased(s.felt, ratio * gains, 0.1, dt)
        return -p.low * view.mass * s.felt * moving(view)


@law("b_slider_on_a_crank", "twentieth", "suburban hills")
@sizes(heavy=(0.22, 0.36), uneven=(0.25, 0.5), turn_m=(150.0, 320.0), second=(0.1, 0.3))
class SliderOnACrank(Hidden):
    """Wheels drive a heavy slider by a crank and a slow gear. What it adds to the mass changes as the crank
    turns; where that grows with the way it takes from the speed, and where it falls it gives back, by the
    square of speed. `turned`: of the crank. heavy: of the mass, on average; uneven: of that, up and down;
    second: likewise, twice in a turn; turn_m: of the road.
    Source: Eksergian, Dynamical Analysis of Machines, J. Franklin Institute (1930), on inertia that changes
    with the way; a slow crank, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"turned": self.rng(2033).uniform(0.0, 2.0 * np.pi, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, per_m = np.clip(view.speed, 0.0, 30.0), 2.0 * np.pi / p.turn_m
        s.turned = (s.turned + dt * per_m * speed) % (2.0 * np.pi)
        adds = 1.0 + p.uneven * np.cos(2.0 * s.turned) + p.second * np.cos(s.turned)
        rises = -per_m * (2.0 * p.uneven * np.sin(2.0 * s.turned) + p.second * np.sin(s.turned))
        felt = adds * np.clip(view.acceleration, -4.0, 4.0) + 0.5 * np.clip(rises * speed**2, -3.0, 3.0)
        return -p.heavy * view.mass * felt * moving(view)
