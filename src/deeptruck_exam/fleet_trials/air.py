"""Fifth forms of the air: hills that speed the wind up, a wake blown aside, an empty open body."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, ou_series
from deeptruck_model.trucks import View

SAMPLE_S = 0.25


def arrivals(rng: np.random.Generator, shape: tuple[int, int], mean_s: float, decay_s: float) -> Array:
    """Shot noise of unit mean, samples SAMPLE_S apart: each gust comes at once and dies away."""
    from scipy.signal import lfilter

    hits = rng.poisson(SAMPLE_S / mean_s, shape) * rng.exponential(1.0, shape)
    hits[:, 0] += decay_s / mean_s  # as if it had blown before
    keep = np.exp(-SAMPLE_S / decay_s)
    return np.asarray(lfilter([1.0], [1.0, -keep], hits, axis=1)) * (1.0 - keep) * mean_s / SAMPLE_S


@hidden(
    "wind_over_the_crests",
    name="headwind",
    forms="fifth",
    source="Jackson and Hunt, Turbulent Wind Flow over a Low Hill, Q. J. R. Met. Soc. 101 (1975): wind grows"
    " on a crest and is weak in a hollow; gusts with a sharp front and a long tail (Gao, Shaw and Paw U,"
    " Boundary-Layer Met. 47, 1989) as shot noise; drag over yaw as a power 1.4, sizes chosen here",
    ranges={
        "mean_mps": (6.0, 11.0),
        "per_20m": (0.25, 0.6),  # speed-up for each 20 m above the surroundings
        "gusts": (0.25, 0.5),  # of the mean wind
        "decay_s": (4.0, 14.0),
        "yaw_drag": (0.6, 1.3),
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class WindOverTheCrests(Hidden):
    """The surroundings are the heights of the last kilometre or so."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(401), self.setting.batch
        slots = int(self.setting.duration_s / SAMPLE_S) + 20
        self.gust = arrivals(rng, (batch, slots), 7.0, self.p.decay_s)
        bearing = rng.uniform(0.0, 2.0 * np.pi, int(self.setting.route.max()) + 1)
        day = rng.uniform(0.0, 2.0 * np.pi) + 0.35 * rng.standard_normal(batch)
        self.angle = day - bearing[self.setting.route] - np.pi * (self.setting.direction < 0)
        self.mean = self.p.mean_mps * rng.uniform(0.75, 1.2, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"around": np.full(batch, np.nan)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        climbs = np.maximum(view.speed, 0.0) * view.grade * dt
        above = np.where(np.isnan(s.around), 0.0, s.around) + climbs
        s.around = above * (1.0 - dt * np.maximum(view.speed, 0.0) / 1200.0)
        at = min(int(view.time / SAMPLE_S), self.gust.shape[1] - 1)
        blows = (1.0 - p.gusts + p.gusts * np.minimum(self.gust[:, at], 4.0)) * np.exp(
            np.clip(p.per_20m * s.around / 20.0, -1.2, 0.8)
        )
        along = view.speed + self.mean * blows * np.cos(self.angle)
        across = self.mean * blows * np.sin(self.angle)
        yaw = np.arctan2(np.abs(across), np.maximum(np.abs(along), 3.0))
        area = self.truck.drag_area * (1.0 + p.yaw_drag * np.minimum(yaw, 0.7) ** 1.4)
        wanted = 0.5 * self.truck.air_density * area * along * np.abs(along)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "wake_blown_aside",
    name="drafting",
    forms="fifth",
    source="Instrumented pairs of trucks on motorways: saving falls with the logarithm of the gap and is gone"
    " where a side wind has carried the wake off the follower (McAuliffe and others, SAE 2020-01-0679, on"
    " real traffic and cross wind); side winds and sizes are chosen here",
    ranges={
        "saving": (0.45, 0.7),
        "reach_m": (80.0, 170.0),
        "side_mps": (0.5, 2.5),
        "wide_m": (2.2, 4.5),
    },
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class WakeBlownAside(Hidden):
    """The farther the leader, the less side wind it takes."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(402), self.setting.batch
        slots = int(self.setting.duration_s / 0.5) + 6
        mean = rng.normal(0.0, 1.0, (batch, 1))
        self.side = self.p.side_mps * (mean + 0.6 * ou_series(rng, (batch, slots), 0.5, 20.0))

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        at = min(int(view.time / self.setting.dt), self.setting.leader_m.shape[1] - 1)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e5)
        near = np.log(p.reach_m / np.clip(gap, 6.0, p.reach_m)) / np.log(p.reach_m / 6.0)
        side = self.side[:, min(int(view.time / 0.5), self.side.shape[1] - 1)]
        carried = np.minimum(gap, 300.0) * side / np.maximum(view.speed, 5.0)
        return p.saving * near / (1.0 + (carried / p.wide_m) ** 4) * view.drag_force


@hidden(
    "empty_open_body",
    name="drag_area",
    forms="fifth",
    source="Storms, Salari and Babb, Fuel Savings and Aerodynamic Drag Reduction from Rail Car Covers, NASA"
    " TM-2008-214583: an empty open body has far more drag than a full or a covered one; the cavity begins"
    " to breathe above a speed (Rossiter, ARC R&M 3438, 1964); sizes of tippers, chosen here",
    ranges={
        "gain": (0.28, 0.5),
        "breathes": (0.1, 0.45),
        "from_mps": (12.0, 17.0),
        "rolled_back": (0.3, 0.6),
    },
    needs=("highway", "hills"),
    accepts=("headwind", "rolling_resistance_speed"),
)
class EmptyOpenBody(Hidden):
    """Empty on the way back, and on some ways out. The simulator knows the truck with its sheet drawn."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(403), self.setting.batch
        empty = (self.setting.direction < 0) | (rng.random(batch) < self.p.rolled_back)
        empty[batch - 1] = True
        self.empty = empty * rng.uniform(0.85, 1.1, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"breath": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        # it starts at a speed and stops a little below
        begins = p.from_mps - 1.5 * (s.breath > 0.5)
        s.breath += dt * ((view.speed > begins) - s.breath) / 2.0
        return -self.empty * (p.gain + p.breathes * s.breath) * view.drag_force
