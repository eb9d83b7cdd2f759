"""Brakes that fade because their linings have changed."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="brake_fade")

LINING_C = np.array([0.0, 100.0, 140.0, 190.0, 230.0, 280.0, 330.0, 400.0])
LINING = np.array([1.0, 1.04, 1.05, 0.95, 0.80, 0.63, 0.50, 0.42])


@law("lining_on_the_dynamometer", "fourth", "descent")
@sizes(severity=(0.9, 1.4), overworked=(0.50, 0.68), recovers_s=(40.0, 120.0))
class LiningOnTheDynamometer(Hidden):
    """A drum that has been hot rubs as if hot for a while after it has cooled. overworked: share of the work
    on 0.4 of the drums' heat capacity.
    Source: Friction over drum temperature of SAE J661 (first and second fade) and the recovery that comes
    late in FMVSS 121 S5.4 dynamometer tests: a table that first rises; two axle groups of unlike shares of
    the work; table and shares are chosen here."""

    def prepare(self) -> None:
        self.share = np.array([[self.p.overworked], [1.0 - self.p.overworked]])
        self.capacity = 0.42 * self.truck.brake_heat_capacity * np.array([[0.4], [0.6]])

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(313).uniform(40.0, 130.0, batch)
        drums = np.tile(self.truck.ambient_temperature + first, (2, 1))
        return {"drums": drums, "memory": drums.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        left = 1.0 - p.severity * (1.0 - np.interp(s.memory, LINING_C, LINING))
        lost = np.minimum((self.share * (1.0 - left)).sum(axis=0), 0.55)
        speed = np.maximum(view.speed, 0.0)
        power = self.share * left * view.brake_force * speed
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        cooling = film * np.array([[0.4], [0.6]]) * (s.drums - truck.ambient_temperature)
        s.drums += dt * (power - cooling) / self.capacity
        s.memory = np.maximum(s.drums, s.memory + dt * (s.drums - s.memory) / p.recovers_s)
        return lost * view.brake_force * moving(view)


@law("green_linings", "fourth", "descent")
@sizes(depth=(0.50, 0.80), onset_c=(90.0, 120.0), e_fold_k=(14.0, 28.0), resin_s=(90.0, 200.0))
class GreenLinings(Hidden):
    """The first heat fades, the second does not. resin_s: of gas at the onset.
    Source: Herring, Mechanism of Brake Fade in Organic Brake Linings, SAE 670146: gas of the decomposing
    resin lifts the lining; it comes by Arrhenius and is gone once the lining has been hot, why new linings
    are burnished (SAE J880); rates and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "drum": np.full(batch, self.truck.ambient_temperature + 30.0),
            "resin": self.rng(310).uniform(0.5, 1.0, batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        hot = np.exp(np.clip((s.drum - p.onset_c) / p.e_fold_k, -8.0, 2.5))
        gas = s.resin * hot / p.resin_s
        s.resin = np.maximum(s.resin - dt * gas, 0.0)
        lost = p.depth * (1.0 - np.exp(-60.0 * gas))
        speed = np.maximum(view.speed, 0.0)
        cooling = (truck.brake_cooling + truck.brake_cooling_speed * speed) * (
            s.drum - truck.ambient_temperature
        )
        power = (1.0 - lost) * view.brake_force * speed
        s.drum += dt * (power - cooling) / (0.6 * truck.brake_heat_capacity)
        return lost * view.brake_force * moving(view)


@law("s_powder_between", "eighth", "descent")
@sizes(loss=(0.35, 0.6), builds_jpkg=(120.0, 380.0), washes_m=(900.0, 2500.0))
class PowderBetween(Hidden, layer=0.0):
    """builds_jpkg: brake work for each kg of truck.
    Source: Godet, The Third-Body Approach, Wear 100 (1984): debris lies between the rubbing faces, grows with
    the work done and leaves with the way; brake powders and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lost = p.loss * s.layer**1.5
        speed = np.maximum(view.speed, 0.0)
        work = (1.0 - lost) * view.brake_force * speed / (p.builds_jpkg * view.mass)
        s.layer = np.clip(s.layer + dt * (work * (1.0 - s.layer) - speed * s.layer / p.washes_m), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("x_linings_polish_themselves", "thirteenth", "descent")
@sizes(loss=(0.45, 0.7), warms_jpkg=(250.0, 600.0), cools_s=(90.0, 260.0), turns=(0.3, 0.6))
@sizes(polishes_m=(150.0, 450.0), rips=(0.14, 0.25))
class LiningsPolishThemselves(Hidden, hot=0.0):
    """`hot`: 1 where resin softens; `glaze`: share of the face that is polished. Long gentle braking when hot
    melts a smooth skin over the lining, which stays when it is cold again; one firm braking rips it off.
    loss: of the brake force, all polished; turns: `hot` at which it begins; rips: of full braking.
    Source: Jacko, Physical and Chemical Changes of Organic Disc Pads in Service, Wear 46 (1978), and Limpert,
    Brake Design and Safety, on glazing; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "glaze": self.rng(1311).uniform(0.2, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        lost = p.loss * s.glaze
        work = (1.0 - lost) * view.brake_force * speed / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.warms_jpkg - s.hot / p.cools_s), 0.0, 2.0)
        hard = view.brake_force / self.truck.brake_capacity / p.rips
        rubs = np.clip(10.0 * hard, 0.0, 1.0) * speed / p.polishes_m
        skin = rubs * np.clip((s.hot - p.turns) / 0.3, 0.0, 1.0) * (1.0 - s.glaze)
        s.glaze = np.clip(s.glaze + dt * (skin - 0.4 * np.clip(hard - 1.0, 0.0, 3.0) * s.glaze), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("z_patches_carry_it", "seventeenth", "suburban descent", accepts="brake_gain")
@sizes(share=(0.22, 0.36), grows_jpkg=(50.0, 140.0), warm_jpkg=(60.0, 150.0), cools_s=(25.0, 80.0))
@sizes(breaks=(1.2, 2.2), rests_s=(60.0, 200.0))
class PatchesCarryIt(Hidden):
    """`patch`: of the hard patches on the pads that carry the friction. Gentle heat builds them from dust of
    wear, great heat breaks them faster than they grow, and standing cold they crumble slowly. So a brake that
    has worked hard holds little, until some braking at lower heat has built patches anew. share: of the brake
    force, without patches; breaks: how much faster they break in heat than they grow.
    Source: Ostermeyer, On the Dynamics of the Friction Coefficient, Wear 254 (2003): patches grow and break
    with heat and wear, and friction is their balance; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1711)
        return {"patch": rng.uniform(0.3, 0.9, batch), "hot": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.warm_jpkg - s.hot / p.cools_s), 0.0, 2.5)
        grows = work / p.grows_jpkg * (1.0 - s.patch)
        breaks = p.breaks * work / p.grows_jpkg * s.hot**2 * s.patch + s.patch / p.rests_s
        s.patch = np.clip(s.patch + dt * (grows - breaks), 0.0, 1.0)
        return p.share * (1.0 - s.patch) * view.brake_force * moving(view)


@law("h_grease_melts_out", "nineteenth", "suburban descent", accepts="brake_gain")
@sizes(most=(0.5, 0.7), warm_jpkg=(60.0, 150.0), cools_s=(30.0, 90.0), melts=(0.25, 0.5), runs_s=(5.0, 14.0))
@sizes(burns_s=(12.0, 40.0))
class GreaseMeltsOut(Hidden):
    """`hub`: its heat, which comes from the drum. Where it is hot enough grease melts past a torn seal onto
    the linings. `coat` of grease on them, which burns off as long as they are braked hard. most: of the brake
    force, lost with a full coat; melts: heat at which grease begins to run; burns_s: of braking at a fifth
    of the most and 15 m/s.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on oil and grease on linings, and SKF,
    makers' notes on drop points of hub greases; leaks and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1911)
        return {"hub": rng.uniform(0.0, 0.6, batch), "coat": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = view.brake_force * speed / view.mass
        s.hub = np.clip(s.hub + dt * (work / p.warm_jpkg - s.hub / p.cools_s), 0.0, 2.0)
        runs = np.clip((s.hub - p.melts) / 0.3, 0.0, 1.5) * (1.0 - s.coat) / p.runs_s
        hard = view.brake_force * speed / (0.2 * self.truck.brake_capacity * 15.0)
        s.coat = np.clip(s.coat + dt * (runs - np.minimum(hard, 3.0) * s.coat / p.burns_s), 0.0, 1.0)
        return p.most * s.coat * view.brake_force * moving(view)


@law("b_metal_melts_in_the_linings", "twentieth", "suburban descent", accepts="brake_gain")
@sizes(most=(0.5, 0.72), warm_jpkg=(45.0, 110.0), cools_s=(35.0, 90.0), melts=(0.45, 0.7), latent=(0.25, 0.5))
class MetalMeltsInTheLinings(Hidden):
    """`heat` that is stored in linings with a soft metal in them. Once they are at its melting point they get
    no hotter until all of it is molten, and no cooler until all of it is solid again; what is molten
    lubricates. most: of the brake force, lost when all is molten; melts: heat where it begins; latent: heat
    that melting takes.
    Source: Crank, Free and Moving Boundary Problems (1984), on stored heat at a melting point, and Breuer and
    Bill, Brake Technology Handbook (SAE, 2008), on metals in linings; soft linings, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(2011).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        molten = np.clip((s.heat - p.melts) / p.latent, 0.0, 1.0)
        hot = np.minimum(s.heat, p.melts) + np.maximum(s.heat - p.melts - p.latent, 0.0)
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.heat = np.clip(s.heat + dt * (work / p.warm_jpkg - hot / p.cools_s), 0.0, 1.6)
        return p.most * molten * view.brake_force * moving(view)


@law("u_tar_comes_to_the_face", "twenty-first", "suburban descent", accepts="brake_gain")
@sizes(most=(0.5, 0.72), warm_jpkg=(45.0, 110.0), cools_s=(30.0, 80.0), at=(0.3, 0.55), makes_s=(4.0, 12.0))
@sizes(rubs_jpkg=(70.0, 180.0))
class TarComesToTheFace(Hidden):
    """`heat` of linings whose resin was cooked too little. Hot, they sweat `tar`, which lies on their face
    and stays there when they are cold again: only the work of further, cooler brakings rubs it off. most: of
    the brake force, lost to a full coat; at: heat where it begins; rubs_jpkg: work that takes two thirds off.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on resins that decompose and how a lining
    recovers from fade; poor linings, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2111)
        return {"heat": rng.uniform(0.1, 0.8, batch), "tar": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        airs = 0.4 + 0.6 * np.clip(view.speed / 20.0, 0.0, 1.4)
        s.heat = np.clip(s.heat + dt * (work / p.warm_jpkg - airs * s.heat / p.cools_s), 0.0, 1.6)
        sweats = np.maximum(s.heat - p.at, 0.0) * (1.0 - s.tar) / (0.4 * p.makes_s)
        cool = np.clip((p.at - s.heat) / (0.5 * p.at), 0.0, 1.0)
        s.tar = np.clip(s.tar + dt * (sweats - cool * work * s.tar / p.rubs_jpkg), 0.0, 1.0)
        return p.most * s.tar * view.brake_force * moving(view)
