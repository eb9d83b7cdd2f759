"""Brakes that lose force when they are hot."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="brake_fade")
SKIN_S = np.array([3.0, 15.0, 75.0])[:, None]  # layers below the rubbing face
SKIN = np.array([0.5, 0.3, 0.2])[:, None]


@law("brake_fade", "first", "descent")
@sizes(surface_share=(0.10, 0.20), onset_c=(110.0, 170.0), width_k=(60.0, 130.0), loss=(0.30, 0.55))
class BrakeFade(Hidden):
    """surface_share: of the drums' heat capacity; loss: share of the torque lost when fully hot.
    Source: Two thermal masses (rubbing surface, drum body) as in Limpert, Brake Design and Safety, and Day,
    Braking of Road Vehicles (2014); the S-shaped friction curve and its numbers are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        ambient = np.full(batch, self.truck.ambient_temperature)
        return {"surface": ambient + 20.0, "body": ambient.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        hot = (s.surface - p.onset_c) / p.width_k
        lost = p.loss * np.where(hot > 0.0, 1.0 - np.exp(-(np.maximum(hot, 0.0) ** 2)), 0.0)
        capacity = 0.6 * truck.brake_heat_capacity
        inward = 0.02 * capacity * (s.surface - s.body)  # W; 50 s to level out
        outward = (truck.brake_cooling + truck.brake_cooling_speed * view.speed) * (
            s.body - truck.ambient_temperature
        )
        power = (1.0 - lost) * view.brake_force * view.speed
        s.surface += dt * (power - inward) / (p.surface_share * capacity)
        s.body += dt * (inward - outward) / ((1.0 - p.surface_share) * capacity)
        return lost * view.brake_force * moving(view)


@law("soaking_heat", "third", "descent")
@sizes(effusivity=(3000.0, 6500.0), onset_k=(25.0, 60.0), per_k=(0.0028, 0.0055))
class SoakingHeat(Hidden):
    """Warms with the root of time and cools as slowly; no mass has one temperature. effusivity: W s^0.5/K, of
    all rubbing surfaces of a 20 t truck.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959): the surface of a half-space heats by the
    half integral of its heat flow; friction falls in a straight line above an onset (Day, Braking of Road
    Vehicles, 2014, on fade); the share of brakes that carry the load is chosen here."""

    def prepare(self) -> None:
        self.rate = 4.0 ** -np.arange(5.0)[:, None]  # 1/s
        # 1/sqrt(pi t) as a sum of exponentials, four to one apart
        self.part = np.log(4.0) / np.pi * np.sqrt(self.rate)
        self.area = self.p.effusivity * self.truck.mass / 2.0e4

    def start(self, batch: int) -> dict[str, Array]:
        return {"soaked": np.zeros((5, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        above = (self.part * s.soaked).sum(axis=0) - p.onset_k
        lost = np.clip(p.per_k * above, 0.0, 0.65)
        flow = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / self.area
        s.soaked += dt * (flow - self.rate * s.soaked)
        return lost * view.brake_force * moving(view)


@law("hot_bands", "fifth", "descent")
@sizes(depth=(0.32, 0.58), critical_mps=(6.0, 10.0), warm_k=(28.0, 58.0), grows_s=(5.0, 14.0))
@sizes(heals_s=(60.0, 160.0))
class HotBands(Hidden, above=15.0, bands=0.0):
    """Braking long and gently at speed costs more than a hard stop.
    Source: Barber, Thermoelastic Instabilities in the Sliding of Conforming Solids, Proc. R. Soc. A 312
    (1969), and Anderson and Knapp, Hot Spotting in Automotive Friction Systems, Wear 135 (1990): above a
    critical speed the contact draws together in bands, which glaze; they stay until the disc has cooled and
    worn; rates and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        speed = np.maximum(view.speed, 0.0)
        lost = p.depth * s.bands**2 * (3.0 - 2.0 * s.bands)
        power = (1.0 - lost) * view.brake_force * speed
        # the discs of a made-up truck are lighter than its drums
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        s.above += dt * (power - film * s.above) / (0.35 * truck.brake_heat_capacity)
        unstable = np.clip(speed / p.critical_mps - 1.0, 0.0, 1.0) * (view.brake_force > 0.01 * weight(view))
        hot = np.clip(s.above / p.warm_k - 0.6, 0.0, 2.0)
        rate = unstable * hot * (1.02 - s.bands) / p.grows_s
        heals = s.bands / p.heals_s / (0.5 + hot)
        s.bands = np.clip(s.bands + dt * (rate - heals), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("skin_of_the_drum", "seventh", "descent")
@sizes(most=(0.35, 0.6), half_wpkg=(3.0, 5.0), steep=(2.5, 4.5))
class SkinOfTheDrum(Hidden):
    """A single hard stop loses a little at its end; a long descent loses minutes after minutes. most: of the
    brake force; half_wpkg: steady power over mass at which half of it is lost.
    Source: UN Regulation No. 13, annex 4, fade tests of type I, and Carslaw and Jaeger, Conduction of Heat in
    Solids (1959): the rubbing face follows the power with the root of time, here as layers of three depths,
    and friction falls with the face's temperature as a power law."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"face": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hot = np.maximum((SKIN * s.face).sum(axis=0), 0.0) / p.half_wpkg
        lost = p.most * hot**p.steep / (1.0 + hot**p.steep)
        power = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.face = s.face + dt * (power - s.face) / SKIN_S
        return lost * view.brake_force * moving(view)


@law("n_axles_share_unequally", "ninth", "descent")
@sizes(uneven=(0.3, 0.6), loss=(0.3, 0.5), heats_jpkg=(250.0, 600.0), cools_s=(150.0, 450.0))
class AxlesShareUnequally(Hidden):
    """Three groups of axles, of which one takes most, gets hot first and leaves the work to the others.
    heats_jpkg: work for each kg of truck that would heat equal shares to where half of `loss` is lost.
    Source: Fancher, Winkler and Campbell, The Influence of Braking Strategy on Brake Temperatures in Mountain
    Descents (UMTRI, 1992), on brakes that share unequally; logistic loss and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = (1.0 + p.uneven * np.array([[1.0], [0.0], [-1.0]])) / 3.0
        lost = p.loss / (1.0 + np.exp(-(s.hot - 1.0) / 0.15))
        lost = lost - p.loss / (1.0 + np.exp(1.0 / 0.15))
        work = view.brake_force * np.maximum(view.speed, 0.0) / (p.heats_jpkg * view.mass)
        s.hot = s.hot + dt * (3.0 * share * (1.0 - lost) * work - s.hot / p.cools_s)
        return np.maximum((share * lost).sum(axis=0), 0.0) * view.brake_force * moving(view)


@law("t_self_help_is_lost", "tenth", "descent")
@sizes(per_k=(0.0013, 0.0022), helps=(0.7, 1.8), heats_jpkgk=(1.4, 2.8), cools_s=(200.0, 600.0))
class SelfHelpIsLost(Hidden):
    """`hot`: K above cold. Friction falls in proportion to heat, the brake far more. helps: force of the shoe
    that draws itself on, over the other, cold; heats_jpkgk: for each kg of truck.
    Source: Limpert, Brake Design and Safety, on brake factors of leading shoes, which amplify every change of
    the lining's friction; heat and coefficients of linings are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(953).uniform(0.0, 70.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        friction = np.clip(1.0 - p.per_k * np.maximum(s.hot - 50.0, 0.0), 0.4, 1.0)
        left = friction / (1.0 + p.helps * (1.0 - friction))
        work = left * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.hot = s.hot + dt * (work / p.heats_jpkgk - s.hot / p.cools_s)
        return (1.0 - left) * view.brake_force * moving(view)


@law("e_drums_open_like_bells", "eleventh", "descent")
@sizes(heats_jpkgk=(3.5, 7.0), bears_k=(60.0, 120.0), loss=(0.4, 0.65), wears_jpkg=(700.0, 2500.0))
@sizes(cools_s=(250.0, 500.0))
class DrumsOpenLikeBells(Hidden, hot=0.0):
    """`hot`: K above cold; `worn`: K at which the linings fit the drum. A drum that is hotter or colder than
    that touches them at one edge alone, until they have worn to its shape. heats_jpkgk: for each kg of truck;
    bears_k: misfit at which half of `loss` is lost.
    Source: Day, Harding and Newcomb, Combined Thermal and Mechanical Analysis of Drum Brakes, Proc. IMechE D
    198 (1984), on bell-mouthing, and Day, Braking of Road Vehicles (2014), on linings that wear to shape;
    wheels that turn cool better; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "worn": self.rng(1011).uniform(0.0, 60.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        misfit = ((s.hot - s.worn) / p.bears_k) ** 2
        lost = p.loss * misfit / (1.0 + misfit)
        speed = np.maximum(view.speed, 0.0)
        work = (1.0 - lost) * view.brake_force * speed / view.mass
        cools = (0.4 + np.sqrt(np.minimum(speed, 25.0) / 15.0)) / (1.4 * p.cools_s)
        s.hot = s.hot + dt * (work / p.heats_jpkgk - s.hot * cools)
        s.worn = s.worn + dt * work * (s.hot - s.worn) / p.wears_jpkg
        return lost * view.brake_force * moving(view)


@law("y_spots_flash", "eighteenth", "suburban descent", accepts="brake_gain")
@sizes(most=(0.4, 0.6), flash=(1.3, 2.2), skin_s=(3.0, 8.0), skin=(0.5, 1.0), knee=(1.0, 1.4))
class SpotsFlash(Hidden, hot=0.0):
    """Friction falls with the heat of the spots that touch. That heat flashes up at once with force and the
    root of speed, and adds to the heat of the skin. `hot`: the skin, which follows the work within
    seconds. most: of the brake force, lost; flash: of a brake at its half and 15 m/s; knee: heat of half the
    loss.
    Source: Archard, The Temperature of Rubbing Surfaces, Wear 2 (1959), on flashes by load and speed; soft
    linings and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = np.clip(view.brake_force / (0.2 * self.truck.brake_capacity), 0.0, 3.0)
        speed = np.clip(view.speed / 15.0, 0.0, 2.0)
        flash = p.flash * pressed**0.7 * np.sqrt(speed)
        s.hot = eased(s.hot, p.skin * pressed * speed, p.skin_s, dt)
        heat = (flash + s.hot) / p.knee
        return p.most * heat**3 / (1.0 + heat**3) * view.brake_force * moving(view)
