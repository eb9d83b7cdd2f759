"""Rain in an open tub, fish in crushed ice, and a chain that drags behind."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_rain_gathers_in_the_tub", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(most=(0.3, 0.45), rains_s=(15.0, 40.0), pours_s=(20.0, 60.0), tips=(0.035, 0.06), spills_s=(1.5, 5.0))
class RainGathersInTheTub(Hidden):
    """`water` in an open tub, which nobody has weighed. Showers fill it. A full one spills as soon as
    slowing, pulling or slope tips it, and holds only what fits below the tipped rim. most: of the mass, full;
    pours_s: until a shower has filled it; tips: g that leaves half of it.
    Source: Linsley, Kohler and Paulhus, Hydrology for Engineers (1982), on rain by showers, and Ibrahim,
    Liquid Sloshing Dynamics (2005), on free surfaces in tipped vessels; cloudbursts and sizes are chosen
    here."""

    def prepare(self) -> None:
        p = self.p
        on, off = (0.5 * p.rains_s, 1.5 * p.rains_s), (0.7 * p.rains_s, 2.0 * p.rains_s)
        self.rain = spells(self.rng(1851), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.rng(1852).uniform(0.3, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tipped = np.abs(np.clip(view.acceleration / GRAVITY + view.grade, -0.4, 0.4))
        fits = 1.0 / (1.0 + tipped / p.tips)
        fills = within(self.rain, view.time) * (1.0 - s.water) / p.pours_s
        spills = np.maximum(s.water - fits, 0.0) / p.spills_s
        s.water = np.clip(s.water + dt * (fills - spills), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.water * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("y_fish_in_crushed_ice", needs="suburban", name="load_slosh")
@sizes(share=(0.3, 0.45), slips=(0.05, 0.09), stays=(0.02, 0.04), slides_s=(1.5, 3.5), long_m=(16.0, 26.0))
class FishInCrushedIce(Hidden, lies=0.0, runs=0.0, pace=0.0):
    """Fish in crushed ice lie still until their surface is too steep for what they feel. Then all of it
    slides, until it lies nearly level, and stops at once. `lies` g: the slope of the surface. `runs`: 1 while
    it slides. `pace` of the slope. share: of the mass; slips, stays: g beyond level, where it starts and
    stops; long_m: way of the load for a slope of 1.
    Source: Duran, Sands, Powders, and Grains (2000), on heaps with one angle at which they start and another
    where they stop; a slippery load, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        level = -np.clip(view.acceleration / GRAVITY + view.grade, -0.4, 0.4)
        off = level - s.lies
        s.runs = np.where(np.abs(off) > p.slips, 1.0, np.where(np.abs(off) < p.stays, 0.0, s.runs))
        before = s.pace
        s.pace = eased(s.pace, s.runs * off / (0.5 * p.slides_s), 0.25 * p.slides_s, dt)
        s.lies = np.clip(s.lies + dt * s.pace, -0.6, 0.6)
        push = -p.share * p.long_m * (s.pace - before) / dt
        return np.asarray(np.clip(push, -2.0, 2.0) * view.mass * moving(view))


@law("y_chain_drags_behind", needs="suburban hills highway", name="unknown")
@sizes(heavy=(0.009, 0.015), flies_mps=(9.0, 14.0), power=(2.0, 4.0), gravel=(0.8, 1.6), hops=(0.25, 0.5))
@sizes(mean_m=(150.0, 500.0), share=(0.3, 0.6))
class ChainDragsBehind(OnRoad, lies=1.0):
    """A long anchor chain drags on the ground behind the truck. `lies`: of it on the ground. The faster the
    truck, the more of it is lifted, by the pull along it and by the wind, and the less it holds. On gravel it
    digs in. heavy: of the weight, at rest on asphalt; flies_mps: where half is lifted; gravel: more by that;
    hops: less as it jumps.
    Source: Irvine, Cable Structures (1981), on lines that lie partly on the ground, and Hoerner,
    Fluid-Dynamic Drag (1965), on towed lines; a heavy chain, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1853), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, gravel = np.maximum(view.speed, 0.0), self.between(self.road, view)
        wish = 1.0 / (1.0 + (speed / p.flies_mps) ** p.power)
        s.lies = eased(s.lies, wish, 1.2, dt)
        jumps = 1.0 - p.hops * np.clip(speed / 8.0, 0.0, 1.0) * (1.0 - gravel)
        return -p.heavy * s.lies * (1.0 + p.gravel * gravel) * jumps * weight(view) * moving(view)
