"""A crew that gets on and off, pallets that shunt, and branches that brush the hedges."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
STANDS = 89  # throws of dice for each drive


@law("v_crew_gets_on_and_off", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(most=(0.14, 0.24), stays_s=(1.5, 3.5), boards_s=(1.0, 3.0), change=(0.6, 0.95))
class CrewGetsOnAndOff(Hidden, still=0.0):
    """`crew`: of the mass, people and tools that are there beyond what was said, or fewer. At each stand some
    get off and others on, as long as it lasts; on the way nothing changes. most: of the mass, to either
    side; stays_s: of a stand, before doors open; change: how much of a change one stand may be.
    Source: TRB, Transit Capacity and Quality of Service Manual (TCRP Report 165, 2013), on boarding at
    stops; crews of a harvest with their crates, sizes are chosen here."""

    def prepare(self) -> None:
        self.dice = self.rng(1651).uniform(-1.0, 1.0, (self.setting.batch, STANDS))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.dice[:, 0], batch)
        return {
            **super().start(batch),
            "crew": np.sign(first) * np.abs(first) ** 0.4,
            "stands": np.ones(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        opens = (before <= p.stays_s) & (s.still > p.stays_s)
        s.stands = np.where(opens, (s.stands + 1.0) % STANDS, s.stands)
        row = np.arange(len(view.speed)) % len(self.dice)
        wants = np.sign(self.dice[row, s.stands.astype(int)]) * p.change + (1.0 - p.change) * s.crew
        s.crew = np.where(s.still > p.stays_s, eased(s.crew, wants, p.boards_s, dt), s.crew)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.crew * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("v_pallets_shunt", needs="suburban", name="load_slosh")
@sizes(share=(0.3, 0.5), gap_m=(0.2, 0.45), rubs=(0.015, 0.035), omega=(7.0, 12.0), dull=(0.15, 0.35))
class PalletsShunt(Hidden, a=0.0, b=0.0, c=0.0, va=0.0, vb=0.0, vc=0.0):
    """`a`, `b`, `c` m: of three rows of pallets on rollers, one behind the other, with room between them and
    before both walls; `va`, `vb`, `vc` of that. The last row runs into the next, and so on to the wall, as
    waggons are shunted: one push of the driver comes back as several blows. share: of the mass, all three;
    gap_m: of room, at each side of a row; rubs: of their weight; omega: rad/s of a touch; dull: of critical
    damping.
    Source: Cole, A Handbook of Vehicle-Track Dynamics (2006), on slack between waggons in trains, and VDI
    2700 on loads with gaps between them; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        zero = np.zeros_like(felt)
        at, pace = np.stack([zero, s.a, s.b, s.c, zero]), np.stack([zero, s.va, s.vb, s.vc, zero])
        near = np.diff(at, axis=0)  # how far rows have parted; they touch at -gap_m
        over = np.maximum(-near - p.gap_m, 0.0)
        shut = np.clip(np.diff(pace, axis=0) * -1.0, 0.0, None) * (over > 0.0)
        presses = p.omega**2 * over + 2.0 * p.dull * p.omega * shut
        rubs = p.rubs * GRAVITY * np.tanh(pace[1:4] / 0.04)
        gains = -felt - rubs + presses[:3] - presses[1:]
        after = np.clip(pace[1:4] + dt * gains, -2.0, 2.0)
        mean = (after - pace[1:4]).mean(axis=0) / dt
        s.va, s.vb, s.vc = after
        s.a, s.b, s.c = (np.clip(x + dt * v, -1.5, 1.5) for x, v in zip(at[1:4], after, strict=True))
        return -p.share * view.mass * np.clip(mean, -4.0, 4.0) * moving(view)


@law("v_branches_brush_the_hedges", needs="suburban hills descent", name="unknown")
@sizes(
    most=(0.014, 0.024), apart_m=(80.0, 260.0), long_m=(120.0, 500.0), bends_mps=(3.0, 8.0), strips=(0.3, 0.7)
)
@sizes(strips_m=(400.0, 1500.0))
class BranchesBrushTheHedges(OnRoad, stripped=0.0):
    """A load of branches, wider than the lane, brushes along hedges and banks of sunken lanes. Twigs hold it
    hardest at a crawl, where they hook, and bend aside at speed; the way strips the load of what sticks out.
    most: of the weight, at a crawl between the thickest hedges; strips: of what sticks out, lost in the end;
    bends_mps: where half of the hooks let go.
    Source: Vogel, Drag and Reconfiguration of Broad Leaves in High Winds, J. Experimental Botany 40 (1989),
    on branches that fold under force, and forest services on loads of brash; sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.apart_m, 1.6 * p.apart_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.road = smooth_stretches(self.rng(1652), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, hedge = np.maximum(view.speed, 0.0), np.sqrt(self.read(self.road, view))
        s.stripped = eased(s.stripped, 1.0, p.strips_m / np.maximum(speed * hedge, 1e-3), dt)
        hooks = 0.55 + 0.45 / (1.0 + (speed / p.bends_mps) ** 2)
        return -p.most * hedge * hooks * (1.0 - p.strips * s.stripped) * weight(view) * moving(view)
