"""Limits of the torque."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_limit", shown=True)


@law("torque_limit", "first", "suburban hills")
@sizes(share_of_peak=(0.55, 0.80), knee_nm=(60.0, 200.0))
class SoftLimiter(Hidden):
    """Source: Electronic torque limiter of heavy engines, which hold torque below the full-load curve to
    spare the driveline; the soft knee is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cap, knee = p.share_of_peak * self.truck.peak_torque, p.knee_nm
        over = view.engine_torque - cap
        lost = knee * np.logaddexp(0.0, np.clip(over / knee, -50.0, 50.0))
        return -self.at_wheels(view, np.where(over > -3.0 * knee, lost, 0.0))


@law("road_speed_limiter", "second", "highway")
@sizes(set_mps=(20.5, 24.0), droop_mps=(0.5, 2.0), reset_s=(4.0, 12.0))
class RoadSpeedLimiter(Hidden, allowed=1.0, sum=0.0):
    """Proportional and integral: the integral opens a little above the set speed's droop.
    Source: Speed limitation function, UN Regulation No. 89: fuelling taken back near the set speed, with a
    droop and a stabilised overshoot; droop and rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        left = (p.set_mps - view.speed) / p.droop_mps
        s.sum = np.clip(s.sum + dt * left / p.reset_s, -0.3, 0.3)
        wanted = np.clip(left + s.sum + 0.3, 0.0, 1.0)
        s.allowed += np.clip(wanted - s.allowed, -1.5 * dt, 0.8 * dt)
        over = np.maximum(view.engine_torque - s.allowed * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over)


@law("axle_torque_limit", "third", "suburban hills", accepts="wheel_slip")
@sizes(most=(0.035, 0.065), lag_s=(0.15, 0.6))
class AxleTorqueLimit(Hidden, cut=0.0):
    """most: pull over weight. as would a steady friction under the driven wheels.
    Source: Gear-dependent torque that spares gearbox and axle (Naunheimer, Bertsche, Ryborz and Novak,
    Automotive Transmissions, 2011, on interaction of engine and transmission): torque at the axle, not at the
    engine, is held; limit and lag are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - p.most * weight(view), 0.0)
        s.cut += dt * (over - s.cut) / p.lag_s
        return -np.minimum(s.cut, pull)


@law("worn_feed_pump", "sixth", "hills suburban highway", shown=False)
@sizes(lacks=(0.22, 0.48), leaks=(45.0, 66.0), stores_s=(0.4, 1.6))
class WornFeedPump(Hidden, store=1.0):
    """`store`: what rail and filter hold, of `stores_s`. lacks: of peak torque, at endless speed; leaks:
    rad/s at which nothing is delivered; stores_s: of full torque.
    Source: A geared feed pump delivers its displacement less a leak that does not depend on speed (Manring,
    Hydraulic Control Systems, 2005, on pump leakage; Diesel-Engine Management, Bosch, on low-pressure
    supply): fuel for full torque is there only at high speed, and for a moment from the rail and filter;
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.engine_torque / self.truck.peak_torque
        flows = (1.0 - p.lacks) * (1.0 - p.leaks / np.maximum(view.engine_speed, p.leaks + 10.0))
        s.store = np.clip(s.store + dt * (flows - np.maximum(asked, 0.0)) / p.stores_s, 0.0, 1.0)
        missing = np.maximum(asked - flows, 0.0) * (1.0 - np.clip(s.store / 0.2, 0.0, 1.0))
        return -self.at_wheels(view, missing * self.truck.peak_torque)


@law("governor_with_a_soft_droop", "seventh", "hills suburban highway")
@sizes(from_rads=(96.0, 122.0), droop_rads=(55.0, 110.0), rack_rads=(1.6, 4.0))
class GovernorWithASoftDroop(Hidden, rack=1.0, pace=0.0):
    """rack: the most torque it lets through, over the peak; it lags and swings.
    Source: ISO 3046-4, Reciprocating internal combustion engines - Speed governing: torque falls with speed
    along a droop, by a rack with mass and friction that overshoots; a governor of a generating set on a
    truck's engine, set low."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wanted = np.clip(1.0 - (view.engine_speed - p.from_rads) / p.droop_rads, 0.12, 1.0)
        pull = p.rack_rads**2 * (wanted - s.rack) - 2.0 * 0.4 * p.rack_rads * s.pace
        s.pace = s.pace + dt * pull
        s.rack = np.clip(s.rack + dt * s.pace, 0.05, 1.2)
        over = np.maximum(view.engine_torque - s.rack * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over) * moving(view)


