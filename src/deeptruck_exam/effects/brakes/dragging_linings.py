"""Linings and shoes that stay on: hot, frozen, wedged, swollen, shrunk on, muddy, full of grit."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="dragging_brake")


@law("pads_stay_on", "third", "suburban descent")
@sizes(kept=(0.10, 0.28), way_m=(250.0, 1100.0), most=(0.012, 0.03))
class PadsStayOn(Hidden, held=0.0):
    """most: of the truck's weight.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on residual torque of disc brakes: nothing
    but disc run-out pushes the pads back, so that drag follows the last application and dies with the way;
    seized guide pins, sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = np.minimum(p.kept * view.brake_force, p.most * 9.81 * view.mass)
        rolled = dt * np.maximum(view.speed, 0.0) / p.way_m
        s.held = np.maximum(s.held * (1.0 - rolled), pressed)
        return -np.maximum(s.held - view.brake_force, 0.0) * moving(view)


@law("slack_adjusted_hot", "fourth", "suburban descent")
@sizes(per_k_n=(18.0, 38.0), clearance_k=(10.0, 35.0), cools_s=(70.0, 160.0), wears_m=(2500.0, 8000.0))
class SlackAdjustedHot(Hidden):
    """Temperatures in K above the air; clearances as the temperature that closes them. per_k_n: of a 20 t
    truck.
    Source: Automatic slack adjusters that take up the clearance of a hot, expanded drum leave none when it
    cools (service manuals of slack adjusters and NTSB/HAR reports on misadjusted brakes): the drag comes
    minutes after the braking; growth of drums and forces are chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(311).uniform(40.0, 190.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": self.first.copy(), "taken": self.first - self.p.clearance_k}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        tight = np.maximum(s.taken - s.drum, 0.0)
        drag = p.per_k_n * view.mass / 2.0e4 * np.minimum(tight, 130.0)
        applied = view.brake_force > 0.03 * self.truck.brake_capacity
        s.taken = np.where(applied, np.maximum(s.taken, s.drum - p.clearance_k), s.taken)
        s.taken = s.taken - dt * speed * tight / p.wears_m
        heats = (view.brake_force + drag) * speed / (0.6 * self.truck.brake_heat_capacity)
        s.drum += dt * (heats - s.drum * (0.5 + speed / 15.0) / p.cools_s)
        return -drag * moving(view)


@law("shoes_frozen_on", "fifth", "suburban descent")
@sizes(force_n=(1800.0, 4200.0), thaws_j=(0.8e6, 3.0e6), again_s=(5.0, 18.0), water_s=(60.0, 200.0))
class ShoesFrozenOn(Hidden):
    """Braking throws meltwater back on the linings, and standing freezes it.
    Source: Shoes that freeze to wet drums overnight and in long stops (winter bulletins of trailer makers;
    latent heat of ice in any handbook of physics): the wheel turns, drags, and thaws itself by the work of
    its own drag; adhesion with the root of what is frozen, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"ice": self.rng(432).uniform(0.5, 1.0, batch), "water": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        drag = p.force_n * weight(view) / 2.0e5 * np.sqrt(s.ice)
        work = (drag + 0.15 * view.brake_force) * np.maximum(view.speed, 0.0)
        thaw = np.minimum(work / p.thaws_j, s.ice / dt)
        slow = view.speed < 0.8
        freeze = slow * s.water * (1.0 - s.ice) / p.again_s
        s.water = np.clip(s.water + dt * (thaw - freeze - s.water / p.water_s), 0.0, 1.0)
        s.ice = np.clip(s.ice + dt * (freeze - thaw), 0.0, 1.0)
        return -drag * moving(view)


@law("s_wedge_climbs", "eighth", "suburban descent hills")
@sizes(most=(0.012, 0.024), seed=(0.04, 0.15), way_m=(90.0, 260.0), shakes_m=(500.0, 1500.0))
class WedgeClimbs(Hidden, climbs=0.0, tired=0.0):
    """most: of the weight. It bites by itself over the way after a braking and shakes loose later.
    Source: Self-energised brakes wedge themselves once touched (Roberts and others, Testing the Mechatronic
    Wedge Brake, SAE 2004-01-2766); a wedge without return spring, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rolled = dt * np.maximum(view.speed, 0.0)
        braked = view.brake_force > 0.006 * weight(view)
        s.tired = np.where(braked, 0.0, np.minimum(s.tired + rolled / p.shakes_m, 1.0))
        grows = s.climbs * (1.0 - s.climbs) / p.way_m - 3.0 * s.tired**2 * s.climbs / p.way_m
        s.climbs = np.where(braked, p.seed, np.clip(s.climbs + rolled * grows, 0.0, 1.0))
        return -p.most * s.climbs * weight(view) * ~braked * moving(view)


@law("t_linings_swell", "tenth", "suburban descent")
@sizes(rubs=(0.010, 0.022), swells_jpkg=(60.0, 200.0), soaks_s=(10.0, 35.0), wears_m=(400.0, 1500.0))
class LiningsSwell(Hidden, heat=0.0, swollen=0.0, worn=0.0):
    """Braking makes them thicker, their own rubbing thinner again; adjusters take up the wear. rubs: of the
    weight, fully swollen; swells_jpkg: work for each kg of truck; wears_m: way that takes it all off.
    Source: Archard, Contact and Rubbing of Flat Surfaces, J. Appl. Phys. 24 (1953), on wear with load and
    way; ISO 6313 on swelling of brake linings with heat; clearances set too small, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = view.brake_force * speed / (p.swells_jpkg * view.mass)
        s.heat = s.heat + dt * (work - s.heat / 120.0)
        s.swollen = s.swollen + dt * (1.0 - np.exp(-s.heat) - s.swollen) / p.soaks_s
        rubs = np.maximum(s.swollen - s.worn, 0.0)
        taken_up = s.worn * (view.brake_force > 0.0) / 30.0
        s.worn = s.worn + dt * (rubs * speed / p.wears_m - taken_up)
        return -p.rubs * rubs * weight(view) * moving(view)


