"""Snow that slides off the roof, straps that work loose, and a casualty that turns its gearbox."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("q_snow_slides_off_the_roof", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(
    most=(0.16, 0.26),
    falls_s=(60.0, 150.0),
    holds_mps2=(0.6, 1.3),
    slides_s=(0.8, 2.5),
    blows_mps=(17.0, 23.0),
)
class SnowSlidesOffTheRoof(Hidden):
    """`snow` on long roofs, 1 at most. It falls in showers, and more of it stays while one drives slowly. The
    wind of driving takes it away, and firm braking lets it slide off at once. most: of the
    mass, wet and deep; holds_mps2: of braking, that it bears.
    Source: ISO 4355, Bases for Design of Structures, Determination of Snow Loads on Roofs, on exposure and
    sliding, and police advice to clear truck roofs of snow and ice; sizes are chosen here."""

    def prepare(self) -> None:
        self.showers = spells(self.rng(1551), self.setting.batch, (40.0, 120.0), (40.0, 120.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"snow": self.rng(1552).choice([0.0, 0.3, 0.8, 1.0, 1.0], batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        slides = np.clip((-view.acceleration - p.holds_mps2) / 0.2, 0.0, 1.0) / p.slides_s
        blows = np.clip((view.speed - p.blows_mps) / 3.0, 0.0, 1.0) / 60.0
        lies = np.clip(1.3 - view.speed / 18.0, 0.1, 1.0)
        falls = within(self.showers, view.time) * lies * (1.0 - s.snow) / p.falls_s
        s.snow = np.clip(s.snow + dt * (falls - s.snow * (slides + blows)), 0.0, 1.0)
        return -p.most * s.snow * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("q_straps_work_loose", needs="suburban", name="load_slosh")
@sizes(share=(0.35, 0.55), omega=(2.2, 3.6), rubs_mps2=(0.08, 0.2), loosens=(0.25, 0.6), most_m=(0.4, 0.8))
@sizes(damps=(0.05, 0.14))
class StrapsWorkLoose(Hidden, x=0.0, v=0.0, slack=0.04):
    """`x` m of a load that stands on its own wheels between straps, `v` of that; `slack` m that the straps
    give before they hold. Each time it runs into them they give a little more, so that it runs ever further
    before it is caught. share: of the mass; omega: rad/s, held; loosens: of the speed, as m of slack in a
    second; most_m: of slack.
    Source: VDI 2700, Securing of Loads on Road Vehicles, part 8 on cars, and EN 12195-1 on straps that lose
    their tension; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        before, over = s.v, np.abs(s.x) - s.slack
        caught = over > 0.0
        stiff = np.where(caught, p.omega**2, 0.0)
        push = stiff * np.maximum(over, 0.0) * np.sign(s.x)
        rubs = p.rubs_mps2 * np.tanh(s.v / 0.05)
        damps = np.where(caught, 2.0 * p.damps * p.omega, 0.1)
        s.v = np.clip((s.v - dt * (felt + push + rubs)) / (1.0 + dt * damps + dt * dt * stiff), -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -1.5, 1.5)
        s.slack = np.minimum(s.slack + dt * p.loosens * np.abs(s.v) * caught, p.most_m)
        pace = np.clip((s.v - before) / dt, -4.0, 4.0)
        return -p.share * view.mass * pace * moving(view)


@law("q_casualty_turns_its_gearbox", needs="suburban hills", name="unknown")
@sizes(thick=(0.005, 0.009), runs_dry=(0.006, 0.012), warms_s=(40.0, 120.0), dries_m=(300.0, 1200.0))
@sizes(wets_s=(4.0, 15.0))
class CasualtyTurnsItsGearbox(Hidden, warm=0.0):
    """A broken truck is towed with its propeller shaft in place. Its gearbox turns backwards with cold oil,
    which grows thin; but without the countershaft nothing is splashed, bearings run `dry` over the way, and
    they rub until a stand lets oil flow back. thick, runs_dry: of the weight, the first at 20 m/s.
    Source: Eaton Fuller, heavy duty transmissions, Driver Instructions, on towing: pull the axle shafts or
    take off the propeller shaft, or the gearbox runs without oil; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "dry": self.rng(1553).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pace = np.minimum(speed / 20.0, 1.4)
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.1 + pace), dt)
        wets = np.clip(1.0 - speed / 2.0, 0.0, 1.0) / p.wets_s
        s.dry = np.clip(s.dry + dt * (speed / p.dries_m * (1.0 - s.dry) - wets * s.dry), 0.0, 1.0)
        costs = p.thick * (1.0 - 0.75 * s.warm) * pace + p.runs_dry * s.dry**1.5
        return -costs * weight(view) * moving(view)