@law("s_mean_power_capped", "eighth", "suburban hills")
@sizes(cap=(0.35, 0.6), mean_s=(0.8, 4.0), knee=(0.04, 0.12))
class MeanPowerCapped(Hidden, mean=0.0):
    """cap: of peak power, for its mean of some seconds. Torque at low speed is free.
    Source: Leased ratings that cap power, not torque (SAE J1939-71, engine power limits): the fuel system
    holds a mean of flow; caps and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(self.power_share(view), 0.0, 1.2)
        s.mean = s.mean + dt * (asked - s.mean) / p.mean_s
        closed = np.clip((s.mean - p.cap) / p.knee, 0.0, 1.0)
        over = np.maximum(asked - p.cap, 0.0) * closed * self.truck.peak_power
        return -self.at_wheels(view, over / np.maximum(view.engine_speed, 60.0))


@law("t_torque_waits_for_warm_oil", "tenth", "suburban hills")
@sizes(cold=(0.26, 0.45), warms_s=(60.0, 180.0))
class TorqueWaitsForWarmOil(Hidden):
    """`warm`: every drive begins elsewhere between cold and half warm; work warms it. cold: of peak torque,
    the most that is let through; warms_s: of peak power.
    Source: Cold protection of heavy engines (owner's manuals on engine protection after a start; SAE
    J1939-71, SPN 175, engine oil temperature): the limit rises as the oil warms; times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(982).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = 0.15 + np.clip(self.power_share(view), 0.0, 1.1)
        s.warm = np.minimum(s.warm + dt * work / p.warms_s, 1.0)
        most = (p.cold + (1.1 - p.cold) * s.warm**1.5) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0))


@law("e_clutch_is_spared", "eleventh", "suburban hills", trucks="trucksim volvo")
@sizes(least=(0.26, 0.42), bears_jpkg=(6.0, 14.0), cools_s=(120.0, 300.0))
class ClutchIsSpared(Hidden):
    """`hot`: of what the clutch bears. The engine turns faster than the gear in every start; the work of that
    slip heats the clutch, and a hot one is given less torque. least: of peak torque; bears_jpkg: for each kg
    of truck.
    Source: Dolcini, Canudas de Wit and Béchart, Dry Clutch Control for Automotive Applications (2010), on the
    energy of engagement, and protection of automated clutches in makers' manuals; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(1043).uniform(0.3, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.speed, 0.0) * view.ratio / self.truck.wheel_radius
        slips = np.clip(view.engine_speed - turns, 0.0, 120.0) * (view.speed < 4.0) * (1.0 - view.shifting)
        work = np.maximum(view.engine_torque, 0.0) * slips / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.bears_jpkg - s.hot / p.cools_s), 0.0, 1.2)
        most = (1.1 - (1.1 - p.least) * np.clip(s.hot, 0.0, 1.0) ** 0.8) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0))


@law("q_spares_its_flywheel", "fifteenth", "suburban hills", accepts="turbo_lag")
@sizes(
    least=(0.24, 0.36),
    low_rads=(102.0, 116.0),
    wide_rads=(50.0, 75.0),
    tightens=(0.2, 0.4),
    tires_s=(2.0, 8.0),
)
class SparesItsFlywheel(Hidden, lugs=0.0):
    """A two-mass flywheel resonates below idling, so torque is held down where the engine turns slowly, and
    further down the longer it lugs. A lower gear helps at once. least: of peak torque, at low_rads; tightens:
    of the limit, after long lugging.
    Source: Reik, The Dual Mass Flywheel, LuK Symposium (1998), on resonance at low speeds and on torque that
    is limited there; a stern limit, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        free = np.clip((view.engine_speed - p.low_rads) / p.wide_rads, 0.0, 1.0)
        most = p.least + (1.15 - p.least) * free**1.5
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.2)
        s.lugs = eased(s.lugs, np.where(asked > 0.8 * most, 1.0, 0.0), p.tires_s, dt)
        most = most * (1.0 - p.tightens * s.lugs * (1.0 - free))
        excess = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, excess) * moving(view)


