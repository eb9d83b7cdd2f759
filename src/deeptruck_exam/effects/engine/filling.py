"""How cylinders are filled and fuelled, in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("y_mixture_swings", "eighteenth", "suburban hills highway")
@sizes(lean=(0.7, 1.0), rich=(0.2, 0.35), trims=(0.18, 0.35), late_s=(1.2, 2.4), jumps=(0.1, 0.3))
class MixtureSwings(Hidden, trim=0.0, seen=0.0, way=1.0):
    """An engine for gas takes its mixture from a probe that knows only lean or rich. The controller enriches
    until the probe says rich, and leans until it says lean. Exhaust takes time to the probe, more with little
    flow, so the mixture swings and torque with it. `trim` of the fuel; `seen`: as the probe sees it. lean,
    rich: torque lost and won, of a full swing.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on the limit cycle of two-point lambda
    control; a slow probe, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        flow = np.clip(self.power_share(view), 0.12, 1.0)
        s.seen = eased(s.seen, s.trim, p.late_s * (0.35 / flow) ** 0.5, dt)
        turned = np.where(s.seen > 0.1, -1.0, np.where(s.seen < -0.1, 1.0, s.way))
        s.trim = np.where(turned != s.way, s.trim + p.jumps * turned, s.trim)
        s.way = turned
        s.trim = np.clip(s.trim + dt * p.trims * s.way, -1.0, 1.0)
        gains = np.where(s.trim > 0.0, p.rich * s.trim, p.lean * s.trim)
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("y_pipes_in_tune", "eighteenth", "suburban hills highway")
@sizes(
    share=(0.16, 0.26),
    wave_rads=(45.0, 80.0),
    fits_rads=(100.0, 170.0),
    cold=(0.1, 0.25),
    warms_s=(6.0, 20.0),
)
class PipesInTune(Hidden, warm=0.3):
    """Long pipes before the engine ring at certain engine speeds: there its cylinders are filled better, and
    between them worse. Warm pipes ring higher, so that all these speeds move as the engine works. `warm`: the
    pipes. share: of the torque, more or less; wave_rads: from one such speed to the next; fits_rads: one of
    them, cold; cold: of it, higher when warm.
    Source: Winterbone and Pearson, Theory of Engine Manifold Design (2000), on tuned pipes; pipes that a shop
    has put on, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, np.clip(1.3 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        turns = view.engine_speed / (1.0 + p.cold * s.warm)
        rings = np.cos(2.0 * np.pi * (turns - p.fits_rads) / p.wave_rads)
        return self.at_wheels(view, p.share * rings * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("h_needle_hangs", "nineteenth", "suburban hills highway")
@sizes(more=(0.07, 0.12), less=(0.16, 0.26), frees=(0.45, 0.6), frees_s=(2.0, 6.0), hangs_s=(6.0, 18.0))
class NeedleHangs(Hidden):
    """`hangs`: of the needles in worn injectors. One that hangs never shuts wholly, so that more fuel comes
    than is asked at small loads, and opens too little for large ones. Hard work frees them within seconds,
    easy work lets varnish hold them again. more: of peak torque, unasked; less: of the torque, lacking at
    full load; frees: of peak torque, beyond which they come free.
    Source: Bosch, Diesel-Engine Management (2014), on needles that stick, and Lacey, Gail, Kientz and others,
    Fuel Quality and Diesel Injector Deposits, SAE 2012-01-1693; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hangs": self.rng(1947).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        frees = np.clip((asked - p.frees) / 0.2, 0.0, 1.0) * s.hangs / p.frees_s
        back = np.clip(1.0 - asked / p.frees, 0.0, 1.0) * (1.0 - s.hangs) / p.hangs_s
        s.hangs = np.clip(s.hangs + dt * (back - frees), 0.0, 1.0)
        small = np.exp(-((asked / 0.35) ** 2)) * np.clip(self.pedal(view) / 0.02, 0.3, 1.0)
        gains = s.hangs * (p.more * small - p.less * asked**2)
        return self.at_wheels(view, gains * self.truck.peak_torque) * moving(view)
