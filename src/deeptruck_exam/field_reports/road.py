"""Fourth forms of the road: sections by roughness class, snow drifts; and the map of a road."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, place, weight
from deeptruck_model.trucks import View

CELL_M = 10.0
ROAD_M = 60000.0


class Mapped(Hidden):
    """`road` (routes, cells) interpolated at the truck's place, whichever way it drives."""

    road: Array
    cells = int(ROAD_M / CELL_M)

    def here(self, view: View) -> Array:
        cell = place(self.setting, view) / CELL_M
        low, rows = cell.astype(int) % (self.cells - 1), self.setting.route
        share = cell - np.floor(cell)
        return np.asarray((1.0 - share) * self.road[rows, low] + share * self.road[rows, low + 1])

    def rows(self) -> int:
        return int(self.setting.route.max()) + 1


def windows(rng: np.random.Generator, rows: int, mean_m: float, share: float) -> Array:
    """(rows, cells) of 0 and 1: a Markov chain of stretches of `mean_m` that cover `share` of the road."""
    cells = int(ROAD_M / CELL_M)
    leave, enter = CELL_M / mean_m, CELL_M / mean_m * share / (1.0 - share)
    out = np.zeros((rows, cells))
    state = rng.random(rows) < share
    for k, chance in enumerate(rng.random((cells, rows))):
        state = np.where(state, chance > leave, chance < enter)
        out[:, k] = state
    return out


@hidden(
    "sections_by_roughness",
    name="road_surface",
    forms="fourth",
    source="Roughness index by sections of 100 m, log-normal and alike next to each other (HPMS Field Manual;"
    " Sayers and Karamihas, The Little Book of Profiling, 1998); dampers take power with roughness squared"
    " (Zaabar and Chatti, NCHRP Report 720, 2012, on fuel and roughness); a cap and sizes of patched roads"
    " are chosen here",
    ranges={"loss": (0.0035, 0.0075), "spread": (0.5, 0.8), "alike_m": (200.0, 700.0)},
    accepts=("road_grade",),
)
class SectionsByRoughness(Mapped):
    """loss: over weight at 16 m/s on the median section, whose damper power the simulator does not know."""

    def prepare(self) -> None:
        rng, rows = self.setting.rng(373), self.rows()
        keep = np.exp(-100.0 / self.p.alike_m)
        log = np.zeros((rows, int(ROAD_M / 100.0)))
        log[:, 0] = rng.standard_normal(rows)
        for k in range(1, log.shape[1]):
            log[:, k] = keep * log[:, k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal(rows)
        rough = np.minimum(np.exp(2.0 * self.p.spread * log), 4.5)
        self.road = np.repeat(rough, round(100.0 / CELL_M), axis=1)

    def newtons(self, view: View, dt: float) -> Array:
        faster = np.sqrt(np.clip(view.speed, 0.0, 25.0) / 16.0)
        return -self.p.loss * self.here(view) * faster * weight(view) * moving(view)


@hidden(
    "snow_drifts",
    name="road_surface",
    forms="fourth",
    source="Drifts behind fences and cuttings (Tabler, Controlling Blowing and Drifting Snow with Snow Fences"
    " and Road Design, NCHRP 20-7(147), 2003), steep to windward and long to leeward; compaction and thrown"
    " snow with speed squared (van Es, J. Aircraft 36, 1999); traffic wears them down from drive to drive;"
    " sizes are chosen here",
    ranges={
        "compacts": (0.016, 0.034),  # of the weight, in the deepest
        "throws": (0.006, 0.016),  # at 15 m/s
        "each_m": (350.0, 900.0),
        "lee_m": (60.0, 200.0),
    },
    accepts=("road_grade",),
)
class SnowDrifts(Mapped):
    def prepare(self) -> None:
        rng, rows = self.setting.rng(374), self.rows()
        self.road = np.zeros((rows, self.cells))
        cells = np.arange(self.cells) * CELL_M
        for row in self.road:
            crests = np.cumsum(rng.exponential(self.p.each_m, 400) + 120.0)
            for crest in crests[crests < ROAD_M]:
                away = cells - crest
                length = np.where(away < 0.0, 20.0, self.p.lee_m)
                row[:] = np.maximum(row, rng.uniform(0.5, 1.0) * np.exp(-np.abs(away) / length))
        self.left = rng.uniform(0.6, 1.0, self.setting.batch)

    def newtons(self, view: View, dt: float) -> Array:
        p, depth = self.p, self.here(view) * self.left
        pace = (np.clip(view.speed, 0.0, 25.0) / 15.0) ** 2
        return -depth * (p.compacts * depth + p.throws * pace) * weight(view) * moving(view)