@law("v_mud_dries_in_the_drums", "sixteenth", "suburban hills", accepts="rolling_resistance")
@sizes(
    most=(0.008, 0.014),
    sticks=(0.35, 0.6),
    picks_m=(40.0, 150.0),
    dries_s=(20.0, 60.0),
    crumbles_m=(250.0, 900.0),
)
@sizes(mean_m=(200.0, 600.0), muddy=(0.2, 0.4))
class MudDriesInTheDrums(OnRoad):
    """`mud` between shoes and drums, from wet fields and fords; `dry` of it. Wet mud drags the more, the
    faster it is sheared; dry mud drags the same at any speed, then crumbles out over the way, or at once
    when the brakes press it. most: of the weight, drums full; sticks: of that, at no speed; muddy: of the
    road.
    Source: Coussot, Mudflow Rheology and Dynamics (1997), on yield stress and flow of muds, and makers'
    manuals of construction trucks on cleaning drums; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1612), self.rows(), self.p.mean_m, self.p.muddy)

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1613)
        return {"mud": rng.uniform(0.0, 1.0, batch), "dry": rng.uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, wet = np.maximum(view.speed, 0.0), self.between(self.road, view)
        picks = wet * speed / p.picks_m * (1.0 - s.mud)
        presses = np.clip(view.brake_force / self.truck.brake_capacity / 0.1, 0.0, 1.0) / 1.5
        s.mud = np.clip(s.mud + dt * (picks - s.mud * (s.dry * speed / p.crumbles_m + presses)), 0.0, 1.0)
        s.dry = np.clip(
            s.dry + dt * ((1.0 - s.dry) * (1.0 - wet) / p.dries_s - picks * s.dry * 3.0), 0.0, 1.0
        )
        flows = (1.0 - s.dry) * (1.0 - p.sticks) * np.sqrt(np.minimum(speed / 12.0, 1.6))
        return -p.most * s.mud * (p.sticks + flows) * weight(view) * moving(view)


@law("y_grit_between_the_pads", "eighteenth", "suburban hills")
@sizes(most=(0.009, 0.015), enters_m=(80.0, 250.0), ground_m=(250.0, 800.0), flushed=(0.02, 0.06))
@sizes(mean_m=(150.0, 500.0), share=(0.3, 0.55))
class GritBetweenThePads(OnRoad):
    """`grit` between pads and discs. Wheels throw it up where the road is gravel, and it holds as long as it
    is there. The way grinds it away, and a braking crushes it within a second. most: of the weight, full of
    grit; enters_m, ground_m: of the way; flushed: of full braking, which crushes it.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on foreign matter in disc brakes and their
    residual torque; open brakes, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1813), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"grit": self.rng(1814).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        crushes = np.clip(view.brake_force / self.truck.brake_capacity / p.flushed, 0.0, 1.5) ** 2
        enters = self.between(self.road, view) * speed / p.enters_m * (1.0 - s.grit)
        s.grit = np.clip(s.grit + dt * (enters - s.grit * (speed / p.ground_m + crushes)), 0.0, 1.0)
        return -p.most * s.grit**0.7 * weight(view) * moving(view)


@law("u_drums_shrink_on_their_shoes", "twenty-first", "suburban hills descent")
@sizes(
    most=(0.012, 0.02), warm_jpkg=(60.0, 140.0), drum_s=(12.0, 30.0), shoe_s=(60.0, 150.0), room=(0.06, 0.16)
)
@sizes(tight=(0.15, 0.3))
class DrumsShrinkOnTheirShoes(Hidden):
    """`drum`, `shoe`: their heat over the air's. Braking warms both; then the wind cools the drum long before
    its shoes, so that it shrinks on them and drags, some time after a braking and most at speed. room: of the
    clearance, as the difference of heat that closes it; tight: beyond it, for all the drag. most: of the
    weight.
    Source: Limpert, Brake Design and Safety (1999), on drums and shoes that grow with heat, and Newcomb and
    Spurr, Braking of Road Vehicles (1967), on their cooling; narrow adjustment, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        shoe = self.rng(2112).uniform(0.1, 0.8, batch)
        return {"shoe": shoe, "drum": 0.6 * shoe}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass / p.warm_jpkg
        wind = 0.25 + 0.75 * np.clip(view.speed / 20.0, 0.0, 1.4)
        s.drum = np.clip(s.drum + dt * (work - wind * s.drum / p.drum_s), 0.0, 2.0)
        s.shoe = np.clip(s.shoe + dt * (0.8 * work - s.shoe / p.shoe_s), 0.0, 2.0)
        grips = np.clip((s.shoe - s.drum - p.room) / p.tight, 0.0, 1.0)
        off = 1.0 - np.clip(view.brake_force / (0.02 * self.truck.brake_capacity), 0.0, 1.0)
        return -p.most * grips**1.5 * off * weight(view) * moving(view)
