"""Losses between flywheel and wheel that come where there is little load, or whatever the load."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_loss", accepts="torque_gain")
CHANGES = 83  # throws of dice for each drive


@law("y_rollers_skid_unloaded", "eighteenth", "hills suburban highway")
@sizes(most=(0.0032, 0.0055), light=(0.12, 0.25), at_mps=(11.0, 16.0), power=(0.6, 1.2), begins_s=(0.5, 1.5))
@sizes(smears=(0.3, 0.6), heals_s=(6.0, 20.0))
class RollersSkidUnloaded(Hidden, skids=0.0, film=1.0):
    """Large rollers need load to roll. With little torque they skid in their oil and lose much, and under
    load they roll and lose little. `skids`: of them. `film`: skidding smears it, so that the loss grows, and
    rolling builds it anew. most: of the weight, at at_mps; light: of peak torque; smears: of the film.
    Source: Harris and Kotzalas, Rolling Bearing Analysis (2006), on skidding of lightly loaded rollers; large
    bearings, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.engine_torque) / self.truck.peak_torque / p.light
        s.skids = eased(s.skids, 1.0 / (1.0 + load**3), p.begins_s, dt)
        s.film = eased(s.film, 1.0 - p.smears * s.skids, p.heals_s, dt)
        fast = np.clip(view.speed / p.at_mps, 0.0, 1.8) ** p.power
        return -p.most * s.skids * fast / s.film * weight(view) * moving(view)


@law(
    "u_gearbox_brake_rubs_on", "twenty-first", "hills suburban highway", accepts="torque_gain engine_friction"
)
@sizes(
    nm=(170.0, 280.0), wears_rad=(900.0, 3000.0), stays=(0.25, 0.45), often=(0.6, 0.85), heavy=(0.04, 0.06)
)
class GearboxBrakeRubsOn(Hidden, gear=0.0, changes=0.0, rubs=0.5):
    """A small brake slows the countershaft for each change of gear, and should then let go. It often stays on
    by some amount, a new one with each change, and its lining is rubbed free by the turns that follow. nm: of
    torque at the gearbox's input, at most; wears_rad: until two thirds are free; stays: of it, that never is;
    often: share of changes after which it stays on; heavy: of the weight, at most.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on countershaft brakes;
    one that sticks, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(2131)
        shape = (self.setting.batch, CHANGES)
        self.dice = rng.uniform(0.4, 1.0, shape) * (rng.random(shape) < self.p.often)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (np.abs(view.gear - s.gear) > 0.5) & (view.shifting < 0.5)
        s.gear = np.where(changed, view.gear, s.gear)
        s.changes = s.changes + changed
        new = self.dice[np.arange(len(s.rubs)), s.changes.astype(int) % CHANGES]
        frees = 1.0 - dt * np.maximum(view.engine_speed, 0.0) / p.wears_rad
        s.rubs = np.where(changed, new, s.rubs * frees)
        nm = p.nm * (p.stays + (1.0 - p.stays) * s.rubs)
        return -np.minimum(self.at_wheels(view, nm), p.heavy * weight(view)) * moving(view)
