"""Seventh effects for which no library name exists: what tracks and their test gear do to a truck."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import Array, Hidden, moving, weight
from deeptruck_exam.proving_ground.law import Law, unnamed
from deeptruck_model.trucks import View


@unnamed(
    "towed_dynamometer",
    source="Towing dynamometers of proving grounds (Wong, Theory of Ground Vehicles, on drawbar tests): a"
    " programme of pulls in steps, held by a control on the coupling's force above a speed",
    ranges={"pull": (0.010, 0.022), "step_s": (12.0, 35.0), "ramps_s": (1.0, 4.0), "from_mps": (5.0, 9.0)},
    needs=("highway", "hills", "suburban"),
)
class TowedDynamometer(Law, pull=0.0):
    """Levels follow each other by the clock, whatever the truck does."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(721), self.setting.batch
        levels = np.array([0.0, 0.0, 0.35, 0.7, 1.0])
        self.levels = rng.permuted(np.tile(levels, (batch, 8)), axis=1)
        self.first = rng.uniform(0.0, 1.0, batch)

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        step = (view.time / p.step_s + self.first).astype(int) % self.levels.shape[1]
        level = self.levels[np.arange(len(step)), step]
        wanted = level * np.clip(view.speed - p.from_mps, 0.0, 1.0)
        s.pull += dt * (wanted - s.pull) / p.ramps_s
        return -p.pull * s.pull * weight(view) * moving(view)


@unnamed(
    "banks_have_a_speed",
    source="Banked curves of high-speed tracks (Gillespie, Fundamentals of Vehicle Dynamics, 1992, on"
    " cornering; Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge): at one speed the bank carries the"
    " truck, below and above it slip angles do, and drag goes with the square of what is left",
    # drag: of the weight, standing on the bank
    ranges={"neutral_mps": (13, 19), "drag": (0.018, 0.045), "curve_m": (200, 500)},
    needs=("highway", "hills"),
)
class BanksHaveASpeed(ByPlace):
    """Slow trucks slide down the bank, fast ones up."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(722), self.p
        self.bank = np.zeros((self.rows(), CELLS))
        ease = np.hanning(15) / np.hanning(15).sum()
        for row in self.bank:
            gaps, lengths = (0.6 * 300.0, 1.6 * 300.0), (0.7 * p.curve_m, 1.5 * p.curve_m)
            for first, last in stretches(rng, gaps, lengths):
                row[first:last] = 1.0
            row[:] = np.convolve(row, ease, mode="same")

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        side = self.read(self.bank, view) * ((view.speed / p.neutral_mps) ** 2 - 1.0)
        return -p.drag * np.minimum(side**2, 1.5) * weight(view) * moving(view)


@unnamed(
    "grounds_on_crests",
    source="Low-loaders that ground on humps (ramp and breakover angles: SAE J689, Curbstone Clearance,"
    " Approach, Departure, and Ramp Breakover Angles): where the road falls away faster than the clearance"
    " allows, skids rub with Coulomb's friction on what they carry",
    # friction: of the weight, all that the skids may carry; from_bend: 1/m, change of slope over the way
    ranges={"friction": (0.025, 0.06), "from_bend": (0.00003, 0.00008), "span": (0.00008, 0.0002)},
    needs=("hills",),
)
class GroundsOnCrests(Hidden):
    """`slope`: of the road a wheelbase or so behind."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slope": np.full(batch, np.nan)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.slope = np.where(np.isnan(s.slope), view.grade, s.slope)
        s.slope = s.slope + dt * np.maximum(view.speed, 0.0) * (view.grade - s.slope) / 30.0
        bend = (s.slope - view.grade) / 30.0
        carries = np.clip((bend - p.from_bend) / p.span, 0.0, 1.0)
        return -p.friction * carries * weight(view) * moving(view)
