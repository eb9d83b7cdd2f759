"""Hidden effects between tyre and road."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, ou_series, place, weight
from deeptruck_model.trucks import View


@hidden(
    "rolling_resistance_speed",
    source="Gillespie, Fundamentals of Vehicle Dynamics (1992), Stuttgart formula: growth with the power"
    " 2.5 of speed",
    ranges={"at_100mph": (0.012, 0.030), "power": (2.3, 2.6)},
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class SpeedGrowth(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        growth = self.p.at_100mph * np.maximum(view.speed / 44.7, 0.0) ** self.p.power
        return -growth * weight(view)


@hidden(
    "rolling_resistance_warmup",
    source="Nielsen and Sandberg, A New Model for Rolling Resistance of Pneumatic Tires, SAE 2002-01-1200:"
    " loss falls as the tyre warms; two thermal bodies, as the tread warms first, are chosen here",
    ranges={
        "cold_gain": (0.9, 2.2),
        "tread_s": (40.0, 90.0),
        "carcass_s": (150.0, 420.0),
        "split": (0.3, 0.6),
    },
    accepts=(),
)
class ColdTyres(Hidden):
    """Every drive starts at its own degree of cold (a pause of unknown length)."""

    def prepare(self) -> None:
        self.cold = self.setting.rng(3).uniform(0.35, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"tread": self.cold.copy(), "carcass": self.cold.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        working = 0.15 + np.clip(view.speed / 20.0, 0.0, 1.3)
        s.tread += dt * (0.6 * s.carcass - s.tread) * working / p.tread_s
        s.carcass -= dt * s.carcass * working / p.carcass_s
        share = p.split * np.maximum(s.tread, 0.0) + (1.0 - p.split) * s.carcass
        return -p.cold_gain * share * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "road_surface",
    source="Hammarström, Eriksson, Karlsson and Yahya, VTI rapport 748A (2012): rolling resistance with"
    " texture and, growing with speed, with roughness; the sizes are those of gravel and snow, chosen here",
    ranges={"texture": (0.003, 0.010), "roughness": (0.0001, 0.0004), "share_of_road": (0.25, 0.5)},
    accepts=("road_grade",),
)
class RoughStretches(Hidden):
    """Stretches of 250 to 900 m, the same whenever and whichever way the road is driven."""

    def prepare(self) -> None:
        rng = self.setting.rng(4)
        self.step_m, length = 5.0, 60000.0
        routes = int(self.setting.route.max()) + 1
        self.rough = np.zeros((routes, int(length / self.step_m)))
        for row in self.rough:
            at = 0.0
            while at < length:
                at += rng.uniform(250.0, 900.0) * (1.0 - self.p.share_of_road) / self.p.share_of_road
                end = at + rng.uniform(250.0, 900.0)
                row[int(at / self.step_m) : int(end / self.step_m)] = rng.uniform(0.6, 1.0)
                at = end

    def newtons(self, view: View, dt: float) -> Array:
        cell = (place(self.setting, view) / self.step_m).astype(int) % self.rough.shape[1]
        severity = self.rough[self.setting.route, cell]
        extra = self.p.texture + self.p.roughness * np.maximum(view.speed - 5.0, 0.0)
        return -severity * extra * weight(view) * moving(view)


@hidden(
    "wheel_slip",
    source="Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme (1993): friction c1(1-exp(-c2 s)) - c3 s"
    " on snow and wet"
    " ice, with a driven wheel that spins up and catches again",
    ranges={"c1": (0.12, 0.22), "c3": (0.02, 0.06), "share_of_time": (0.1, 0.35)},
    needs=("suburban", "hills"),
)
class SlipperyRoad(Hidden):
    def prepare(self) -> None:
        rng = self.setting.rng(5)
        noise = ou_series(rng, (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 25.0)
        self.slippery = noise < np.quantile(noise, self.p.share_of_time)

    def start(self, batch: int) -> dict[str, Array]:
        return {"slip": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        here = self.slippery[:, min(int(view.time), self.slippery.shape[1] - 1)]
        load = self.truck.drive_axle_share * weight(view)
        friction = p.c1 * (1.0 - np.exp(-40.0 * np.maximum(s.slip, 0.02))) - p.c3 * s.slip
        grip = np.maximum(friction, 0.03) * load
        pull = np.maximum(view.traction_force, 0.0)
        s.slip = np.clip(s.slip + dt * (pull - grip) / (0.04 * weight(view)), 0.0, 1.0)
        lost = np.maximum(pull - grip, 0.0)
        brake_lost = np.maximum(
            view.brake_force - 1.15 * p.c1 * weight(view), 0.0
        )  # anti-lock keeps near the peak
        return np.where(here, brake_lost * moving(view) - lost, 0.0)
