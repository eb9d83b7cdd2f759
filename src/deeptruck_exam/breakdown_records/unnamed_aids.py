"""Sixth effects for which no library name exists: aids that brake or push, and what rolls in the tyres."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import gap_to_leader, now
from deeptruck_exam.breakdown_records.unnamed_machine import pedal
from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "keeps_off_the_leader",
    name="unknown",
    forms="sixth",
    source="Collision mitigation that warns by braking (ISO 22839, Forward vehicle collision mitigation"
    " systems; UN Regulation No. 131): by the time that is left to the vehicle ahead, gone once the gap"
    " opens; a unit that is set far too careful, times and depths are chosen here",
    ranges={
        "near_s": (1.0, 1.35),
        "closing_s": (1.0, 3.0),  # more, for each m/s of closing over the gap's 10 m
        "brakes": (0.02, 0.05),  # of the weight
        "least_s": (0.8, 2.0),
    },
    needs=("highway", "suburban"),
    leader=True,
)
class KeepsOffTheLeader(Hidden):
    """Each braking lasts `least_s` at least; the deeper, the less time is left."""

    def prepare(self) -> None:
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)

    def start(self, batch: int) -> dict[str, Array]:
        return {"depth": np.zeros(batch), "left": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        gap = np.maximum(gap_to_leader(self.setting, view), 1.0)
        leader = np.nan_to_num(self.leader_mps[:, now(self.setting, view)], nan=99.0)
        closing = np.maximum(view.speed - leader, 0.0)
        wanted_s = p.near_s + p.closing_s * closing * 10.0 / (gap + 10.0) / 3.0
        short = np.clip(1.0 - gap / np.maximum(view.speed * wanted_s, 1.0), 0.0, 1.0)
        s.left = np.where(short > 0.0, p.least_s, np.maximum(s.left - dt, 0.0))
        wanted = np.clip(0.35 + 2.0 * short, 0.0, 1.0) * (s.left > 0.0)
        s.depth += dt * (wanted - s.depth) / 0.3
        return -p.brakes * s.depth * weight(view) * np.clip(view.speed / 3.0 - 0.5, 0.0, 1.0)


@hidden(
    "dries_its_discs",
    name="unknown",
    forms="sixth",
    source="Brake disc wiping in rain (Automotive Handbook, Bosch, on additional functions of stability"
    " programs): pads are laid on for a second or two every so many metres while the driver pulls; pressed"
    " too hard here; ways and forces are chosen here",
    ranges={
        "every_m": (90.0, 240.0),
        "lasts_s": (1.5, 3.5),
        "force": (0.02, 0.042),  # of the weight
        "from_mps": (5.0, 9.0),
    },
    needs=("highway", "hills", "suburban"),
)
class DriesItsDiscs(Hidden):
    """The way since the last wiping, or the last braking, decides."""

    def prepare(self) -> None:
        self.first = self.setting.rng(516).uniform(0.0, 1.0, self.setting.batch) * self.p.every_m

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"way": self.first.copy(), "left": zero, "depth": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        braked = view.brake_force > 0.01 * weight(view)
        s.way = np.where(braked, 0.0, s.way + dt * np.maximum(view.speed, 0.0))
        pulls = (pedal(self, view) > 0.05) & (view.speed > p.from_mps)
        begins = (s.way > p.every_m) & pulls
        s.left = np.where(begins, p.lasts_s, np.maximum(s.left - dt, 0.0)) * ~braked
        s.way = np.where(begins, 0.0, s.way)
        s.depth += dt * ((s.left > 0.0) - s.depth) / 0.25
        return -p.force * s.depth * weight(view) * moving(view)


@hidden(
    "dolly_pushes_uphill",
    name="unknown",
    forms="sixth",
    source="Converter dollies with electric drives for road trains (research on long combination vehicles at"
    " Chalmers and VTI): they push by their own inclinometer, with a share of the slope's weight up to a"
    " power, until the battery has had enough; downhill it fills; sizes are chosen here",
    ranges={
        "share": (0.25, 0.5),
        "from_slope": (0.004, 0.010),
        "power_w": (70e3, 160e3),
        "energy_j": (2.5e6, 8.0e6),
        "late_s": (1.0, 3.0),
    },
    needs=("hills",),
)
class DollyPushesUphill(Hidden):
    """Whatever the pedals do: it knows the slope alone, a little late."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slope": np.zeros(batch), "charge": np.full(batch, 0.7), "tired": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.slope += dt * (view.grade - s.slope) / p.late_s
        speed = np.maximum(view.speed, 2.0)
        s.tired = np.where(s.charge <= 0.0, 1.0, np.where(s.charge > 0.25, 0.0, s.tired))
        wanted = p.share * np.maximum(s.slope - p.from_slope, 0.0) * view.mass * GRAVITY
        force = np.minimum(wanted, p.power_w / speed) * (1.0 - s.tired) * np.clip(view.speed - 1.0, 0.0, 1.0)
        fills = 30e3 + 0.5 * p.power_w * (s.slope < -0.01)
        s.charge = np.clip(s.charge + dt * (fills * (force <= 0.0) - force * speed) / p.energy_j, 0.0, 1.0)
        return force


