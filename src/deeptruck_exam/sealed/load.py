"""Loads that come, go and move; what pulls at the truck from outside."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("s_chaser_bin", "sealed", "suburban hills", name="payload_change", accepts="mass")
@sizes(load=(0.35, 0.55), known=(0.3, 0.7), fills_m=(400.0, 1200.0), empties_s=(10.0, 30.0))
class ChaserBin(OnRoad):
    """It is filled on the way along fields, and emptied where it stands. load: of the mass.
    Source: Bochtis and Sørensen, The Vehicle Routing Problem in Field Logistics, Biosystems Engineering 104
    (2009): transport units are loaded under way and emptied at rest; sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(811)
        self.fields = windows(rng, self.rows(), 700.0, 0.5)
        self.first = rng.uniform(0.0, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"bin": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        fills = self.between(self.fields, view) * speed / p.fills_m
        s.bin = np.clip(s.bin + dt * np.where(speed < 0.2, -1.0 / p.empties_s, fills), 0.0, 1.0)
        more = p.load * (s.bin - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@hidden("s_cattle_step", "sealed", "suburban", name="load_slosh")
@sizes(share=(0.3, 0.55), hz=(0.3, 0.6), damping=(0.06, 0.2), stiffens=(2.0, 10.0))
class CattleStep(Hidden, way=0.0, rate=0.0):
    """share: of the mass. They lean softly at first, then against each other. stiffens: 1/m2.
    Source: Tarrant, Transportation of Cattle by Road, Applied Animal Behaviour Science 28 (1990): standing
    animals sway and step with braking; a hardening spring (Duffing), sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        spring = omega**2 * s.way * (1.0 + p.stiffens * s.way**2)
        driven = -spring - 2.0 * p.damping * omega * s.rate - np.clip(view.acceleration, -4.0, 4.0)
        s.rate = s.rate + dt * driven
        s.way = np.clip(s.way + dt * s.rate, -1.0, 1.0)
        return -p.share * view.mass * np.clip(driven, -4.0, 4.0) * moving(view)


@hidden("s_winch_assist", "sealed", "hills", name="unknown")
@sizes(tension=(0.012, 0.028), from_slope=(0.008, 0.02), winds_s=(1.0, 4.0), slack_m=(20.0, 80.0))
class WinchAssist(Hidden, on=0.0, taken=0.0, tight=0.0):
    """tension: of the weight, while it climbs. The rope is taken up over the way first.
    Source: Visser and Stampfer, Expanding Ground-Based Harvesting onto Steep Terrain, Croatian Journal of
    Forest Engineering 36 (2015): a winch uphill holds a set tension; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        below = view.grade < 0.4 * p.from_slope
        s.on = np.where(view.grade > p.from_slope, 1.0, np.where(below, 0.0, s.on))
        rolled = dt * np.maximum(view.speed, 0.0)
        s.taken = np.where(s.on > 0.0, np.minimum(s.taken + rolled / p.slack_m, 1.0), 0.0)
        s.tight = s.tight + dt * ((s.taken >= 1.0) - s.tight) / p.winds_s
        return p.tension * s.tight * weight(view) * np.clip(view.speed - 0.5, 0.0, 1.0)


@hidden("s_pays_out_cable", "sealed", "suburban", name="unknown")
@sizes(most=(0.014, 0.028), way_m=(80.0, 260.0), cut_s=(1.0, 3.0))
class PaysOutCable(Hidden, out=0.0, stood=0.0):
    """most: of the weight. It drags the more the longer the way since the last stand.
    Source: A cable that is laid slides behind the truck with friction along its length (Buehler and others,
    Guide for cable pulling, IEEE Std 1185, on pulling tension); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        rolled = dt * np.maximum(view.speed, 0.0)
        s.out = np.where(s.stood > p.cut_s, 0.0, s.out + (1.0 - s.out) * rolled / p.way_m)
        return -p.most * s.out * weight(view) * moving(view)
