"""Teeth that touch at their edges, torn bushes, clutches that overlap, a converter that is opened on slopes,
a slider on a crank, and rubber that braking winds up."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "b_teeth_touch_at_their_edges",
    needs="hills suburban highway",
    name="driveline_loss",
    accepts="torque_gain",
)
@sizes(most=(0.2, 0.32), bends=(0.35, 0.6), power=(2.0, 4.0), warms_s=(10.0, 30.0), warps=(0.3, 0.7))
class TeethTouchAtTheirEdges(Hidden):
    """A weak housing bends under torque until the teeth touch at their edges alone: little is lost at half
    torque and a good share beyond it. `warm` housing bends sooner. most: of the torque, lost; bends: of peak
    torque, where half of that is lost; warps: of it, less when warm.
    Source: Niemann and Winter, Maschinenelemente II (2003), on face load by misalignment under torque, and
    Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses of the mesh; a weak
    housing, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2031).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.1)
        s.warm = eased(s.warm, np.clip(1.3 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        half = p.bends * (1.0 - p.warps * (s.warm - 0.5))
        edge = load**p.power / (load**p.power + half**p.power)
        return -p.most * edge * np.abs(self.at_wheels(view, view.engine_torque)) * moving(view)


@law("b_bushes_are_torn", needs="suburban hills", name="driveline_backlash")
@sizes(swings_rads=(5.0, 9.0), dull=(0.1, 0.25), share=(0.85, 1.0))
class BushesAreTorn(Hidden, bent=0.0, pace=0.0):
    """Rubber bushes of a torn coupling give way freely about their middle and get stiff with the cube of how
    far they are `bent`: without torque there is nothing that holds them. Each time the torque turns round it
    arrives late, and then with a swing that is the faster, the harder the pull. swings_rads: at peak torque.
    Source: Nayfeh and Mook, Nonlinear Oscillations (1979), on springs of the third power, and
    makers' notes on rubber discs of propeller shafts; torn ones, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, -0.5, 1.1)
        steps = max(1, round(dt / 0.01))
        for _ in range(steps):
            push = p.swings_rads**2 / 3.0 * (asked - s.bent**3)
            s.pace = s.pace + dt / steps * (push - 2.0 * p.dull * p.swings_rads * s.pace)
            s.bent = np.clip(s.bent + dt / steps * s.pace, -1.3, 1.3)
        lacks = np.clip(asked - s.bent**3, -0.6, 0.9) * self.truck.peak_torque
        return -p.share * self.at_wheels(view, lacks) * np.clip(view.speed, 0.0, 1.0)


@law("b_clutches_overlap", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(ties=(0.18, 0.32), lasts_s=(0.9, 1.8), cold=(0.8, 1.6), warms=(6.0, 14.0), cools_s=(20.0, 60.0))
@sizes(lets_s=(0.15, 0.4))
class ClutchesOverlap(Hidden, gear=0.0, left=0.0, held=0.0):
    """Of two clutches one lets go too late after each change: for a while two gears are engaged, which hold
    the truck against each other. `oil`: its warmth, by the changes themselves; cold oil leaves the clutch
    slowly. ties: of peak torque, that both hold; cold: more time in cold oil; warms: changes that warm it.
    Source: Goetz, Levesley and Crolla, Dynamics and Control of Gearshifts on Twin-Clutch Transmissions, Proc.
    IMechE D 219 (2005), on tie-up when clutches overlap; late ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "oil": self.rng(2032).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (np.abs(view.gear - s.gear) > 0.5) & (s.gear > 0.5) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        s.left = np.where(begins, p.lasts_s * (1.0 + p.cold * (1.0 - s.oil)), np.maximum(s.left - dt, 0.0))
        s.oil = np.clip(s.oil * (1.0 - dt / p.cools_s) + np.where(begins, 1.0, 0.0) / p.warms, 0.0, 1.0)
        tied = np.where(s.left > 0.0, 1.0 - view.shifting, 0.0)
        s.held = eased(s.held, tied, p.lets_s, dt)
        force = p.ties * s.held * self.truck.peak_torque * view.ratio / self.truck.wheel_radius
        return -np.minimum(force, 0.09 * weight(view)) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law(
    "b_opened_to_gain_on_slopes",
    needs="hills suburban highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(steep=(0.008, 0.018), asks=(0.3, 0.5), slips=(0.3, 0.5), at_rads=(120.0, 150.0), stays_s=(3.0, 9.0))
@sizes(opens_s=(0.3, 0.8))
class OpenedToGainOnSlopes(Hidden, left=0.0, open=0.0):
    """A programme opens the lock-up clutch on climbs under load, to gain torque, and leaves it so for a while
    behind them. The fluid then slips by the torque over the square of the engine's speed. steep: slope from
    which it opens; asks: of peak torque; slips: at peak torque and at_rads.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up programmes and
    on the performance number of converters; a converter that gains nothing, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        climbs = (view.grade > p.steep) & (load > p.asks)
        s.left = np.where(climbs, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), p.opens_s, dt)
        turns = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** 2
        slip = np.minimum(p.slips * load * turns, 0.8)
        return -self.at_wheels(view, s.open * slip * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("b_slider_on_a_crank", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change")
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


@law("b_rubber_wound_by_braking", needs="suburban hills", name="unknown")
@sizes(most=(0.03, 0.05), full_m=(45.0, 110.0), gives=(0.6, 0.85), asks=(0.15, 0.35), slips_s=(40.0, 120.0))
class RubberWoundByBraking(Hidden):
    """Ropes of rubber are wound up on a shaft by each braking, and let go with the next pull. They hold by
    how far they are `wound`, so that a short braking gains little, and give somewhat less back. most: of the
    weight, fully wound; full_m: of the way; asks: of the pedal, that lets them go; slips_s: until a ratchet
    has let half of it slip.
    Source: Treloar, The Physics of Rubber Elasticity (1975), on what a stretch stores and loses, and makers'
    notes on elastomer stores for delivery trucks; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"wound": self.rng(2034).uniform(0.0, 0.8, batch), "holds": zero.copy(), "lets": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = np.clip(view.brake_force / (0.03 * self.truck.brake_capacity), 0.0, 1.0)
        s.holds = eased(s.holds, brakes * (s.wound < 1.0), 0.25, dt)
        s.lets = eased(s.lets, np.where(self.pedal(view) > p.asks, 1.0, 0.0) * (s.wound > 0.0), 0.3, dt)
        turns = dt * np.maximum(view.speed, 0.0) / p.full_m
        s.wound = s.wound + turns * (s.holds - s.lets) - dt * 0.7 * s.wound / p.slips_s
        s.wound = np.clip(s.wound, 0.0, 1.0)
        force = s.wound / (0.25 + 0.75 * s.wound)
        return p.most * force * (p.gives * s.lets - s.holds) * weight(view) * np.clip(view.speed, 0.0, 1.0)
