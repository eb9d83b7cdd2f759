"""Sixth forms of the air: storms that burst, a pocket that is lost and found, a body that rises."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, Setting, hidden
from deeptruck_model.trucks import View


def now(setting: Setting, view: View) -> int:
    """The sample of `leader_m` at this moment."""
    return min(int(view.time / setting.dt), setting.leader_m.shape[1] - 1)


def gap_to_leader(setting: Setting, view: View) -> Array:
    """Metres to the leader, endless where nobody drives ahead."""
    return np.nan_to_num(setting.leader_m[:, now(setting, view)] - view.distance, nan=1e5)


def spells(
    rng: np.random.Generator, batch: int, on: tuple[float, float], off: tuple[float, float]
) -> tuple[Array, Array]:
    """Starts and ends (batch, 40), s, of spells that come and go; some began before the drive."""
    lengths = np.stack([rng.uniform(*off, (batch, 40)), rng.uniform(*on, (batch, 40))], axis=2)
    edges = np.cumsum(lengths.reshape(batch, 80), axis=1) - rng.uniform(0.0, sum(on), (batch, 1))
    return edges[:, ::2], edges[:, 1::2]


def within(spans: tuple[Array, Array], at: float | Array) -> Array:
    """1 inside one of the spans, else 0; `at` is a time, or a place for each drive."""
    where = np.asarray(at, float).reshape(-1, 1)
    return np.asarray(((spans[0] <= where) & (where < spans[1])).any(axis=1).astype(float))


@hidden(
    "downbursts",
    name="headwind",
    forms="sixth",
    source="Oseguera and Bowles, A Simple, Analytic 3-Dimensional Downburst Model Based on Boundary Layer"
    " Stagnation Flow, NASA TM-100632 (1988): air falls to the ground and flows off to all sides, so that a"
    " truck meets it from the front, then from behind; growth and decay in minutes after Fujita, The"
    " Downburst (1985); places and sizes are chosen here",
    ranges={
        "outflow_mps": (11.0, 20.0),
        "peak_m": (450.0, 950.0),  # from the centre to the strongest wind
        "lives_s": (120.0, 330.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class Downbursts(Hidden):
    """Three in each drive. Off the road's line they blow from the side as well, which costs nothing here."""

    def prepare(self) -> None:
        rng, shape = self.setting.rng(501), (3, self.setting.batch)
        lasts = self.setting.duration_s
        self.centre = rng.uniform(0.05, 1.0, shape) * 20.0 * lasts
        self.aside = rng.normal(0.0, 0.5, shape) * self.p.peak_m
        self.begins = self.centre / 20.0 - rng.uniform(0.25, 0.75, shape) * self.p.lives_s
        self.size = rng.uniform(0.55, 1.0, shape) * self.p.outflow_mps

    def newtons(self, view: View, dt: float) -> Array:
        along = view.distance - self.centre
        away = np.maximum(np.hypot(along, self.aside), 1.0)
        radius = away / self.p.peak_m
        life = np.sin(np.pi * np.clip((view.time - self.begins) / self.p.lives_s, 0.0, 1.0))
        outward = self.size * life * radius * np.exp(0.5 * (1.0 - radius**2))
        air = view.speed - (outward * along / away).sum(axis=0)
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * air * np.abs(air)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "pocket_lost_and_found",
    name="drafting",
    forms="sixth",
    source="Hammache, Michaelian and Browand, Aerodynamic Forces on Truck Models, Including Two Trucks in"
    " Tandem, SAE 2002-01-0530: flow between bodies changes over at a critical gap, not little by little;"
    " that it is lost farther off than it is found again, and the sizes, are chosen here",
    ranges={
        "saving": (0.45, 0.7),
        "finds_m": (19.0, 28.0),
        "wider": (1.12, 1.4),  # where it is lost, over where it is found
        "settles_s": (0.8, 3.0),
    },
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class PocketLostAndFound(Hidden):
    """Whether a gap saves anything depends on where the follower came from."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"found": np.zeros(batch), "inside": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        gap = gap_to_leader(self.setting, view)
        lost = gap > p.finds_m * p.wider
        s.found = np.where(gap < p.finds_m, 1.0, np.where(lost, 0.0, s.found))
        s.inside += dt * (s.found - s.inside) / p.settles_s
        return p.saving * s.inside * view.drag_force


@hidden(
    "body_creeps_up",
    name="drag_area",
    forms="sixth",
    source="Tipper bodies that rise unnoticed while the power take-off is left in (Prevention of Bridge"
    " Strikes, good practice guides of Network Rail, on raised bodies): a pump geared to the engine lifts,"
    " weight lowers once it is taken out; frontal area with the sine of the angle; sizes are chosen here",
    ranges={
        "gain": (0.55, 1.0),  # of the drag area, with the body up
        "rises_s": (30.0, 80.0),
        "lowers_s": (10.0, 25.0),
        "notices_s": (50.0, 120.0),
    },
    needs=("highway", "hills"),
    accepts=("headwind",),
)
class BodyCreepsUp(Hidden):
    """angle: 1 where the ram's stop is, 25 degrees or so."""

    def prepare(self) -> None:
        rng, late = self.setting.rng(502), self.p.notices_s
        self.spells = spells(rng, self.setting.batch, (0.6 * late, 1.4 * late), (25.0, 70.0))
        self.first = rng.uniform(0.0, 0.7, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pumps = within(self.spells, view.time)
        lifts = pumps * np.clip(view.engine_speed / 140.0, 0.3, 1.5) / p.rises_s
        s.angle = np.clip(s.angle + dt * (lifts - (1.0 - pumps) / p.lowers_s), 0.0, 1.0)
        return -p.gain * np.sin(0.5 * np.pi * s.angle) * view.drag_force
