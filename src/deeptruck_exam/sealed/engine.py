"""A compressor that stalls, snow in the air filter, quiet at night, a fan that brakes along, rings that
flutter, tyres that are inflated, fuel that does not burn while cold, and a trap that is purged."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "k_compressor_stalls",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
@sizes(spools_s=(1.4, 2.8), least=(0.08, 0.16), stands=(0.25, 0.4), free_rads=(150.0, 180.0))
@sizes(falls_s=(0.25, 0.5))
class CompressorStalls(Hidden, boost=0.0, stalled=0.0):
    """`boost` over the most. An engine that turns slowly takes less air than a compressor needs for much
    boost: there the flow breaks down, boost falls to nothing and has to be built up again, time after time,
    until the engine turns faster. least: of peak torque, without boost; stands: boost that an idling engine
    bears; free_rads: from where on it bears all.
    Source: Greitzer, Surge and Rotating Stall in Axial Flow Compressors, J. Engineering for Power 98 (1976),
    on cycles of surge; a worn turbocharger, slower, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        free = np.clip((view.engine_speed - 70.0) / (p.free_rads - 70.0), 0.0, 1.0)
        bears = p.stands + (1.2 - p.stands) * free
        s.stalled = np.where(s.boost > bears, 1.0, np.where(s.boost < 0.4 * bears, 0.0, s.stalled))
        spools = p.spools_s * np.clip(130.0 / np.maximum(view.engine_speed, 60.0), 0.6, 1.8)
        slow = np.where(s.stalled > 0.5, p.falls_s, np.where(asked > s.boost, spools, 0.9))
        s.boost = eased(s.boost, asked * (1.0 - s.stalled), slow, dt)
        most = p.least + (1.12 - p.least) * np.minimum(1.05 * s.boost, 1.0)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law(
    "k_snow_in_the_air_filter",
    needs="hills suburban highway",
    name="torque_derate",
    accepts="torque_gain",
    shown=True,
)
@sizes(most=(0.4, 0.6), fills_s=(25.0, 70.0), melts_s=(25.0, 70.0), mean_m=(300.0, 1000.0), snow=(0.4, 0.6))
class SnowInTheAirFilter(OnRoad):
    """`clog` of the air filter. Where snow blows over the road the engine draws it in with its air; slow
    driving lets heat under the cab melt it, and out of the snow it dries. A clogged filter takes torque where
    much air is needed. most: of the torque; snow: of the road.
    Source: ISO 5011 on restriction of air cleaners over flow and loading; snow, places and times are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1441), self.rows(), self.p.mean_m, self.p.snow)

    def start(self, batch: int) -> dict[str, Array]:
        return {"clog": self.rng(1442).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        flow = np.clip(view.engine_speed / 150.0, 0.3, 1.4) * (0.4 + 0.6 * load)
        snow = self.between(self.road, view)
        fills = snow * flow / p.fills_s
        melts = (0.15 + 0.85 * np.clip(1.0 - view.speed / 12.0, 0.0, 1.0) + 0.7 * (1.0 - snow)) / p.melts_s
        s.clog = eased(s.clog, fills / (fills + melts), 1.0 / (fills + melts), dt)
        cut = p.most * np.clip(1.3 * s.clog * flow - 0.15, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("k_quiet_at_night", needs="suburban hills", name="torque_limit", shown=True)
@sizes(least=(0.2, 0.34), hushed_rads=(95.0, 112.0), power=(1.0, 2.0), apart_m=(120.0, 420.0))
@sizes(eases_s=(0.8, 2.0))
class QuietAtNight(OnRoad, quiet=0.0):
    """In places where people sleep, which a map holds, torque is limited so that the engine stays quiet, the
    more so the faster it turns. least: of peak torque; hushed_rads: where that is allowed.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on combustion noise over load and speed,
    and the Dutch PIEK scheme for quiet night deliveries; places and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        zones = smooth_stretches(self.rng(1443), self.rows(), gaps, (300.0, 1100.0))
        self.road = np.clip((zones - 0.1) / 0.15, 0.0, 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.quiet = eased(s.quiet, self.read(self.road, view), p.eases_s, dt)
        turns = np.maximum(view.engine_speed, 60.0) / p.hushed_rads
        cap = np.minimum(p.least * turns**-p.power, 1.1)
        most = 1.1 + (cap - 1.1) * s.quiet
        excess = np.maximum(view.engine_torque - most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("k_fan_brakes_along", needs="descent hills", name="engine_brake", accepts="engine_friction")
@sizes(
    nm=(280.0, 480.0), waits_s=(1.0, 3.0), holds_s=(8.0, 25.0), grips_s=(1.0, 3.0), from_rads=(85.0, 110.0)
)
class FanBrakesAlong(Hidden, shut=0.0, left=0.0, turns=0.0):
    """Downhill with the pedal up the cooling fan is clutched in to brake the engine, and it stays in for a
    while whatever the driver does then. Nobody records it. nm: at 190 rad/s, with the square of speed;
    from_rads: of the engine, where it is worth while.
    Source: Detroit Diesel, DDEC application and installation manuals, on fan braking: the fan is called for
    by the engine brake and held on for a time; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) & (view.grade < -0.012) & (view.engine_speed > p.from_rads)
        s.left = np.where(wants, p.holds_s, np.maximum(s.left - dt, 0.0))
        s.turns = eased(s.turns, np.where(s.left > 0.0, 1.0, 0.0), p.grips_s, dt)
        torque = p.nm * np.clip(view.engine_speed / 190.0, 0.0, 1.3) ** 2 * s.turns
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("k_rings_flutter", name="engine_friction", accepts="engine_brake accessory_load")
@sizes(nm=(120.0, 220.0), from_rads=(88.0, 106.0), loads=(0.3, 0.6), settles_s=(0.8, 2.5), wide=(0.08, 0.2))
class RingsFlutter(Hidden, flutter=0.0):
    """`flutter` of piston rings: above a speed their weight lifts them from their grooves wherever no gas
    presses them down, and they settle again late. Gas that passes and oil that is pumped cost torque. nm: at
    150 rad/s; loads: of from_rads, higher at full load.
    Source: Curtis, Piston Ring Dynamics and Its Influence on the Power Cylinder Performance, SAE 810935, on
    ring lift against gas pressure; worn grooves, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        bears = p.from_rads * (1.0 + p.loads * load) * (1.0 - 0.08 * s.flutter)
        wish = np.clip((view.engine_speed / bears - 1.0) / p.wide, 0.0, 1.0)
        s.flutter = eased(s.flutter, wish, np.where(wish > s.flutter, 0.3, p.settles_s), dt)
        torque = p.nm * s.flutter * np.clip(view.engine_speed / 150.0, 0.0, 1.5) ** 2
        return -self.at_wheels(view, torque) * moving(view)


@law("k_inflates_its_tyres", needs="hills highway suburban", name="accessory_load", accepts="engine_friction")
@sizes(kw=(18.0, 34.0), fills_s=(40.0, 120.0), lets_s=(8.0, 25.0), mean_m=(250.0, 800.0), soft=(0.35, 0.55))
@sizes(loads_s=(0.4, 1.2))
class InflatesItsTyres(OnRoad, works=0.0, load=0.0):
    """`full`: air in the tyres. On soft stretches it is let out, and behind them a compressor fills them
    again, which takes minutes. kw: of its shaft, for a 20 t truck; soft: of the road.
    Source: makers' manuals of central tyre inflation for logging trucks, and FPInnovations (FERIC) reports on
    its use, on times of inflation; places and sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1444), self.rows(), self.p.mean_m, self.p.soft)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1445).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soft = self.between(self.road, view) > 0.5
        pumps = np.clip(view.engine_speed / 130.0, 0.4, 1.4) * s.load / p.fills_s
        s.full = np.clip(s.full + dt * np.where(soft, -s.full / p.lets_s, pumps), 0.0, 1.0)
        s.works = np.where(soft | (s.full > 0.98), 0.0, np.where(s.full < 0.85, 1.0, s.works))
        s.load = eased(s.load, s.works, p.loads_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.4)
        watts = 1000.0 * p.kw * size * s.load * (0.7 + 0.3 * s.full)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 260.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("k_misfires_while_cold", needs="suburban highway hills", name="unknown")
@sizes(most=(0.5, 0.8), warms_s=(40.0, 120.0), chills_s=(20.0, 60.0), light=(0.35, 0.6), gas_s=(1.0, 3.0))
class MisfiresWhileCold(Hidden, gas=0.0):
    """`wall`: warmth of the cylinders, 1 where all fuel burns. At light load on cool walls part of the fuel
    does not burn; work warms them, coasting chills them again. most: of the torque; light: of peak torque,
    load up to which fuel misses.
    Source: Zahdeh, Henein and Bryzik, Diesel Cold Starting: Actual Cycle Analysis under Border-Line
    Conditions, SAE 900441, on misfiring cycles; after starting, and at light load, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wall": self.rng(1446).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.8 * self.power_share(view), 0.0, 1.0)
        slow = np.where(power > s.wall, p.warms_s, p.chills_s / np.clip(view.engine_speed / 120.0, 0.5, 1.5))
        s.wall = eased(s.wall, power, slow, dt)
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.gas = eased(s.gas, load, p.gas_s, dt)
        misses = p.most * np.clip(1.1 - s.wall, 0.0, 1.0) * np.exp(-((s.gas / p.light) ** 2))
        return -self.at_wheels(view, misses * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("k_purges_its_trap", needs="hills suburban highway", name="unknown")
@sizes(takes=(0.4, 0.65), fills_s=(6.0, 15.0), purges_s=(4.0, 9.0), eases_s=(0.3, 0.8))
class PurgesItsTrap(Hidden, purges=0.0, acts=0.0):
    """`stored` of what a trap in the exhaust can hold. Work fills it; when it is full the engine burns rich
    for some seconds until it is empty, and gives less of the torque that was asked. takes: of the torque;
    fills_s: at peak power.
    Source: Takahashi and others, The New Concept 3-Way Catalyst for Automotive Lean-Burn Engine: NOx Storage
    and Reduction Catalyst, Catalysis Today 27 (1996); a diesel whose torque is not made up, sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "stored": self.rng(1447).uniform(0.1, 0.95, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fills = (0.2 + np.clip(self.power_share(view), 0.0, 1.0)) / p.fills_s
        s.purges = np.where(s.stored > 0.99, 1.0, np.where(s.stored < 0.05, 0.0, s.purges))
        rate = np.where(s.purges > 0.5, -1.0 / p.purges_s, fills * (view.engine_torque > 0.0))
        s.stored = np.clip(s.stored + dt * rate, 0.0, 1.0)
        s.acts = eased(s.acts, s.purges, p.eases_s, dt)
        return -self.at_wheels(view, p.takes * s.acts * np.maximum(view.engine_torque, 0.0)) * moving(view)
