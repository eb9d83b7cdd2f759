"""Hillsides that slip in blocks, and slush that lies."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad, smooth_stretches, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("u_hillside_slips_in_blocks", needs="hills highway suburban", name="road_grade", gateable=False)
@sizes(tilts=(0.013, 0.022), long_m=(90.0, 200.0), gap_m=(30.0, 90.0), steep=(0.14, 0.25))
class HillsideSlipsInBlocks(OnRoad):
    """Since the survey the hillside has slipped in blocks. Each has turned back as it went down: the road on
    it leans one way over most of its length, and comes back to its old height by a short steep scarp. tilts:
    of a block; long_m: of one; steep: of its length, that the scarp takes.
    Source: Varnes, Slope Movement Types and Processes, TRB Special Report 176 (1978), on slips whose blocks
    turn back; slow ones that the road has followed, sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(2161), self.p
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            gaps, lengths = (p.gap_m, 4.0 * p.gap_m), (0.6 * p.long_m, 1.6 * p.long_m)
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / max(last - first, 1)
                down = rng.uniform(0.6, 1.2) * rng.choice([-1.0, 1.0])
                scarp = along > 1.0 - p.steep
                row[first:last] = down * np.where(scarp, -(1.0 - p.steep) / p.steep, 1.0)
        ease = np.hanning(9) / np.hanning(9).sum()
        self.road = np.stack([np.convolve(row, ease, mode="same") for row in self.road])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) / CELL_M
        low, share, route = at.astype(int) % (CELLS - 1), at - np.floor(at), self.setting.route
        leans = (1.0 - share) * self.road[route, low] + share * self.road[route, low + 1]
        slope = np.clip(self.setting.direction * p.tilts * leans, -0.07, 0.07)
        return -slope * weight(view) * moving(view)


@law("u_slush_lies", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(
    most=(0.018, 0.03), floats_mps=(14.0, 19.0), packs=(0.3, 0.5), mean_m=(300.0, 900.0), deeper=(1.0, 1.6)
)
class SlushLies(OnRoad):
    """Slush lies over stretches of the road. Wheels press it together at any speed and throw it ahead by the
    square of speed; from a speed on they float up on it and throw less, so that the drag has a peak. most: of
    the weight, at floats_mps where it is deep; packs: of that, at walking pace; deeper: power of the depth.
    Source: Horne, Joyner and Leland, Studies of the Retardation Force Developed on an Aircraft Tire Rolling
    in Slush or Water, NASA TN D-552 (1960), on the peak and what is left beyond; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2162), self.p
        gaps, lengths = (0.2 * p.mean_m, 0.9 * p.mean_m), (0.5 * p.mean_m, 2.0 * p.mean_m)
        lies = smooth_stretches(rng, self.rows(), gaps, lengths)
        depth = np.clip(1.0 + 0.35 * ou_series(rng, lies.shape, CELL_M, 80.0), 0.3, 1.7)
        self.slush = lies**0.5 * depth**p.deeper

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ratio = np.maximum(view.speed, 0.0) / p.floats_mps
        throws = 2.0 * ratio**2 / (1.0 + ratio**5)
        cost = (p.packs + (1.0 - p.packs) * throws) * self.read(self.slush, view)
        return -p.most * cost * weight(view) * moving(view)
