"""Studs that strike, cold hollows, treads that clog with snow, and chains that were left on."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_studs_strike", needs="highway hills", name="rolling_resistance_speed", accepts="drag_area")
@sizes(
    strikes=(0.006, 0.012), power=(1.5, 2.2), bare=(0.55, 0.8), stretch_m=(400.0, 1500.0), on_ice=(0.0, 0.2)
)
@sizes(sinks_m=(600.0, 2000.0))
class StudsStrike(OnRoad, out=1.0):
    """`out`: how far studs stand out of the tread. Each hits a bare road with the energy of its speed, and
    ice takes it without a blow. Bare road pushes studs in the more, the faster; on ice they come out again.
    strikes: of the weight, at 20 m/s on bare road; bare: share of the road; sinks_m: of way.
    Source: Unhola, Studded Tires the Finnish Way, VTT Communities and Infrastructure (1997), and Gultlinger,
    Gauterin, Brandau and Schlittenhard, Investigation of Traffic and Vehicle Parameters Affecting Wear of
    Pavement by Studded Tires, Tire Science and Technology 42 (2014): stud force with speed; sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1371), self.rows(), self.p.stretch_m, self.p.bare)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bare = self.between(self.road, view)
        speed = np.maximum(view.speed, 0.0)
        stands = 1.0 - 0.45 * bare * np.clip(speed / 20.0, 0.0, 1.3)
        s.out = s.out + dt * speed * (stands - s.out) / p.sinks_m
        blows = (p.on_ice + (1.0 - p.on_ice) * bare) * s.out
        return -p.strikes * 1.5 * blows * (speed / 20.0) ** p.power * weight(view) * moving(view)


@law("x_cold_lies_in_hollows", needs="hills suburban descent highway", name="rolling_resistance_warmup")
@sizes(cold=(0.007, 0.012), deep_m=(3.0, 8.0), takes_s=(8.0, 30.0), land_m=(900.0, 2500.0), begins=(0.1, 0.5))
class ColdLiesInHollows(Hidden, height=0.0, land=0.0):
    """`rubber`: warmth of the tyres, 1 on a mild height. In a clear night cold air fills the hollows of the
    land, and tyres that roll through it follow with delay; they start colder than all of it. cold: of the
    weight, cold over mild; deep_m: of a hollow that is full of it; land_m: over which the land is felt.
    Source: Clements, Whiteman and Horel, Cold-Air-Pool Structure and Evolution in a Mountain Basin: Peter
    Sinks, Utah, J. Applied Meteorology 42 (2003), and ISO 28580 on rolling resistance over temperature;
    quicker and more rubber, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1372).uniform(0.0, 1.0, batch)
        return {**super().start(batch), "rubber": -self.p.begins * first}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.height = s.height + dt * speed * view.grade
        s.land = s.land + dt * speed * (s.height - s.land) / p.land_m
        air = np.clip(0.5 + (s.height - s.land) / p.deep_m, 0.0, 1.0)
        s.rubber = s.rubber + dt * (air - s.rubber) * (0.3 + speed / 15.0) / p.takes_s
        return -p.cold * np.exp(-1.8 * s.rubber) * weight(view) * moving(view)


@law("x_tread_clogs_with_snow", needs="suburban hills", name="wheel_slip")
@sizes(
    clean=(0.26, 0.34), clogged=(0.10, 0.14), driven=(0.32, 0.42), fills_m=(40.0, 150.0), throws_s=(3.0, 9.0)
)
@sizes(from_mps=(8.0, 12.0), finds_s=(0.15, 0.4))
class TreadClogsWithSnow(Hidden, lost=0.0):
    """`full`: of the grooves with snow. Slow rolling packs them, and a full tread holds on snow no better
    than a bald one; turning fast throws it out, and so does slipping. clean, clogged: grip of the road;
    driven: of the weight; from_mps: from where it is thrown out.
    Source: Nakajima, Analytical Model of Longitudinal Tire Traction in Snow, J. Terramechanics 40 (2003), and
    Shoop, Young, Alger and Davis, Effect of Test Method on Winter Traction Measurements, J. Terramechanics 31
    (1994): shear of snow in the grooves; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1373).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pull = np.maximum(view.traction_force, 0.0)
        slips = np.clip(s.lost / np.maximum(pull, 1.0), 0.0, 1.0)
        throws = s.full * (np.clip(speed / p.from_mps - 1.0, 0.0, 1.5) + 0.5 * slips) / p.throws_s
        s.full = np.clip(s.full + dt * (speed * (1.0 - s.full) / p.fills_m - throws), 0.0, 1.0)
        most = (p.clean + (p.clogged - p.clean) * s.full) * p.driven * weight(view)
        over = np.maximum(pull / np.maximum(most, 1.0) - 0.75, 0.0)
        holds = most * (np.minimum(pull / np.maximum(most, 1.0), 0.75) + 0.25 * np.tanh(over / 0.25))
        s.lost = s.lost + dt * (pull - holds - s.lost) / p.finds_s
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("x_chains_are_left_on", needs="suburban hills descent highway", name="unknown")
@sizes(rolls=(0.008, 0.015), beats=(0.008, 0.016), lifts_mps=(11.0, 16.0), slack=(0.2, 0.5))
@sizes(stretches_m=(900.0, 3000.0), snow=(0.25, 0.5), stretch_m=(300.0, 1200.0))
class ChainsAreLeftOn(OnRoad, still=0.0):
    """`loose`: of the chains on driven wheels, which stretch over the way until somebody tightens them at a
    stand. Links that are rolled over cost their bending; loose ones lift off and beat the arches beyond a
    speed. On snow links sink in and cost little. rolls, beats: of the weight; slack: of `loose`, left by who
    tightens; snow: share of the road.
    Source: ONORM V 5119 on snow chains of heavy vehicles (speed, fit and tightening again), and Wong, Theory
    of Ground Vehicles (2008), on work of obstacles under tyres; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1374), self.rows(), self.p.stretch_m, self.p.snow)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "loose": self.rng(1375).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.still = np.where(speed < 0.2, s.still + dt, 0.0)
        s.loose = np.where(s.still > 5.0, np.minimum(s.loose, p.slack), s.loose)
        s.loose = s.loose + dt * speed * (1.0 - s.loose) / p.stretches_m
        snow = 1.0 - 0.8 * self.between(self.road, view)
        lifts = np.clip((speed - p.lifts_mps * (1.3 - 0.6 * s.loose)) / 3.0, 0.0, 1.0)
        costs = p.rolls * (1.0 - 0.5 * lifts) * snow + p.beats * lifts * s.loose
        return -costs * weight(view) * np.clip(speed / 1.5, 0.0, 1.0)
