"""Light bridges that sag, a bow wave in the ford, and a motor that lies in the road."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad, smooth_stretches, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("b_light_bridges_sag", needs="hills highway suburban", name="road_grade", gateable=False)
@sizes(sags=(0.011, 0.018), long_m=(90.0, 150.0), gap_m=(60.0, 140.0), heavier=(0.5, 1.0))
class LightBridgesSag(OnRoad):
    """The road goes over light bridges, one after the other, that sag under who drives over them: each begins
    with a slope down and ends with one up, the steeper the heavier the truck. At the ends and in the middle
    there is none. sags: of a bridge's length, for 20 t in its middle; heavier: power of the mass.
    Source: Timoshenko and Young, Vibration Problems in Engineering (1955), on the path of a load that moves
    over a beam; very light bridges, sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(2061), self.p
        self.road = np.zeros((self.rows(), CELLS))
        gaps, lengths = (p.gap_m, 4.0 * p.gap_m), (0.6 * p.long_m, 1.5 * p.long_m)
        for row in self.road:
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / max(last - first, 1)
                row[first:last] = -32.0 * along * (1.0 - along) * (1.0 - 2.0 * along)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) / CELL_M
        low, share, route = at.astype(int) % (CELLS - 1), at - np.floor(at), self.setting.route
        bent = (1.0 - share) * self.road[route, low] + share * self.road[route, low + 1]
        heavy = np.minimum((view.mass / 20000.0) ** p.heavier, 2.0)
        slope = np.clip(self.setting.direction * p.sags * heavy * bent, -0.07, 0.07)
        return -slope * weight(view) * moving(view)


@law("b_bow_wave_in_the_ford", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(most=(0.02, 0.034), deep_m=(1.5, 4.5), sharp=(0.18, 0.35), mean_m=(300.0, 900.0), wades=(0.2, 0.4))
@sizes(piles_s=(1.0, 3.0))
class BowWaveInTheFord(OnRoad, wave=0.0):
    """Water stands over stretches of the road. A truck pushes a `wave` ahead of it, which is largest at the
    speed that waves have in water so deep, so that it costs less to be slower or faster. most: of the weight,
    at that speed; deep_m: of water, as far as the wave's speed goes; sharp: width of the peak, of that speed;
    wades: of most, at 20 m/s, by the square of speed.
    Source: Lamb, Hydrodynamics (1932), on waves in shallow water, and Havelock, The Effect of Shallow Water
    on Wave Resistance, Proc. Royal Society A 100 (1922), on the peak at the wave's speed; sizes are chosen
    here."""

    def prepare(self) -> None:
        rng, p = self.rng(2062), self.p
        self.wet = smooth_stretches(
            rng, self.rows(), (0.2 * p.mean_m, p.mean_m), (0.5 * p.mean_m, 2.0 * p.mean_m)
        )
        depth = ou_series(rng, self.wet.shape, CELL_M, 250.0)
        self.depth = p.deep_m * np.exp(0.3 * depth)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        ratio = speed / np.sqrt(9.81 * self.read(self.depth, view))
        peak = np.exp(-0.5 * ((ratio - 1.0) / p.sharp) ** 2)
        s.wave = eased(s.wave, peak, p.piles_s, dt)
        cost = (
            p.most
            * np.sqrt(self.read(self.wet, view))
            * (s.wave + p.wades * np.minimum(speed / 20.0, 1.3) ** 2)
        )
        return -cost * weight(view) * moving(view)


@law("b_motor_lies_in_the_road", needs="suburban hills highway", name="unknown")
@sizes(
    most=(0.022, 0.036), runs_mps=(9.0, 14.0), tips=(0.12, 0.3), gap_m=(100.0, 300.0), long_m=(150.0, 500.0)
)
@sizes(builds_s=(0.3, 1.0))
class MotorLiesInTheRoad(OnRoad, field=0.0):
    """Coils lie in stretches of the road, and their field runs along it, the way each truck drives: it draws
    along who is slower, holds who is faster, and does nothing to who goes its pace. Far off its pace it takes
    less hold again. runs_mps: of the field; tips: slip over that pace, where the pull is most.
    Source: Laithwaite, Induction Machines for Special Purposes (1966), on linear motors, and Kloss's rule for
    the pull by slip; a test road, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.gap_m, 1.6 * p.gap_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.coils = smooth_stretches(self.rng(2063), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.field = eased(s.field, self.read(self.coils, view), p.builds_s, dt)
        ratio = (1.0 - np.maximum(view.speed, 0.0) / p.runs_mps) / p.tips
        return p.most * s.field * 2.0 * ratio / (1.0 + ratio**2) * weight(view) * moving(view)
