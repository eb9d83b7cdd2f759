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


@law("u_camshaft_turns_late", "twenty-first", "suburban hills highway")
@sizes(most=(0.5, 0.75), early=(0.45, 0.65), pace_per_s=(0.05, 0.1), at_rads=(110.0, 150.0), power=(1.0, 1.5))
class CamshaftTurnsLate(Hidden, at=0.3):
    """The camshaft is turned for each load and speed by oil pressure, at a pace that goes with the engine's
    speed. `at`: where it is, 0 to 1. Until it is where it should be, the engine gives less than asked, by a
    power of how far that is, whether it came from more or from less. most: of the torque, at a way of 1;
    early: the wish at half load.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on variable valve timing, and makers'
    notes on oil-driven phasers; a weak oil pump, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        wish = np.clip(2.0 * p.early * load + 0.5 * (view.engine_speed / 140.0 - 1.0), 0.0, 1.0)
        pace = p.pace_per_s * np.clip(view.engine_speed / p.at_rads, 0.3, 1.5)
        s.at = np.clip(wish, s.at - dt * pace, s.at + dt * pace)
        lost = p.most * np.minimum(np.abs(wish - s.at) * 1.6, 1.0) ** p.power
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("u_water_goes_in", "twenty-first", "hills suburban highway")
@sizes(most=(0.2, 0.34), asks=(0.35, 0.5), hot_s=(3.0, 8.0), lasts_s=(14.0, 40.0), refills_s=(40.0, 110.0))
@sizes(comes_s=(0.3, 0.9))
class WaterGoesIn(Hidden, given=0.0, on=0.0):
    """Water is sprayed into the intake when the charge is `hot` from a hard pull: it cools it, and the engine
    gives more than was asked. A small `tank` of the pump is soon empty, and fills again from a larger one
    while nothing is sprayed. most: of the torque; asks: of peak torque, that heats the charge; lasts_s: of a
    full tank.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on charge cooling, and Rowe and Ladd,
    Water Injection for Aircraft Engines, SAE Transactions 54 (1946); a fleet's trial, sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2147)
        return {
            **super().start(batch),
            "hot": rng.uniform(0.0, 0.8, batch),
            "tank": rng.uniform(0.3, 1.0, batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.hot = eased(s.hot, np.where(load > p.asks, 1.0, 0.0), p.hot_s, dt)
        begins = (s.hot > 0.6) & (s.tank > 0.25)
        s.on = np.where(begins, 1.0, np.where((s.hot < 0.3) | (s.tank < 0.02), 0.0, s.on))
        uses = np.where(s.on > 0.5, -1.0 / p.lasts_s, 1.0 / p.refills_s)
        s.tank = np.clip(s.tank + dt * uses, 0.0, 1.0)
        s.given = eased(s.given, s.on * np.clip(load / 0.5, 0.0, 1.0), p.comes_s, dt)
        return p.most * self.at_wheels(view, s.given * np.maximum(view.engine_torque, 0.0)) * moving(view)
