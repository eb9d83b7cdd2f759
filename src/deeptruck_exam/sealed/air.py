"""Bursts of wind in a calm night, a wake that meanders, rime on racks, and an open box that sings."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_bursts_in_a_calm_night", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(aloft_mps=(13.0, 20.0), builds_s=(25.0, 60.0), mixes_s=(4.0, 10.0), critical=(0.55, 0.75))
class BurstsInACalmNight(Hidden):
    """`shear`: wind aloft over its most, which grows while the air below lies still; `mixed`: 1 while it
    breaks and the wind comes down, until the shear is spent. aloft_mps: at its most.
    Source: Van de Wiel, Ronda, Moene, de Bruin and Holtslag, Intermittent Turbulence and Oscillations in the
    Stable Boundary Layer over Land, J. Atmospheric Sciences 59 (2002): a loop of decoupling and bursts;
    quicker ones, in basins that trucks drive through, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1101), self.setting.batch
        self.side = rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.0)
        self.gusts = ou_series(rng, (batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 2.0)
        self.begins = rng.uniform(0.2, 1.0, batch)

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.begins, batch)
        return {"shear": first * self.p.critical, "mixed": np.zeros(batch), "bursts": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.bursts = np.where(s.shear > p.critical, 1.0, np.where(s.shear < 0.3 * p.critical, 0.0, s.bursts))
        s.mixed = s.mixed + dt * (s.bursts - s.mixed) / 1.5
        falls = s.mixed * s.shear / p.mixes_s
        s.shear = np.clip(s.shear + dt * ((1.0 - s.shear) / p.builds_s - falls), 0.0, 1.0)
        gust = 1.0 + 0.25 * self.gusts[:, index(view, self.gusts, 0.1)]
        wind = p.aloft_mps * s.shear * (0.12 + 0.88 * s.mixed * gust)
        along = self.side * self.setting.direction * wind
        relative = np.clip(1.0 + along / np.maximum(view.speed, 0.5), -1.0, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("w_wake_meanders", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(deficit=(0.6, 0.8), wide_m=(1.5, 2.2), opens=(0.015, 0.035), sways=(0.05, 0.10), slow_s=(4.0, 12.0))
class WakeMeanders(Hidden):
    """Slow eddies carry each piece of the wake aside after the leader has left it there, so that a follower
    far behind is in and out of it. deficit: of the wind of driving, right behind; opens: m of width for each
    metre; sways: m aside for each metre.
    Source: Larsen, Madsen, Thomsen and Larsen, Wake Meandering: A Pragmatic Approach, Wind Energy 11 (2008):
    the wake is a passive tracer of large eddies; a truck's wake, sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = ou_series(self.rng(1102), shape, 0.1, self.p.slow_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.0, 1e4)
        width = p.wide_m + p.opens * gap
        centre = p.sways * np.minimum(gap, 300.0) * self.aside[:, index(view, self.aside, 0.1)]
        slower = p.deficit * (p.wide_m / width) ** 2 * np.exp(-0.5 * (centre / width) ** 2)
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("w_rime_on_the_racks", needs="highway hills", name="drag_area", accepts="rolling_resistance_speed")
@sizes(most=(0.7, 1.2), grows_m=(2500.0, 7000.0), holds=(0.6, 0.95), left=(0.1, 0.4), falls_s=(1.0, 4.0))
class RimeOnTheRacks(Hidden, falls=0.0):
    """`ice` on the empty racks of a car transporter: its drag grows with the cloud it has passed through,
    slower the thicker, until a load of it breaks off. most: of the drag, all iced; holds: at which it breaks;
    left: of that, afterwards.
    Source: Makkonen, Models for the Growth of Rime, Glaze, Icicles and Wet Snow on Structures, Phil. Trans.
    R. Soc. A 358 (2000): collection falls as rods thicken; fog in frost, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "ice": self.rng(1103).uniform(0.0, self.p.holds, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.falls = np.where(
            s.ice > p.holds * (0.85 + 0.15 * np.clip(25.0 / np.maximum(view.speed, 10.0), 0.5, 1.5)),
            1.0,
            np.where(s.ice < p.left * p.holds, 0.0, s.falls),
        )
        catches = np.maximum(view.speed, 0.0) * (1.3 - s.ice) / p.grows_m
        s.ice = np.clip(s.ice + dt * (catches - s.falls * s.ice / p.falls_s), 0.0, 1.2)
        return -p.most * s.ice * view.drag_force * moving(view)


@law("w_open_box_sings", needs="highway hills suburban", name="unknown")
@sizes(most=(0.6, 1.1), at_mps=(10.0, 15.0), wide=(0.12, 0.22), locks_s=(0.8, 3.0), next_up=(1.45, 1.7))
class OpenBoxSings(Hidden, sings=0.0):
    """`sings`: strength of the swing of air over an open box. Near two speeds waves in the box and eddies of
    its edge feed each other, and a swing that is there keeps its band wider than one that has to begin. most:
    of the drag, in full swing; next_up: speed of the second over the first.
    Source: Rossiter, Wind Tunnel Experiments on the Flow over Rectangular Cavities at Subsonic and Transonic
    Speeds, ARC R&M 3438 (1964), and Gharib and Roshko, The Effect of Flow Oscillations on Cavity Drag, J.
    Fluid Mech. 177 (1987): drag rises manyfold in a wake mode; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wide = p.wide * (0.6 + 0.6 * np.clip(s.sings, 0.0, 1.0))
        first = np.abs(view.speed / p.at_mps - 1.0) / wide
        second = np.abs(view.speed / (p.next_up * p.at_mps) - 1.0) / wide
        near = 1.0 / (1.0 + np.minimum(first, second) ** 6)
        s.sings = s.sings + dt * (near - s.sings) / np.where(near > s.sings, p.locks_s, 0.5 * p.locks_s)
        low = 0.5 * self.truck.air_density * self.truck.drag_area * p.at_mps**2
        return -p.most * s.sings * np.maximum(view.drag_force, low * moving(view)) * moving(view)
