"""Seventh forms in the brakes: skin that glows, orifices that choke, valves that hold back."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, moving, weight, wheel_force
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View

SKIN_S = np.array([3.0, 15.0, 75.0])[:, None]  # layers below the rubbing face
SKIN = np.array([0.5, 0.3, 0.2])[:, None]


@law(
    "skin_of_the_drum",
    name="brake_fade",
    source="UN Regulation No. 13, annex 4, fade tests of type I, and Carslaw and Jaeger, Conduction of Heat"
    " in Solids (1959): the rubbing face follows the power with the root of time, here as layers of three"
    " depths, and friction falls with the face's temperature as a power law",
    # most: of the brake force; half_wpkg: steady power over mass at which half of it is lost
    ranges={"most": (0.35, 0.6), "half_wpkg": (3.0, 5.0), "steep": (2.5, 4.5)},
    needs=("descent",),
)
class SkinOfTheDrum(Hidden):
    """A single hard stop loses a little at its end; a long descent loses minutes after minutes."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"face": np.zeros((3, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        hot = np.maximum((SKIN * s.face).sum(axis=0), 0.0) / p.half_wpkg
        lost = p.most * hot**p.steep / (1.0 + hot**p.steep)
        power = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.face = s.face + dt * (power - s.face) / SKIN_S
        return lost * view.brake_force * moving(view)


@law(
    "orifice_chokes",
    name="brake_lag",
    source="FMVSS 121 S5.3.3 and S5.3.4 and UN Regulation No. 13, annex 6, response times on the bench: air"
    " passes a narrow coupling at the speed of sound until the chamber has half of the pressure ahead of it,"
    " then ever slower (Saint-Venant and Wantzel); a wrong coupling's bore",
    # share: of the brakes behind it; fills_per_s: of the pressure ahead; first: to move the shoes
    ranges={"share": (0.55, 0.9), "fills_per_s": (0.5, 1.4), "first": (0.01, 0.03)},
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class OrificeChokes(Law, inside=0.0):
    """inside: pressure over the full one; a gentle brake waits longest for the shoes to come."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.brake_capacity
        asked = view.brake_force / full
        ahead = np.where(asked > 0.0, asked + p.first, 0.0)
        ratio = np.clip(s.inside / np.maximum(ahead, 1e-6), 0.0, 1.0)
        flow = np.sqrt(np.clip(1.0 - ((ratio - 0.528) / 0.472) ** 2, 0.0, 1.0))
        rise = p.fills_per_s * ahead * np.where(ratio < 0.528, 1.0, flow)
        fall = 1.7 * p.fills_per_s * np.sqrt(np.maximum(s.inside, 0.0) * np.maximum(s.inside - ahead, 0.0))
        up = np.minimum(dt * rise, np.maximum(ahead - s.inside, 0.0))
        s.inside = s.inside + np.where(ahead > s.inside, up, -dt * fall - dt * 0.02 * (ahead <= 0.0))
        s.inside = np.maximum(s.inside, 0.0)
        felt = np.maximum(s.inside - p.first, 0.0)
        return p.share * full * (asked - felt) * moving(view)


@law(
    "held_back_by_the_release_valve",
    name="dragging_brake",
    source="FMVSS 121 S5.3.4 on release times, and Limpert, Brake Design and Safety, on quick release valves:"
    " one opens only against a difference of pressure, so that a brake let go gently keeps some air, and one"
    " let go at once does not; the rest leaves through a bleed",
    # kept: of the weight; opens_per_s: of the weight and second, release that opens it well
    ranges={"kept": (0.010, 0.024), "opens_per_s": (0.05, 0.16), "bleeds_s": (10.0, 40.0)},
    needs=("suburban", "descent", "hills"),
)
class HeldBackByTheReleaseValve(Law, was=0.0, pace=0.0, kept=0.0):
    """What counts is how fast the last part of a brake force went, not how large it was."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        force = view.brake_force / weight(view)
        s.pace += dt * (np.maximum(s.was - force, 0.0) / dt - s.pace) / 0.5
        presses = force > 0.004
        stays = p.kept * np.exp(-s.pace / p.opens_per_s)
        s.kept = np.where(presses, stays, s.kept * (1.0 - dt / p.bleeds_s))
        s.was = force
        return -s.kept * weight(view) * ~presses * moving(view)


@law(
    "compression_brake_fills_itself",
    name="engine_brake",
    source="Compression release brakes (C. L. Cummins, US patent 3 220 392, 1965) on the bench, and UN"
    " Regulation No. 13, annex 4, type IIA: it compresses what the turbocharger delivers, which follows the"
    " braking; a tap on the brakes switches it on, the pedal off",
    ranges={"bare_nm": (170.0, 380.0), "gain": (0.8, 1.8), "fills_s": (1.5, 5.0), "from_rads": (85.0, 105.0)},
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class CompressionBrakeFillsItself(Law, on=0.0, boost=0.0):
    """Every change of gear empties the manifold again."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = view.u[:, 0] <= 0.01 * self.truck.full_command
        s.on = np.where(closed & (view.brake_force > 0.0), 1.0, np.where(closed, s.on, 0.0))
        works = s.on * (view.engine_speed > p.from_rads) * (1.0 - view.shifting)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        fills = np.where(works > 0.0, (turns**2 - s.boost) / p.fills_s, -s.boost / 0.3)
        s.boost += dt * fills
        torque = p.bare_nm * turns * (1.0 + p.gain * s.boost) * works
        return -wheel_force(self.setting, view, torque) * moving(view)
