"""Heights by the barometer, bitumen that bleeds, and kerbs that guide."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import CELL_M, OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("v_heights_by_the_barometer", needs="hills descent", name="road_grade", gateable=False)
@sizes(spread=(0.12, 0.22), mean_m=(700.0, 2500.0), drifts=(0.001, 0.003), sign=(-1.0, 1.0))
class HeightsByTheBarometer(OnRoad):
    """The map's heights were read from a barometer, day after day. Cold days had denser air than was thought
    and warm ones thinner, so a day's slopes are all too steep or too flat by one share; and weather that
    changed during the day tilts all of it. spread: of the slope, between days; drifts: of slope, likewise.
    Source: Saastamoinen, Atmospheric Correction for the Troposphere and Stratosphere (1972), on heights by
    pressure and temperature, and Bomford, Geodesy (1980), on barometric heighting; large shares, sizes are
    chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1661), self.p
        number = sections(rng, self.rows(), p.mean_m)
        shape = (self.rows(), int(number.max()) + 2)
        turns = np.sign(p.sign) * np.where(np.arange(shape[1]) % 2, -1.0, 1.0)
        share = turns * rng.uniform(0.5, 1.0, shape)
        tilt = rng.uniform(-1.0, 1.0, shape)
        ease = np.hanning(11) / np.hanning(11).sum()
        rows = [np.take_along_axis(part, number, axis=1) for part in (share, tilt)]
        self.share, self.tilt = (np.array([np.convolve(r, ease, mode="same") for r in part]) for part in rows)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilt = p.drifts * self.setting.direction * self.read(self.tilt, view)
        slope = p.spread * self.read(self.share, view) * view.grade + tilt
        return -slope * weight(view) * moving(view)


@law("v_bitumen_bleeds", needs="suburban hills highway", name="road_surface", accepts="rolling_resistance")
@sizes(
    most=(0.006, 0.01), power=(0.3, 0.5), mean_m=(150.0, 700.0), sunny=(0.3, 0.55), cleans_m=(150.0, 600.0)
)
@sizes(clouds_s=(40.0, 120.0))
class BitumenBleeds(OnRoad, coat=0.0):
    """`coat` of binder that tyres have picked up where the sun makes it bleed out of the road. They have to
    be peeled off it, which costs with a small power of speed; behind the patch the coat still clings to clean
    road, until it has worn off. Clouds cool it. most: of the weight, at 15 m/s; sunny: of the road.
    Source: Gent and Petrich, Adhesion of Viscoelastic Materials to Rigid Substrates, Proc. R. Soc. A 310
    (1969), on peeling with a power of speed, and Lesueur, The Colloidal Structure of Bitumen (2009); sizes
    are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1662)
        self.road = windows(rng, self.rows(), self.p.mean_m, self.p.sunny)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.sun = 0.75 + 0.25 * np.tanh(2.0 * ou_series(rng, shape, 1.0, self.p.clouds_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, bleeds = np.maximum(view.speed, 0.0), self.between(self.road, view)
        s.coat = eased(
            s.coat, bleeds, np.where(bleeds > s.coat, 30.0, p.cleans_m) / np.maximum(speed, 1e-3), dt
        )
        tack = self.sun[:, index(view, self.sun)] * (0.65 * bleeds + 0.35 * s.coat)
        return -p.most * tack * np.minimum(speed / 15.0, 1.8) ** p.power * weight(view) * moving(view)


@law("v_guided_by_kerbs", needs="suburban hills highway", name="unknown")
@sizes(
    rubs=(0.004, 0.006), presses=(0.007, 0.012), play=(0.4, 0.9), sways_m=(60.0, 200.0), long_m=(300.0, 900.0)
)
@sizes(share=(0.4, 0.65))
class GuidedByKerbs(OnRoad, inside=0.0):
    """Between kerbs that guide it a truck leans on small wheels at its sides. Their springs always press a
    little, and where the kerbs sway the truck is pushed across its own way, first on one side and then on
    the other. Outside nothing rubs. rubs: of the weight, all along; presses: of it, where the kerbs sway by
    the usual amount beyond `play`; sways_m: how far a sway reaches.
    Source: Guided bus lanes as in Essen and Adelaide (Wilson, The Adelaide O-Bahn, 1989), on guide wheels
    and preload against kerbs; worn kerbs, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1663), self.p
        self.road = windows(rng, self.rows(), p.long_m, p.share)
        self.sway = np.abs(ou_series(rng, (self.rows(), 12000), CELL_M, p.sways_m))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.inside = eased(s.inside, self.between(self.road, view), 0.6, dt)
        over = np.clip(self.read(self.sway, view) - p.play, 0.0, 2.0)
        return -s.inside * (p.rubs + p.presses * over) * weight(view) * np.clip(view.speed, 0.0, 1.0)
