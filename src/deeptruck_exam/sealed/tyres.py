"""Tall treads that creep, rubber that sticks to the road or passes its glass transition, and an axle that
shifts."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("b_tall_treads_creep", needs="suburban hills", name="wheel_slip", accepts="driveline_loss")
@sizes(stiff=(0.5, 0.85), driven=(0.35, 0.5), heats_s=(6.0, 18.0), softens=(0.4, 0.8), most=(0.4, 0.55))
class TallTreadsCreep(Hidden):
    """Tall soft blocks bend as they pull, and the tyre creeps without gliding anywhere: by the pull over the
    load, with no threshold, so that what is lost goes with the square of the pull. `heat` of the blocks, from
    that work, makes them softer. stiff: pull over load, for a creep of 1; softens: of it, at a heat of 1.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on the brush model and its slip stiffness; very soft
    blocks, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(2071).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        hard = pull / (p.driven * weight(view))
        creep = np.minimum(hard / (p.stiff * (1.0 - p.softens * np.minimum(s.heat, 1.0) * 0.7)), p.most)
        works = 4.0 * creep * np.minimum(hard, 0.6) * np.clip(view.speed / 6.0, 0.0, 2.0)
        s.heat = np.clip(s.heat + dt * (works - 0.25 * s.heat) / p.heats_s, 0.0, 1.2)
        return -creep * pull * moving(view)


@law(
    "b_rubber_sticks_to_the_road",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)
@sizes(at_20=(0.011, 0.017), power=(0.5, 0.75), dust_m=(60.0, 160.0), cleans_m=(150.0, 500.0))
@sizes(mean_m=(400.0, 1200.0), share=(0.3, 0.5))
class RubberSticksToTheRoad(OnRoad):
    """Soft rubber sticks, and what it costs to peel it off grows with a root of the speed of peeling.
    `clean`: of the tread; dust of some stretches covers it, and clean road takes the dust off again. at_20:
    of the weight, at 20 m/s and quite clean; power: of the speed.
    Source: Barquins, Adherence and Rolling Kinetics of a Rigid Cylinder in Contact with a Natural Rubber
    Surface, J. Adhesion 26 (1988), on the power; very soft treads, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(2072), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"clean": self.rng(2073).uniform(0.4, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        dusty = self.between(self.road, view)
        gains = (1.0 - dusty) * (1.0 - s.clean) / p.cleans_m - dusty * s.clean / p.dust_m
        s.clean = np.clip(s.clean + dt * speed * gains, 0.0, 1.0)
        peels = np.minimum(speed / 20.0, 1.5) ** p.power * (0.25 + 0.75 * s.clean)
        return -p.at_20 * peels * weight(view) * moving(view)


@law("b_passes_its_glass_transition", name="rolling_resistance_warmup")
@sizes(most=(0.01, 0.016), at=(0.35, 0.55), wide=(0.16, 0.28), warms_s=(45.0, 120.0), cools_s=(90.0, 240.0))
class PassesItsGlassTransition(Hidden):
    """Rubber that came out of deep frost is hard as glass and loses little; as it warms it passes through its
    glass transition, where it loses most, and only beyond that it runs easily. So resistance first rises on
    the way and then falls. `warm`: 1 where work and wind are even at 20 m/s. most: of the weight, in the
    transition; at, wide: its middle and its width.
    Source: Ferry, Viscoelastic Properties of Polymers (1980), on losses about the glass transition; a poor
    rubber for winter, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2074).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / 20.0, 0.0, 1.4)
        loses = np.exp(-(((s.warm - p.at) / p.wide) ** 2))
        works = fast * (0.6 + 0.8 * loses) / p.warms_s
        s.warm = np.clip(s.warm + dt * (works - (0.3 + 0.7 * fast) * s.warm / p.cools_s), 0.0, 1.6)
        return -p.most * (0.12 + 0.88 * loses) * weight(view) * moving(view)


@law("b_axle_shifts_as_it_pulls", needs="suburban hills highway", name="unknown")
@sizes(most=(0.018, 0.03), shifts=(0.035, 0.06), sticks=(0.3, 0.6), power=(1.6, 2.2), moves_s=(0.15, 0.5))
class AxleShiftsAsItPulls(Hidden, askew=0.0):
    """The centre bolt of one spring is broken: when the axle pulls or brakes its loose end shifts fore or
    aft, and the wheels run askew. It sticks where it is until the force has changed enough, so that it stays
    askew after a pull, and straightens only with a small braking. most: of the weight, quite askew; shifts:
    of the weight, for that; sticks: of that force, before it moves.
    Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical Properties
    of Truck Leaf Springs, SAE 800905, on friction of springs, and Pacejka, Tire and Vehicle Dynamics (2012),
    on drag by slip angles; a broken bolt, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.clip((view.traction_force - view.brake_force) / (p.shifts * weight(view)), -1.5, 1.5)
        held = np.clip(s.askew, force - p.sticks, force + p.sticks)
        s.askew = eased(s.askew, held, p.moves_s, dt)
        ploughs = np.minimum(np.abs(s.askew), 1.1) ** p.power
        return -p.most * ploughs * weight(view) * np.clip(view.speed / 3.0, 0.0, 1.0)
