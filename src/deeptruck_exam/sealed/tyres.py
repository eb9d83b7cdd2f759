"""Speed before heat, puddles that cool, grip that a bend takes, and an axle that steers as it bounces."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_speed_before_heat", needs="highway hills", name="rolling_resistance_speed", accepts="drag_area")
@sizes(at_once=(0.007, 0.013), power=(1.2, 1.9), heals=(0.5, 0.8), warms_s=(25.0, 80.0))
class SpeedBeforeHeat(Hidden, heat=-1.0):
    """Faster rolling costs more at once; then the tyre warms to the new speed and part of that goes. `heat`:
    the speed that its warmth belongs to. at_once: of the weight, from standing to 20 m/s; heals: of that, in
    the end.
    Source: Hyttinen, Ussner, Osterlof, Jerrelind and Drugge, Truck Tyre Transient Rolling Resistance and
    Temperature at Varying Vehicle Velocities - Measurements and Simulations, Polymer Testing 122 (2023);
    quicker rubber, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.heat = np.where(s.heat < 0.0, 0.5 * speed, s.heat)
        s.heat = s.heat + dt * (speed - s.heat) / p.warms_s
        fresh, warm = (np.clip(v / 20.0, 0.0, 1.5) ** p.power for v in (speed, s.heat))
        costs = np.maximum(fresh - p.heals * warm, 0.0)
        return -p.at_once * 1.6 * costs * weight(view) * moving(view)


@law("w_puddles_cool_the_tyres", name="rolling_resistance_warmup")
@sizes(cold=(0.006, 0.012), warms_m=(900.0, 2600.0), cools_m=(80.0, 300.0), wet_m=(250.0, 700.0))
class PuddlesCoolTheTyres(OnRoad):
    """`warm`: of the tyres' full warmth. They warm over dry road and lose it quickly where the road is wet,
    at places that stay. cold: of the weight, more than warm.
    Source: Ejsmont, Sjogren, Swieczko-Zurek and Ronowski, Influence of Road Wetness on Tire-Pavement Rolling
    Resistance, J. Civil Engineering and Architecture 9 (2015): water's cooling is most of what it costs; wet
    lengths are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1171), self.rows(), self.p.wet_m, 0.3)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1172).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wet = self.between(self.road, view)
        way = dt * np.maximum(view.speed, 0.0)
        s.warm = s.warm + way * ((1.0 - wet) * (1.0 - s.warm) / p.warms_m - wet * s.warm / p.cools_m)
        s.warm = np.clip(s.warm, 0.0, 1.0)
        return -p.cold * (1.0 - s.warm) ** 1.3 * weight(view) * moving(view)


@law("w_grip_goes_to_the_bend", needs="suburban hills", name="wheel_slip", accepts="torque_limit")
@sizes(grip=(0.17, 0.25), driven=(0.32, 0.42), care=(0.75, 0.95), finds_s=(0.15, 0.4), edge=(0.7, 0.85))
class GripGoesToTheBend(Bends, lost=0.0):
    """On a greasy road driven wheels have what a bend leaves of their grip, and slip beyond. grip: of the
    road; driven: of the weight; care: most of the grip that drivers give to bends; edge: of what is left,
    from where they begin to slip.
    Source: Wong, Theory of Ground Vehicles (2008), and Milliken and Milliken, Race Car Vehicle Dynamics
    (1995), on the friction circle; harvest dirt in the rain, bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1173), 0.02)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        aside = np.minimum(view.speed**2 * np.abs(self.read(self.bend, view)) / (GRAVITY * p.grip), p.care)
        most = p.grip * p.driven * np.sqrt(1.0 - aside**2) * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        beyond = np.maximum(pull / np.maximum(most, 1.0) - p.edge, 0.0)
        carries = np.where(beyond > 0.0, p.edge + (1.0 - p.edge) * np.tanh(beyond / (1.0 - p.edge)), 0.0)
        slips = np.where(beyond > 0.0, pull - most * carries, 0.0)
        s.lost = s.lost + dt * (slips - s.lost) / p.finds_s
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("w_steers_as_it_bounces", needs="suburban hills descent", name="unknown")
@sizes(toe=(0.001, 0.008), dives=(0.045, 0.07), rolls=(0.0, 0.2), stiff=(6.0, 10.0), hz=(0.9, 1.4))
@sizes(share=(0.6, 0.95))
class SteersAsItBounces(Hidden, travel=0.0, pace=0.0):
    """`travel` of the front springs, 1 at 1 m/s2 of braking. Worn links turn the wheels in and out with it,
    and wheels that do not roll straight drag with the square of their angle. toe: rad at rest, either way;
    dives: rad for a travel of 1; stiff: 1/rad of their load; share: of the weight on such wheels.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on steering geometry error and toe change by
    ride; trucks with several steered axles, sizes are chosen here."""

    def prepare(self) -> None:
        self.side = self.rng(1174).choice([-1.0, 1.0])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        omega = 2.0 * np.pi * p.hz
        s.pace = s.pace + dt * (omega**2 * (-along - s.travel) - 0.45 * omega * s.pace)
        s.travel = np.clip(s.travel + dt * s.pace, -4.0, 4.0)
        angle = self.side * p.toe + p.dives * s.travel
        drag = p.stiff * angle**2 / (1.0 + p.rolls + (angle / 0.06) ** 2)
        return -p.share * np.minimum(drag, 0.07) * weight(view) * moving(view)
