"""Seventh forms of the air: wind round an oval, a wake that takes its time, a cover that fills."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import gap_to_leader, now
from deeptruck_exam.hidden import Array, Hidden, ou_series, place
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View


@law(
    "wind_round_the_oval",
    name="headwind",
    source="SAE J1263, Road Load Measurement and Dynamometer Simulation Using Coastdown Techniques, and"
    " Regulation (EU) 2017/2400, annex VIII: wind is limited and runs are made both ways, because on an oval"
    " it comes from all sides, and drag rises with the angle of yaw",
    # yaw: more drag for each rad squared of yaw
    ranges={"wind_mps": (6.0, 11.0), "yaw": (1.0, 3.0), "round_m": (1400.0, 3200.0), "veers_s": (25.0, 90.0)},
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class WindRoundTheOval(Hidden):
    """Straights and bends follow each other along the way; wind along the road is wind at an angle soon."""

    def prepare(self) -> None:
        rng, one = self.setting.rng(701), self.setting
        self.first = rng.uniform(-np.pi, np.pi)
        slots = int(one.duration_s) + 2
        self.veer = 0.4 * ou_series(rng, (1, slots), 1.0, self.p.veers_s)[0]

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        lap = (place(self.setting, view) / p.round_m) % 1.0
        # half a turn in each bend, a quarter of the lap long
        turned = np.pi * (np.clip(4.0 * lap - 1.0, 0.0, 1.0) + np.clip(4.0 * lap - 3.0, 0.0, 1.0))
        angle = self.first + turned + self.veer[int(view.time) % len(self.veer)]
        along = view.speed + self.setting.direction * p.wind_mps * np.cos(angle)
        across = p.wind_mps * np.sin(angle)
        total = np.hypot(along, across)
        yaw = np.minimum(np.abs(np.arctan2(across, np.maximum(np.abs(along), 1.0))), 0.5)
        area = 0.5 * self.truck.air_density * self.truck.drag_area * (1.0 + p.yaw * yaw**2)
        return (view.drag_force - area * total * along) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law(
    "wake_takes_its_time",
    name="drafting",
    source="Lammert and others, Effect of Platooning on Fuel Consumption of Class 8 Vehicles Over a Range of"
    " Speeds, Following Distances, and Mass, SAE 2014-01-2438: the saving is largest at a middle gap and"
    " less nearer; that air drawn along needs gap over speed to arrive, is chosen here",
    # drawn: of the leader's speed, at the best gap; runs: speed of the wake's eddies over the leader's
    ranges={"drawn": (0.32, 0.55), "best_m": (11.0, 19.0), "narrow": (0.8, 1.6), "runs": (0.3, 0.6)},
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class WakeTakesItsTime(Hidden):
    """The air that is met was drawn along by the leader as fast as he was then."""

    def prepare(self) -> None:
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)

    def newtons(self, view: View, dt: float) -> Array:
        p, one = self.p, self.setting
        gap = np.maximum(gap_to_leader(one, view), 1.0)
        late = gap / np.maximum(p.runs * view.speed, 3.0) / one.dt
        then = np.clip(now(one, view) - np.minimum(late, 200.0), 0.0, None).astype(int)
        leader = np.nan_to_num(self.leader_mps[np.arange(len(gap)), then])
        shape = (gap / p.best_m * np.exp(1.0 - gap / p.best_m)) ** p.narrow
        share = np.clip(p.drawn * shape * leader / np.maximum(view.speed, 2.0), 0.0, 0.7)
        return (1.0 - (1.0 - share) ** 2) * view.drag_force


@law(
    "cover_fills_like_a_canopy",
    name="drag_area",
    source="Knacke, Parachute Recovery Systems Design Manual (1992): a canopy fills within a number of its"
    " lengths at any speed and collapses when its wake overtakes it; a curtain off its rail",
    # gain: of the drag area, filled; slower: m/s2 of slowing at which its wake overtakes it
    ranges={"gain": (0.5, 0.95), "fills_m": (120.0, 420.0), "from_mps": (14.0, 18.0), "slower": (0.16, 0.4)},
    needs=("highway", "hills"),
    accepts=("headwind",),
)
class CoverFillsLikeACanopy(Law, way=0.0, slows=0.0):
    """`way` filled, of fills_m; area with its square."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.slows += dt * (np.clip(view.acceleration, -3.0, 3.0) - s.slows) / 0.8
        fills = (view.speed > p.from_mps) & (s.slows > -p.slower)
        change = np.where(fills, view.speed / p.fills_m, -s.way / 3.0)
        s.way = np.clip(s.way + dt * change, 0.0, 1.0)
        return -p.gain * s.way**2 * view.drag_force