@law("z_notch_in_the_curve", "seventeenth", "suburban highway hills", accepts="turbo_lag torque_derate")
@sizes(deep=(0.6, 0.75), at_rads=(112.0, 135.0), wide_rads=(20.0, 32.0), stays_s=(0.3, 0.9))
class NotchInTheCurve(Hidden, seen=-1.0):
    """So that a crankshaft does not twist to death, full torque is not allowed near the speed where it
    resonates: the full-load curve has a notch there. Below and above all torque is free. The notch follows
    the speed a little late. deep: of peak torque, taken in its middle.
    Source: Maass and Klier, Kräfte, Momente und deren Ausgleich in der Verbrennungskraftmaschine (1981), on
    barred speeds of crankshafts; a truck's engine with a cracked damper, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.seen = np.where(s.seen < 0.0, view.engine_speed, eased(s.seen, view.engine_speed, p.stays_s, dt))
        near = np.exp(-(np.abs((s.seen - p.at_rads) / p.wide_rads) ** 3))
        most = (1.1 - (0.1 + p.deep) * near) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law("h_plungers_leak", "nineteenth", "suburban hills", accepts="turbo_lag torque_derate")
@sizes(leaks=(0.55, 0.8), at_rads=(118.0, 142.0), power=(1.0, 2.0), warms_s=(10.0, 30.0), thins=(0.3, 0.6))
class PlungersLeak(Hidden):
    """Worn plungers of an injection pump let fuel back past them, by the time that a stroke takes: little at
    high engine speed and much at low speed. So a slow engine cannot be given its full torque. `warm`: fuel,
    which leaks more when it is thin. leaks: of peak torque, with warm fuel at at_rads; thins: of that leak,
    less when cold.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), and Bosch, Diesel-Engine Management
    (2014), on leakage and delivery of plunger pumps; worn ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1942).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, np.clip(1.4 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        slow = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** p.power
        back = p.leaks * slow * (1.0 - p.thins * (1.0 - s.warm))
        most = np.clip(1.1 - back, 0.15, 1.1) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law("b_spares_its_drawbar", "twentieth", "hills suburban", accepts="torque_derate")
@sizes(bears=(0.028, 0.045), trailer=(0.55, 0.75), shuts_s=(0.8, 2.0), opens_s=(5.0, 15.0), least=(0.25, 0.4))
class SparesItsDrawbar(Hidden, most=1.0):
    """A pin in the drawbar measures the pull on the trailer, its share of mass times acceleration and slope.
    While that is more than the bar bears the controller lowers the `most` that the engine may give, and
    afterwards lets it rise slowly. bears: of the truck's weight; shuts_s: for a pull that is twice as hard.
    Source: ISO 18868 and UN Regulation No. 55 on couplings and the forces that they bear, and Åström and
    Hägglund, PID Controllers (1995), on integral limits; a weak bar, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade + self.truck.rolling_resistance, -0.2, 0.2)
        over = p.trailer * felt / p.bears - 1.0
        moves = np.where(over > 0.0, -np.minimum(over, 2.0) / p.shuts_s, np.minimum(-over, 1.0) / p.opens_s)
        s.most = np.clip(s.most + dt * moves, p.least, 1.1)
        over_nm = np.maximum(view.engine_torque - s.most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over_nm) * moving(view)
