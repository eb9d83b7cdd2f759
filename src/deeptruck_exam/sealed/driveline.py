"""Clutch, converter, gears, shafts and what turns with them."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("s_wound_shafts", "sealed", "suburban hills", name="driveline_backlash")
@sizes(base_s=(0.15, 0.4), per_g_s=(2.0, 7.0), closes_s=(0.2, 0.6), bounces=(0.1, 0.3))
class WoundShafts(Hidden, side=1.0, wound=0.0, left=0.0, share=1.0):
    """The play is crossed the later, the more the shafts were wound up before. per_g_s: for pull over weight.
    Source: Pham, Scamps, Bursi and others on clunk by release of stored torsion (Menday, Rahnejat and
    Ebrahimi, Clonk: an Onomatopoeic Response, Proc. IMechE D 213, 1999); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.where(np.abs(pull) > 180.0, np.sign(pull), s.side)
        turned = side != s.side
        s.left = np.where(turned, p.base_s + p.per_g_s * np.minimum(s.wound, 0.15), s.left - dt)
        s.wound = np.where(turned, 0.0, s.wound + dt * (np.abs(pull) / weight(view) - s.wound) / 0.8)
        s.left, s.side = np.maximum(s.left, -9.0), side
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.closes_s)
        t = np.maximum(-s.left, 0.0)
        ring = p.bounces * np.exp(-t / 0.4) * np.sin(2.0 * np.pi * 2.2 * t)
        felt = (s.share - 1.0 + np.where((s.left > 0.0) | (t > 3.0), 0.0, ring)) * pull
        return np.clip(felt, -0.12 * weight(view), 0.12 * weight(view)) * moving(view)


@hidden(
    "s_lockup_opens_on_kicks", "sealed", "suburban hills highway", name="torque_converter_slip",
    accepts="driveline_loss", trucks="freightliner", gateable=False,
)  # fmt: skip
@sizes(lost=(0.16, 0.32), coast=(0.3, 0.7), kick_per_s=(0.1, 0.25), stays_s=(4.0, 12.0))
class LockupOpensOnKicks(Hidden, was=0.0, pace=0.0, left=0.0, slips=0.0):
    """Each quick change of torque opens it for a while.
    Source: Lock-up clutches are opened during torque transients against jerks (Kiencke and Nielsen,
    Automotive Control Systems, 2005, on converters); a nervous control, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        s.pace = s.pace + (np.abs(load - s.was) - dt * s.pace) / 0.5
        s.was = load.copy()
        s.left = np.where(s.pace > p.kick_per_s, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.slips = s.slips + dt * ((s.left > 0.0) - s.slips) / 0.4
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - p.lost * pull) * moving(view)


@hidden(
    "s_rotor_on_rubber", "sealed", "suburban hills", name="rotating_inertia", accepts="mass payload_change"
)
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


@hidden("s_film_is_squeezed", "sealed", name="driveline_loss", accepts="torque_gain")
@sizes(dry=(0.12, 0.25), film=(0.03, 0.07), forms_mps=(3.0, 8.0), squeezes_s=(2.0, 8.0))
class FilmIsSqueezed(Hidden, film=0.5):
    """Meshes rub more at low speed and under load that lasts.
    Source: Dowson and Higginson, Elasto-Hydrodynamic Lubrication (1977): films grow with speed and fall with
    load; mixed friction of worn axle gears, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.traction_force) / (0.1 * weight(view))
        wanted = np.maximum(view.speed, 0.0) / p.forms_mps / (0.5 + load)
        s.film = s.film + dt * (np.minimum(wanted, 2.0) - s.film) / p.squeezes_s
        rubs = p.film + (p.dry - p.film) * np.exp(-s.film)
        return -rubs * np.abs(view.traction_force) * moving(view)


@hidden("s_clutch_learns", "sealed", "suburban hills", name="shift_interruption")
@sizes(hold_s=(0.3, 0.7), hot=(0.8, 2.0), cools_s=(15.0, 50.0), back_s=(0.25, 0.7))
class ClutchLearns(Hidden, gear=-1.0, hot=0.0, left=0.0, share=1.0):
    """The more changes there were of late, the longer each takes.
    Source: Myklebust and Eriksson, Modeling, Observability, and Estimation of Thermal Effects and Aging on
    Transmitted Torque in a Heavy Duty Truck with a Dry Clutch, IEEE/ASME Trans. Mechatronics 20 (2015): heat
    moves the kiss point; the time this costs is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.hot = np.minimum(s.hot + 0.3 * changed, 1.5) * (1.0 - dt / p.cools_s)
        waits = p.hold_s * (1.0 + p.hot * s.hot)
        s.left = np.where(changed, waits, np.maximum(s.left - dt * (view.shifting == 0.0), 0.0))
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.back_s)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@hidden("s_surge_damper", "sealed", "suburban hills", name="unknown", shown=True)
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
