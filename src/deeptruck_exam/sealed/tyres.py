"""A coarse seal, an axle that comes down cold, leaves and sand, and a tyre that rubs its arch."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "k_coarse_seal_works_the_tread",
    needs="highway hills",
    name="rolling_resistance_speed",
    accepts="drag_area",
)
@sizes(most=(0.013, 0.022), power=(0.9, 1.6), mean_m=(400.0, 1500.0), bleeds=(0.2, 0.5), follows_s=(0.5, 2.0))
class CoarseSealWorksTheTread(OnRoad, felt=0.0):
    """Stones of a surface press into the tread and let go again, the oftener, the faster: a coarse seal costs
    with speed, a fine one hardly. Where binder has bled up between the stones of a section, little is left of
    it. most: of the weight, at 20 m/s on the coarsest; bleeds: share of sections.
    Source: MIRIAM, Road Surface Influence on Tyre/Road Rolling Resistance (Sandberg and others, 2011), on
    texture and speed; sections and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1471)
        number = sections(rng, self.rows(), self.p.mean_m)
        shape = (self.rows(), int(number.max()) + 1)
        coarse = rng.uniform(0.3, 1.0, shape) * np.where(rng.random(shape) < self.p.bleeds, 0.15, 1.0)
        self.road = np.take_along_axis(coarse, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = eased(s.felt, self.read(self.road, view), p.follows_s, dt)
        pace = (np.maximum(view.speed, 0.0) / 20.0) ** p.power
        return -p.most * s.felt * pace * weight(view) * moving(view)


@law("k_axle_comes_down_cold", name="rolling_resistance_warmup")
@sizes(
    cold=(0.010, 0.018), warms_s=(20.0, 50.0), cools_s=(25.0, 70.0), down_s=(50.0, 120.0), up_s=(20.0, 60.0)
)
@sizes(left=(0.05, 0.2))
class AxleComesDownCold(Hidden, down=0.0):
    """`warm`: of the tyres of a lift axle. While it is up they cool in the wind, and whenever it is let down
    they cost much until they are warm again. The driver moves it as he likes. cold: of the weight, all cold;
    left: of that, warm.
    Source: Popov, Cole, Winkler and Cebon, Laboratory Measurement of Rolling Resistance in Truck Tyres under
    Dynamic Vertical Load, Proc. IMechE D 217 (2003), on warm-up of truck tyres, and makers' manuals of lift
    axles; quicker tyres, sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.6 * self.p.down_s, 1.4 * self.p.down_s), (0.6 * self.p.up_s, 1.4 * self.p.up_s)
        self.spans = spells(self.rng(1472), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1473).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.down = eased(s.down, within(self.spans, view.time), 1.5, dt)
        pace = 0.2 + np.maximum(view.speed, 0.0) / 15.0
        slow = np.where(s.down > 0.5, p.warms_s, p.cools_s) / pace
        s.warm = eased(s.warm, np.where(s.down > 0.5, 1.0, 0.0), slow, dt)
        costs = p.cold * s.down * (p.left + (1.0 - p.left) * (1.0 - s.warm) ** 1.5)
        return -costs * weight(view) * moving(view)


@law("k_leaves_then_sand", needs="suburban hills", name="wheel_slip")
@sizes(leaves=(0.07, 0.11), sanded=(0.24, 0.32), driven=(0.34, 0.44), waits_s=(0.8, 2.0), lasts_s=(4.0, 12.0))
@sizes(mean_m=(200.0, 600.0), share=(0.5, 0.7), finds_s=(0.15, 0.4))
class LeavesThenSand(OnRoad, lost=0.0, spins=0.0, left=0.0, sand=0.0, store=1.0):
    """Wet leaves lie under the trees. When driven wheels have spun on them for a moment, sand is blown before
    them for some seconds, and they hold; `store` of it is used up in time. leaves, sanded: grip; driven: of
    the weight; share: of the road, with leaves.
    Source: Olofsson and Sundvall, Influence of Leaf, Humidity and Applied Lubrication on Friction in the
    Wheel-Rail Contact, Proc. IMechE F 218 (2004), on films of leaves; sanders of trucks, sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1474), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        slips = s.lost > 0.08 * pull + 1.0
        s.spins = np.where(slips, s.spins + dt, 0.0)
        calls = (s.spins > p.waits_s) & (s.store > 0.0)
        s.left = np.where(calls, p.lasts_s, np.maximum(s.left - dt, 0.0))
        s.store = np.maximum(s.store - dt * (s.left > 0.0) / (6.0 * p.lasts_s), 0.0)
        s.sand = eased(s.sand, np.where(s.left > 0.0, 1.0, 0.0), 0.6, dt)
        most = np.maximum((p.leaves + (p.sanded - p.leaves) * s.sand) * p.driven * weight(view), 1.0)
        asks = pull / most
        over = np.maximum(asks - 0.7, 0.0)
        holds = most * (np.minimum(asks, 0.7) + 0.3 * np.tanh(over / 0.3))
        wish = (pull - holds) * self.between(self.road, view)
        s.lost = eased(s.lost, wish, p.finds_s, dt)
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("k_tyre_rubs_its_arch", needs="suburban hills descent", name="unknown")
@sizes(most=(0.016, 0.03), room=(0.35, 0.6), squats=(0.25, 0.5), leans=(0.4, 0.7), wears_s=(60.0, 200.0))
@sizes(bumps_s=(0.6, 1.5))
class TyreRubsItsArch(Bends, worn=0.0):
    """A tyre too large for its arch touches it when springs give way: in bends, under brakes or pull, and on
    bumps. Rubbing wears the arch away and makes room. most: of the weight; room: of the travel; squats:
    travel for each m/s2 along; leans: for each m/s2 aside.
    Source: Cebon, Handbook of Vehicle-Road Interaction (1999), on travel of truck suspensions, and Archard's
    law of wear in Stachowiak and Batchelor, Engineering Tribology (2013); bends and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1475)
        self.bend = np.abs(self.draw_bends(rng, 0.015))
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.bumps = ou_series(rng, shape, 0.1, self.p.bumps_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        aside = np.minimum(speed**2 * self.read(self.bend, view), 2.0)
        bumps = 0.12 * self.bumps[:, index(view, self.bumps, 0.1)] * np.clip(speed / 15.0, 0.0, 1.2)
        travel = p.squats * np.minimum(np.abs(view.acceleration), 1.5) + p.leans * aside + bumps
        rubs = np.clip(travel - p.room * (1.0 + 0.6 * s.worn), 0.0, 1.0)
        s.worn = np.clip(s.worn + dt * rubs * speed / 15.0 * (1.0 - s.worn) / p.wears_s, 0.0, 1.0)
        return -p.most * np.sqrt(rubs + 1e-4) * (rubs > 0.0) * weight(view) * np.clip(speed, 0.0, 1.0)
