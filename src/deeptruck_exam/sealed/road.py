"""Slopes in whole steps, a grader ahead, and pontoons that sink."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
GRADERS = 16


@law("z_slopes_in_whole_steps", needs="hills descent", name="road_grade", gateable=False)
@sizes(step=(0.009, 0.016), drops=(0.55, 0.95), mean_m=(900.0, 3000.0), rounds=(0.1, 0.3))
class SlopesInWholeSteps(OnRoad):
    """The register of the road holds its slopes in whole steps, and whatever is over a step was left out. So
    a slope is always steeper than its entry, by something between nothing and a step; some sections were
    entered more carefully. drops: of what is over a step; rounds: of a step, where the entry changes softly.
    Source: FHWA, Highway Performance Monitoring System, Field Manual, on grades that are held in
    classes, and Widrow and Kollar, Quantization Noise (2008); truncation and sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1761), self.p
        number = sections(rng, self.rows(), p.mean_m)
        share = rng.choice([0.35, 1.0, 1.0], (self.rows(), int(number.max()) + 1)) * p.drops
        ease = np.hanning(13) / np.hanning(13).sum()
        self.share = np.array([np.convolve(r, ease, "same") for r in np.take_along_axis(share, number, 1)])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steps = np.abs(view.grade) / p.step
        over = steps - np.floor(steps)
        left = np.minimum(over, (1.0 - over) / p.rounds * (1.0 - p.rounds))  # falls softly to the next step
        slope = np.sign(view.grade) * p.step * left * self.read(self.share, view)
        return -slope * weight(view) * moving(view)


@law("z_grader_is_ahead", needs="suburban hills highway", name="road_surface", accepts="rolling_resistance")
@sizes(
    most=(0.009, 0.015), firm_s=(90.0, 300.0), pace_mps=(2.0, 5.0), long_m=(300.0, 1200.0), rises=(0.3, 0.8)
)
class GraderIsAhead(OnRoad, loose=0.0):
    """Graders work along a gravel road, each over a length of its own. Where the blade has just been the
    gravel lies loose, and traffic makes it firm again in minutes. So a place resists by the time since the
    blade was there, and the road ahead of the blade is firm. most: of the weight, fresh; rises: power of the
    firmness with speed.
    Source: Keller and Sherar, Low-Volume Roads Engineering (2003), on blading and on traffic that compacts,
    and Wong, Theory of Ground Vehicles (2008), on passes over loose ground; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p, shape = self.rng(1762), self.p, (self.rows(), GRADERS)
        spaced = 20000.0 * (np.arange(GRADERS) + rng.uniform(0.1, 0.9, shape)) / GRADERS + 2000.0
        pace = rng.choice([-1.0, 1.0], shape) * p.pace_mps * rng.uniform(0.7, 1.3, shape)
        long = p.long_m * rng.uniform(0.7, 1.3, shape)
        self.first, self.pace, self.long = (rows[self.setting.route] for rows in (spaced, pace, long))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = (self.place(view)[:, None] - self.first) * np.sign(self.pace)  # beyond where a grader began
        ago = view.time + 150.0 - way / np.abs(self.pace)  # since its blade was here
        bladed = (way > 0.0) & (way < self.long) & (ago > 0.0)
        fresh = np.where(bladed, np.exp(-np.maximum(ago, 0.0) / p.firm_s), 0.0).max(axis=1)
        speed = np.maximum(view.speed, 0.0)
        s.loose = eased(s.loose, fresh, 12.0 / np.maximum(speed, 0.5), dt)
        return (
            -p.most * s.loose * np.minimum(speed / 12.0, 2.0) ** (0.5 * p.rises) * weight(view) * moving(view)
        )


@law("z_pontoons_sink", needs="suburban hills highway", name="unknown")
@sizes(
    sinks_m=(0.35, 0.6), long_m=(150.0, 500.0), share=(0.3, 0.5), follows_m=(12.0, 30.0), waves=(0.003, 0.007)
)
@sizes(wave_mps=(6.0, 11.0))
class PontoonsSink(OnRoad, sunk=0.0):
    """`sunk`: of how far a bridge of pontoons sinks under the truck. It drives down into its own hollow as it
    comes on the bridge and climbs out as it leaves. On the way it pushes a wave before it, which costs most
    near the pace of waves in that depth. sinks_m: of a full truck; waves: of the weight, at that pace.
    Source: U.S. Army, Improved Ribbon Bridge, technical manual, on pontoons under loads, and Lighthill, Waves
    in Fluids (1978), on waves that a moving load makes; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1763), self.rows(), self.p.long_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, bridge = np.maximum(view.speed, 0.0), self.between(self.road, view)
        before = s.sunk
        s.sunk = eased(s.sunk, bridge, p.follows_m / np.maximum(speed, 1e-3), dt)
        slope = p.sinks_m * (bridge - before) / p.follows_m  # of the hollow, downwards
        wave = p.waves * s.sunk / (1.0 + ((speed - p.wave_mps) / (0.35 * p.wave_mps)) ** 2)
        return (slope - wave) * weight(view) * moving(view)
