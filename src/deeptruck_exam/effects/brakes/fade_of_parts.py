"""Brakes that fade by their parts: strokes, fluids, baths, magnets, diaphragms, pins."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="brake_fade")


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


@law("v_pins_bind_when_hot", "sixteenth", "suburban descent", accepts="brake_gain")
@sizes(
    binds=(0.05, 0.1), share=(0.3, 0.5), heats_jpkg=(60.0, 160.0), cools_s=(40.0, 120.0), frees=(0.35, 0.6)
)
class PinsBindWhenHot(Hidden, bound=0.0):
    """`hot`: the pins on which callipers slide. At 1 they bind, and stay so until they are much cooler: then
    the outer pads get only what is left of the force after friction, gentle braking gets nothing. binds: of
    full braking, held by friction; share: of the brake force, on bound callipers; frees: of `hot`.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on floating callipers and their guides,
    and Knorr-Bremse, SB and SN disc brakes service manual, on seized guide pins; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1611).uniform(0.1, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 2.0)
        wish = np.where(s.hot > 1.0, 1.0, np.where(s.hot < p.frees, 0.0, np.round(s.bound)))
        s.bound = np.where(wish > 0.5, 1.0, eased(s.bound, 0.0, 3.0, dt))
        held = p.binds * (0.5 + 0.5 * s.hot) * self.truck.brake_capacity
        return p.share * s.bound * np.minimum(view.brake_force, held) * moving(view)
