"""Water for the dust, clothes that slide on their rail, and a roller that shakes."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("u_waters_the_dust", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(
    most=(0.36, 0.52), empties_s=(50.0, 120.0), mean_m=(300.0, 900.0), share=(0.45, 0.65), fills_s=(6.0, 14.0)
)
class WatersTheDust(OnRoad):
    """A tank truck waters the dusty stretches of a road. Water runs out by its own head, so with the root of
    what is left, and only while the truck rolls; wherever it stands a pump fills it again. `gone`: of a full
    tank. most: of the mass; empties_s: from full to empty.
    Source: Torricelli's law of outflow, and USEPA AP-42, section 13.2.2 on watering of unpaved roads; the
    quick filling and sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(2151), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"gone": self.rng(2152).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        dusty = self.between(self.road, view)
        runs = dusty * np.clip(view.speed - 1.0, 0.0, 1.0)
        out = 2.0 * runs * np.sqrt(np.maximum(1.0 - s.gone, 0.0)) / p.empties_s
        fills = np.where(view.speed < 0.3, 1.0 / p.fills_s, 0.0)
        s.gone = np.clip(s.gone + dt * (out - fills), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return p.most * s.gone * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("u_clothes_slide_on_their_rail", needs="suburban", name="load_slosh")
@sizes(share=(0.3, 0.45), long_m=(1.4, 2.6), sticks=(0.03, 0.06), room_m=(0.25, 0.6), dull=(0.04, 0.1))
@sizes(slides=(0.4, 1.0))
class ClothesSlideOnTheirRail(Hidden, lean=0.0, rate=0.0, at=0.0, stop=0.0):
    """Long bags hang on rails along the truck. They swing, and where they pull on their hooks too much these
    slide along the rail, to its stop; while they slide the truck feels no more than their friction. `lean`
    rad ahead, `rate` of that; `at` m of the hooks. share: of the mass; sticks: pull over weight from which
    hooks slide; slides: m/s, for each m/s2 beyond; room_m: of the rail, either way.
    Source: Nayfeh and Mook, Nonlinear Oscillations (1979), on pendulums, and Armstrong-Hélouvry, Dupont and
    Canudas de Wit, A Survey of Models of Machines with Friction, Automatica 30 (1994); sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        own = np.sqrt(GRAVITY / p.long_m)
        pulls = GRAVITY * np.sin(s.lean) * np.cos(s.lean)  # of the bags on their hooks, forwards
        over = pulls - np.clip(pulls, -GRAVITY * p.sticks, GRAVITY * p.sticks)
        moved = s.at + dt * np.clip(p.slides * over, -1.0, 1.0)
        s.at = np.clip(moved, -p.room_m, p.room_m)
        s.stop = eased(s.stop, np.where(np.abs(moved) > p.room_m, 1.0, 0.0), 0.15, dt)
        turns = -(GRAVITY * np.sin(s.lean) + felt * np.cos(s.lean)) / p.long_m - 2.0 * p.dull * own * s.rate
        s.rate = np.clip(s.rate + dt * turns, -1.5, 1.5)
        s.lean = np.clip(s.lean + dt * s.rate, -0.6, 0.6)
        rail = pulls - over * (1.0 - s.stop)
        return np.asarray(p.share * np.clip(rail + felt, -2.5, 2.5) * view.mass * moving(view))


@law("u_roller_shakes_behind", needs="suburban hills highway", name="unknown")
@sizes(
    most=(0.016, 0.027), tone_rads=(120.0, 150.0), wide=(0.12, 0.22), eases=(0.5, 0.8), mean_m=(200.0, 600.0)
)
@sizes(sinks_m=(4.0, 12.0))
class RollerShakesBehind(OnRoad, sunk=0.4):
    """A roller is towed that the truck's engine shakes. Over soft stretches it sinks in and has to be drawn
    out of its own hollow; near the tone of the ground the shaking makes the ground flow, and the roller goes
    more easily. `sunk`: of the most. most: of the weight; tone_rads: of the engine; eases: of the drag.
    Source: Wong, Theory of Ground Vehicles (2008), on rigid wheels that sink, and Adam and Kopf, Operational
    Devices for Compaction Optimization and Quality Control, Bearing Capacity of Roads (2004), on rollers and
    the tone of the ground; towing it on the way, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.2 * p.mean_m, 0.8 * p.mean_m), (0.6 * p.mean_m, 1.6 * p.mean_m)
        self.soft = smooth_stretches(self.rng(2153), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soft = 0.3 + 0.7 * self.read(self.soft, view)
        flows = 1.0 / (1.0 + ((view.engine_speed / p.tone_rads - 1.0) / p.wide) ** 2)
        wish = soft * (1.0 - p.eases * flows)
        s.sunk = eased(s.sunk, wish, p.sinks_m / np.maximum(view.speed, 0.5), dt)
        return -p.most * np.maximum(s.sunk, 0.0) ** 0.75 * weight(view) * moving(view)
