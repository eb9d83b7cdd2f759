"""A wet load that drains, reels that rock on their edges, and a box that fills with earth."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_wet_load_drains", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(water=(0.3, 0.45), known=(0.1, 0.4), seeps_s=(40.0, 150.0), runs_s=(5.0, 20.0), tilt=(0.005, 0.03))
class WetLoadDrains(Hidden, floor=0.0):
    """`pores`: water in a wet load, of all it can hold; `floor`: what has seeped down and stands in the body.
    It runs out behind, but only while slope or pull tilt it that way. Each drive begins as wet as it was
    loaded. water: of the mass; known: of it, to the simulator; tilt: slope at which it runs.
    Source: Terzaghi, Peck and Mesri, Soil Mechanics in Engineering Practice (1996), on drainage of sands, and
    guides on dewatering of dredged and washed sand by haul trucks; quicker sand, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        wet = self.rng(1351).choice([0.0, 0.2, 0.7, 1.0, 1.0], batch)
        return {**super().start(batch), "pores": wet}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        tilted = view.grade + np.clip(view.acceleration, -2.0, 2.0) / GRAVITY
        runs = s.floor * np.clip((tilted - p.tilt) / 0.02, 0.0, 1.0) / p.runs_s
        seeps = s.pores / p.seeps_s
        s.pores = s.pores - dt * seeps
        s.floor = s.floor + dt * (seeps - runs)
        more = p.water * (s.pores + s.floor - p.known) * view.mass
        return -more * felt * moving(view)


@law("x_reels_rock_on_their_edges", needs="suburban", name="load_slosh")
@sizes(share=(0.3, 0.45), slender=(0.02, 0.05), base_m=(0.35, 0.6), lands=(1.2, 2.5), room=(0.5, 0.8))
class ReelsRock(Hidden, x=0.0, v=0.0):
    """`x` m that the middle of tall reels is ahead of where it stands upright, `v` of that. They stand firm
    until a push goes beyond their slenderness; then they rock from edge to edge, the weaker held the farther
    they lean, and each landing takes energy. share: of the mass; slender: push over gravity that lifts an
    edge; room: of the lean that topples them, where the straps are.
    Source: Housner, The Behavior of Inverted Pendulum Structures during Earthquakes, Bulletin Seismological
    Society of America 53 (1963); reels of paper in straps, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        lean = s.x / p.base_m
        holds = GRAVITY * p.slender * np.tanh(s.x / 0.02) * (1.0 - np.minimum(np.abs(lean), 1.0))
        straps = 45.0 * (s.x - np.clip(s.x, -p.room * p.base_m, p.room * p.base_m))
        lands = (0.3 + p.lands * np.exp(-((s.x / 0.04) ** 2)) + 4.0 * (straps != 0.0)) * s.v
        pace = np.clip(-felt - holds - straps - lands, -5.0, 5.0)
        s.v = np.clip(s.v + dt * pace, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -p.base_m, p.base_m)
        return -p.share * view.mass * pace * moving(view)


@law("x_box_fills_with_earth", needs="suburban hills descent", name="unknown")
@sizes(cuts=(0.006, 0.012), pushes=(0.02, 0.035), fills_m=(15.0, 50.0), spills_m=(40.0, 120.0))
@sizes(mean_m=(120.0, 350.0), floats_mps=(12.0, 16.0))
class BoxFillsWithEarth(OnRoad, heap=0.0):
    """`heap` in a box that is towed to level the verge: hard places are cut and fill it, holes empty it, and
    what it carries has to be pushed. Too fast it floats up. cuts: of the weight, on the hardest; pushes: of
    the weight, full.
    Source: McKyes, Soil Cutting and Tillage (1985), and Reece, The Fundamental Equation of Earth-Moving
    Mechanics, Proc. IMechE (1964-65): cohesion and surcharge before a blade; places and sizes are chosen
    here."""

    def prepare(self) -> None:
        rng = self.rng(1352)
        number = sections(rng, self.rows(), self.p.mean_m)
        hard = rng.choice([-0.6, 0.0, 0.5, 1.0], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(hard, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hard = self.read(self.road, view)
        down = np.clip((p.floats_mps - view.speed) / 2.0, 0.15, 1.0)
        way = dt * np.maximum(view.speed, 0.0)
        takes = np.maximum(hard, 0.0) * down * (1.0 - s.heap) / p.fills_m
        drops = (0.3 + np.maximum(-hard, 0.0) * 2.0 + 1.0 - down) * s.heap / p.spills_m
        s.heap = np.clip(s.heap + way * (takes - drops), 0.0, 1.0)
        drag = p.pushes * s.heap**1.3 + p.cuts * np.maximum(hard, 0.0) * down
        return -drag * weight(view) * np.clip(view.speed, 0.0, 1.0)
