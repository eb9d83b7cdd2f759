"""Fourth effects for which no library name exists: traffic and winter service."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "trucks_that_pass",
    name="unknown",
    forms="fourth",
    source="Pressure pulses of vehicles that pass (Baker, J. Wind Eng. Ind. Aerodyn. 24, 1986; measurements"
    " of overtaking, Noger, Regardin and Szechenyi, J. Fluids Struct. 20, 2005): a bow wave holds, a wake"
    " draws on, longer for an overtaker than for oncoming traffic; rates, and sizes of a narrow road, are"
    " chosen here",
    ranges={"holds": (1.0, 2.0), "draws": (0.7, 1.5), "every_s": (5.0, 12.0), "width_s": (1.0, 2.0)},
    needs=("highway", "hills"),
)
class TrucksThatPass(Hidden):
    """holds, draws: of the drag at the truck's own speed, but for a minimum of 10 m/s."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(390), self.setting.batch
        count = int(4.0 * self.setting.duration_s / self.p.every_s) + 20
        self.at_s = np.cumsum(rng.exponential(self.p.every_s, (batch, count)) + 1.5, axis=1)
        slow = rng.random((batch, count)) < 0.35  # overtakes, the others come towards
        self.width = self.p.width_s * np.where(slow, 1.6, 0.7)
        self.size = rng.uniform(0.5, 1.3, (batch, count))

    def newtons(self, view: View, dt: float) -> Array:
        nearest = np.abs(self.at_s - view.time).argmin(axis=1)
        row = np.arange(len(nearest))
        x = (view.time - self.at_s[row, nearest]) / self.width[row, nearest]
        before = self.p.holds * np.exp(-(((x + 0.5) / 0.4) ** 2))
        after = self.p.draws * np.exp(-(((x - 0.6) / 0.5) ** 2))
        least = 0.5 * self.truck.air_density * self.truck.drag_area * np.maximum(view.speed, 10.0) ** 2
        pulse = self.size[row, nearest] * (after - before)
        return pulse * least * np.clip(view.speed / 4.0, 0.0, 1.0)


@hidden(
    "plough_blade",
    name="unknown",
    forms="fourth",
    source="Forces on a displacement plough with speed and depth (Nixon and Frisbie, Field Measurements of"
    " Plow Loads During Ice Removal Operations, SHRP-H-429; snow thrown with speed squared): the blade is"
    " lowered and lifted by the driver, and chatters on hard pack; sizes are chosen here",
    ranges={
        "scrapes": (0.006, 0.013),  # of the weight
        "throws": (0.003, 0.008),  # at 12 m/s
        "down_s": (12.0, 35.0),
        "up_s": (8.0, 25.0),
        "chatters": (0.1, 0.35),
    },
    needs=("suburban", "hills"),
)
class PloughBlade(Hidden):
    """Nobody records the lever; the blade is up at crossings and wherever the road is bare."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(391), self.setting.batch
        count = int(self.setting.duration_s / 5.0) + 10
        down = rng.exponential(self.p.down_s, (batch, count)) + 4.0
        up = rng.exponential(self.p.up_s, (batch, count)) + 3.0
        times = np.stack([up, down], axis=2).reshape(batch, -1)
        self.turns = np.cumsum(times, axis=1) - rng.uniform(0.0, self.p.up_s, (batch, 1))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"down": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        wanted = ((self.turns < view.time).sum(axis=1) % 2).astype(float)
        s.down += np.clip(wanted - s.down, -dt / 1.5, dt / 1.0)
        chatter = 1.0 + p.chatters * np.sin(2.0 * np.pi * view.distance / 9.0 + self.phase)
        cut = p.scrapes * chatter + p.throws * (np.clip(view.speed, 0.0, 20.0) / 12.0) ** 2
        return -s.down * cut * weight(view) * moving(view)