@hidden(
    "liquid_in_the_tyres",
    name="unknown",
    forms="sixth",
    source="Liquid in a turning drum lies in a pool that the wall drags round until, above a speed, it coats"
    " the wall and turns along; on the way down it stays there longer and then falls (Thoroddsen and"
    " Mahadevan, Experimental Study of Coating Flows in a Partially-Filled Horizontally Rotating Cylinder,"
    " Exp. Fluids 23, 1997); ballasted tyres and sealant, sizes are chosen here",
    ranges={
        "pool": (0.010, 0.020),  # of the weight
        "coats_mps": (11.0, 17.0),
        "falls": (0.55, 0.8),  # of that speed
        "settles_s": (1.0, 4.0),
    },
    needs=("suburban", "hills"),
)
class LiquidInTheTyres(Hidden):
    """Slow driving costs, fast driving does not; in between it depends on what was before."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"coats": np.zeros(batch), "pool": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        fallen = view.speed < p.falls * p.coats_mps
        s.coats = np.where(view.speed > p.coats_mps, 1.0, np.where(fallen, 0.0, s.coats))
        s.pool += dt * (1.0 - s.coats - s.pool) / p.settles_s
        drags = np.sqrt(np.clip(view.speed / p.coats_mps, 0.0, 1.5))
        return -p.pool * s.pool * drags * weight(view) * moving(view)


@hidden(
    "slowed_in_zones",
    name="unknown",
    forms="sixth",
    source="Geofencing and intelligent speed assistance (Regulation (EU) 2019/2144; trials of the Swedish"
    " Transport Administration in Gothenburg and Stockholm): inside a zone the truck is braked by what it is"
    " too fast, wherever the map says so and whatever the pedal says; limits and depths are chosen here",
    ranges={
        "limit_mps": (9.0, 15.0),
        "per_mps": (0.006, 0.014),  # of the weight
        "most": (0.025, 0.05),
        "zone_m": (200.0, 600.0),
    },
    needs=("hills", "highway"),
)
class SlowedInZones(ByPlace):
    """`limit` (routes, cells): endless outside of the zones."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(517), self.p
        self.limit = np.full((self.rows(), CELLS), 1e3)
        for row in self.limit:
            for first, last in stretches(rng, (150.0, 700.0), (0.6 * p.zone_m, 1.6 * p.zone_m)):
                row[first:last] = p.limit_mps * rng.uniform(0.85, 1.25)

    def start(self, batch: int) -> dict[str, Array]:
        return {"depth": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        over = np.maximum(view.speed - self.read(self.limit, view), 0.0)
        s.depth += dt * (np.minimum(p.per_mps * over, p.most) - s.depth) / 0.7
        return -s.depth * weight(view) * moving(view)
