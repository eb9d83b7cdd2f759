"""Air that traffic drags along, shutters behind a leader, and wind from the side."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("q_traffic_drags_the_air", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(
    most_mps=(7.0, 11.0), along=(0.35, 0.7), dies_s=(4.0, 12.0), platoon_s=(14.0, 40.0), pause_s=(15.0, 45.0)
)
class TrafficDragsTheAir(Hidden, against=0.0, behind=0.0):
    """`against`, `behind`: share of the air that platoons have set in motion, those who come the other way
    and those who drive ahead. It is there at once and dies away after the last of them. most_mps: of the
    wind against, at 20 m/s; along: of that, from the own lane.
    Source: Eskridge and Hunt, Highway Modeling, Part I: Prediction of Velocity and Turbulence Fields in the
    Wake of Vehicles, J. Applied Meteorology 18 (1979); a narrow road, platoons and sizes are chosen here."""

    def prepare(self) -> None:
        rng, on = self.rng(1501), (0.5 * self.p.platoon_s, 1.5 * self.p.platoon_s)
        off = (0.5 * self.p.pause_s, 1.5 * self.p.pause_s)
        self.come = spells(rng, self.setting.batch, on, off)
        self.lead = spells(rng, self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        come, lead = within(self.come, view.time), within(self.lead, view.time)
        s.against = eased(s.against, come, np.where(come > s.against, 1.5, p.dies_s), dt)
        s.behind = eased(s.behind, lead, np.where(lead > s.behind, 4.0, p.dies_s), dt)
        pace = 0.3 + 0.7 * np.clip(view.speed / 20.0, 0.0, 1.3)
        wind = p.most_mps * pace * (s.against - p.along * s.behind)
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 3.0), 0.0, 3.0)
        return -(relative**2 - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("q_shutters_behind_the_leader", needs="highway", name="drafting", accepts="drag_area", leader=True)
@sizes(most=(0.7, 0.92), reach_m=(45.0, 90.0), starves=(0.5, 0.85), heats_s=(20.0, 50.0), opens_s=(3.0, 9.0))
class ShuttersBehindTheLeader(Hidden, wants=0.0, open=0.0):
    """`hot`: the radiator, that lacks air close behind a leader. At 1 the shutters of the grille open and the
    fan comes in, and most of what the leader's wake saves is gone until it is cool again. most: of the drag,
    saved right behind him; starves: of the air, that the radiator lacks there.
    Source: Lammert and others, Effect of Platooning on Fuel Consumption of Class 8 Vehicles Over a Range of
    Speeds, Following Distances, and Mass, SAE 2014-01-2438, on close following and cooling fans; shutters,
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1502).uniform(0.3, 0.95, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.0, 1e4)
        near = 1.0 / (1.0 + (gap / p.reach_m) ** 2)
        air = (1.0 - p.starves * near) * np.clip(view.speed / 22.0, 0.1, 1.3)
        gains = 0.3 + np.clip(self.power_share(view), 0.0, 1.0)
        cools = 0.2 + air * (0.6 + 0.8 * s.open)
        s.hot = np.clip(eased(s.hot, gains / cools, p.heats_s / cools, dt), 0.0, 2.0)
        s.wants = np.where(s.hot > 1.0, 1.0, np.where(s.hot < 0.8, 0.0, s.wants))
        s.open = eased(s.open, s.wants, p.opens_s, dt)
        return p.most * near * (1.0 - 0.8 * s.open) * view.drag_force * moving(view)


@law("q_wind_turns_the_stream", needs="highway hills suburban", name="drag_area", accepts="headwind")
@sizes(
    aside_mps=(6.0, 9.5), rise=(0.45, 0.8), stalls=(0.16, 0.24), gusts_s=(12.0, 40.0), mean_m=(300.0, 1200.0)
)
@sizes(open=(0.55, 0.75))
class WindTurnsTheStream(OnRoad, felt=0.0):
    """Wind from the side meets a box on wheels at an angle, and its drag rises with that angle until the flow
    along the far side has broken away. So slow driving does not help; walls and woods do. rise: of the drag,
    at most; stalls: radians where most of that is there; open: share of the road.
    Source: SAE J1252, Wind Tunnel Test Procedure for Trucks and Buses, on drag averaged over yaw angles; wind
    without a part along the road, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1503)
        self.road = windows(rng, self.rows(), self.p.mean_m, self.p.open)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.gusts = 1.0 + 0.35 * ou_series(rng, shape, 1.0, self.p.gusts_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gust = np.clip(self.gusts[:, index(view, self.gusts)], 0.2, 2.0)
        s.felt = eased(s.felt, gust * (0.1 + 0.9 * self.between(self.road, view)), 1.0, dt)
        speed, aside = np.maximum(view.speed, 1.0), p.aside_mps * s.felt
        angle = np.arctan2(aside, speed) / p.stalls
        more = (1.0 + (aside / speed) ** 2) * (1.0 + p.rise * np.tanh(angle**2)) - 1.0
        return -more * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
