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


@law("stroke_runs_out", "second", "descent")
@sizes(cold_stroke=(0.50, 0.68), per_100k=(0.20, 0.38), per_force=(0.10, 0.25), steepness=(1.2, 2.2))
@sizes(share=(0.35, 0.65))
class StrokeRunsOut(Hidden):
    """Hot alone or hard alone costs little, hot and hard costs most. cold_stroke: of the stroke at which the
    force begins to drop; per_force: elastic stretch at full application; share: of the brake force that is
    out of adjustment.
    Source: Heusser, Heavy Truck Deceleration Rates as a Function of Brake Adjustment, SAE 910126: hot drums
    grow, the push rod strokes further, and past the readjustment limit the chamber's force drops steeply;
    cooling by convection and radiation, numbers chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": np.full(batch, self.truck.ambient_temperature + 30.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        above = s.drum - truck.ambient_temperature
        applied = view.brake_force / (0.4 * truck.brake_capacity)
        stroke = p.cold_stroke + p.per_100k * above / 100.0 + p.per_force * np.clip(applied, 0.0, 1.5)
        lost = p.share * (1.0 - np.exp(-p.steepness * np.maximum(stroke - 1.0, 0.0)))
        hot, cold = (s.drum + 273.0) / 100.0, (truck.ambient_temperature + 273.0) / 100.0
        convection = (truck.brake_cooling + truck.brake_cooling_speed * np.maximum(view.speed, 0.0)) * above
        radiation = 10.0 * (hot**4 - cold**4)  # W; 2 m2 of drums
        power = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0)
        s.drum += dt * (power - convection - radiation) / (0.7 * truck.brake_heat_capacity)
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


@law("fluid_boils", "sixth", "descent")
@sizes(stroke=(0.03, 0.075), boils_k=(26.0, 50.0), soaks_s=(20.0, 50.0), span_k=(10.0, 25.0))
class FluidBoils(Hidden, disc=20.0, fluid=12.0, vapour=0.0):
    """Two thirds of a gentle brake are lost, a hard one by the same force. stroke: of full braking, lost with
    all calipers full of vapour.
    Source: Limpert, Brake Design and Safety, on brake fluid vaporization, and the wet boiling points of FMVSS
    116: heat soaks from the discs into the calipers, also while nobody brakes, and vapour there takes the
    first part of every stroke; hydraulic brakes of a distribution truck, sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        speed = np.maximum(view.speed, 0.0)
        lost = np.minimum(p.stroke * s.vapour * truck.brake_capacity, 0.65 * view.brake_force)
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        # the discs of a distribution truck weigh a third of drums
        heat = (view.brake_force - lost) * speed - film * s.disc
        s.disc += dt * heat / (0.35 * truck.brake_heat_capacity)
        s.fluid += dt * (s.disc - s.fluid) / p.soaks_s
        boils = np.clip((s.fluid - p.boils_k) / p.span_k, 0.0, 1.0)
        s.vapour += dt * (boils - s.vapour) / np.where(boils > s.vapour, 3.0, 12.0)
        return lost * moving(view)


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


@law("w_oil_bath_overheats", "twelfth", "descent")
@sizes(oil_jpkgk=(5.0, 10.0), passes_s=(15.0, 40.0), bears_k=(50.0, 100.0), loss=(0.4, 0.65))
@sizes(cools_s=(60.0, 160.0))
class OilBathOverheats(Hidden, disc=0.0, oil=0.0):
    """`disc`, `oil`: K above cold. Discs in a bath give their heat to oil that the engine's pump sends
    through a cooler: thin oil makes them rub less, and who brakes in a high gear cools them least. oil_jpkgk:
    for each kg of truck; bears_k: of the discs, where half of `loss` is lost; cools_s: at 150 rad/s.
    Source: Yang, Twaddell, Chen and Lam, Theoretical and Experimental Studies on the Thermal Degradation of
    Wet Friction Materials, SAE 970978, and makers' manuals of articulated haulers on forced cooling of wet
    discs; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hot = np.maximum(s.disc / p.bears_k, 0.0) ** 2
        lost = p.loss * hot / (1.0 + hot)
        work = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        passes = (s.disc - s.oil) / p.passes_s
        pumps = np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        s.disc = s.disc + dt * (work / (0.4 * p.oil_jpkgk) - passes)
        s.oil = np.maximum(s.oil + dt * (0.4 * passes - pumps * s.oil / p.cools_s), 0.0)
        return lost * view.brake_force * moving(view)


@law("k_iron_warms_in_its_field", "fourteenth", "descent")
@sizes(share=(0.65, 0.9), peak_mps=(9.0, 14.0), resists=(0.9, 1.6), heats_jpkg=(120.0, 320.0))
@sizes(cools_s=(80.0, 220.0), field=(0.2, 0.35))
class IronWarmsInItsField(Hidden, hot=0.0):
    """An electric retarder does most of what the pedal asks. Its iron conducts the worse, the hotter: then
    it brakes best at a higher speed and less below it, and hot coils make a weaker field. Air that it blows
    itself cools it. share: of the brake force; peak_mps: where it brakes best, cold; resists: of the
    resistance, more when hot; field: of the force, lost by hot coils.
    Source: Schieber, Braking Torque on Rotating Sheet in Stationary Magnetic Field, Proc. IEE 121 (1974), and
    Limpert, Brake Design and Safety, on electric retarders when hot; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        cold = speed / p.peak_mps
        warm = cold / (1.0 + p.resists * s.hot)
        ratio = (1.0 + cold**2) / (1.0 + warm**2) / (1.0 + p.resists * s.hot)
        kept = np.minimum(ratio, 1.0) * (1.0 - p.field * np.minimum(s.hot, 1.0))
        work = p.share * kept * view.brake_force * speed / view.mass
        s.hot = np.clip(
            s.hot + dt * (work / p.heats_jpkg - s.hot * (0.4 + speed / 20.0) / p.cools_s), 0.0, 1.5
        )
        return p.share * (1.0 - kept) * view.brake_force * moving(view)


@law("q_leaks_while_it_is_held", "fifteenth", "suburban descent", accepts="brake_gain")
@sizes(share=(0.5, 0.8), leaks_s=(2.0, 5.5), found=(0.3, 0.55), fills_s=(0.3, 0.8), step=(0.02, 0.05))
class LeaksWhileItIsHeld(Hidden, left=1.0, top=0.0, fills=0.0):
    """`left`: of the pressure behind torn diaphragms. While the pedal is held still the valve is shut, and
    they leak; it opens again when the pedal goes deeper, or when what is missing has been found. share: of
    the brake force; found: `left` that is noticed; step: of full braking.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on modulators that hold
    pressure with both valves shut, and UN Regulation No. 13 on leaks; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        off = asked < 0.004
        deeper = asked > s.top + p.step
        s.top = np.where(off, 0.0, np.where(deeper, asked, np.minimum(s.top, asked + p.step)))
        s.fills = np.where(deeper | (s.left < p.found), 1.0, np.where(s.left > 0.97, 0.0, s.fills))
        s.left = eased(s.left, s.fills, np.where(s.fills > 0.5, p.fills_s, p.leaks_s), dt)
        s.left = np.where(off, 1.0, s.left)
        return p.share * (1.0 - s.left) * view.brake_force * moving(view)
