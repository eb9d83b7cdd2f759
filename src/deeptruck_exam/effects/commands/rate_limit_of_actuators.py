"""Robots, motors, dashpots, cylinders, levers and wires that move a throttle at a limited rate."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Filter, Sizes, State, TorqueFilter, eased
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, name="command_rate_limit", accepts="turbo_lag")


@law("robots_profile", "seventh", "suburban hills")
@sizes(most_per_s=(0.07, 0.16), gathers_per_s2=(0.05, 0.16), back=(1.5, 4.0))
class RobotsProfile(TorqueFilter):
    """A driving robot's leg goes to where the pedal is wanted by a profile of limited jerk: it gathers pace,
    runs at most so fast, and slows down in time.
    Source: Driving robots move pedals by profiles of limited speed and acceleration, slower down than back
    (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008)."""

    def begin(self, s: State, u: Array) -> None:
        s.at, s.pace = u[:, 0].copy(), np.zeros(len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        left = (pedal - s.at) / self.full
        side = np.where(left < 0.0, -1.0, 1.0)
        away = np.where(left < 0.0, p.back, 1.0)
        gathers = p.gathers_per_s2 * away
        most = np.minimum(np.sqrt(2.0 * gathers * np.abs(left)), p.most_per_s * away)
        towards = side * s.pace
        s.pace = side * (towards + np.clip(most - towards, -2.0 * gathers * dt, gathers * dt))
        near = (np.abs(left) < 2e-4) | (np.abs(left) < np.abs(s.pace) * dt)
        s.pace = np.where(near, 0.0, s.pace)
        s.at = np.where(near, pedal, s.at + dt * s.pace * self.full)
        return np.asarray(np.maximum(s.at, 0.0))


@law("s_strained_stepper", "eighth", "suburban hills")
@sizes(free_per_s=(0.14, 0.32), spring=(0.5, 0.85), back=(1.2, 2.5))
class StrainedStepper(TorqueFilter):
    """The farther it is open, the slower it opens and the faster it shuts.
    Source: Stepping motors lose speed along their pull-out curve against a return spring (Acarnley, Stepping
    Motors: a Guide to Theory and Practice, 2002); a retrofitted actuator, sizes are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        share = np.clip(s.given / self.full, 0.0, 1.0)
        up = self.full * p.free_per_s * (1.0 - p.spring * share)
        down = self.full * p.free_per_s * p.back * (1.0 + p.spring * share)
        return np.asarray(s.given + np.clip(pedal - s.given, -down * dt, up * dt))


@law("n_flow_through_a_valve", "ninth", "suburban hills")
@sizes(opens_per_s=(0.28, 0.6), closes=(1.3, 2.5))
class FlowThroughAValve(TorqueFilter):
    """The nearer it is, the slower it moves, by the root of what is left.
    Source: Merritt, Hydraulic Control Systems (1967): flow through an orifice goes with the root of the
    pressure drop; a throttle cylinder whose pressure is the error of its lever, sizes are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        error = (pedal - s.given) / self.full
        rate = np.sqrt(np.abs(error)) * p.opens_per_s * np.where(error < 0.0, p.closes, 1.0)
        return np.asarray(s.given + self.full * np.sign(error) * np.minimum(np.abs(error), rate * dt))


@law("t_oil_in_the_dashpot", "tenth", "suburban hills")
@sizes(per_s=(0.6, 1.3), preload=(0.12, 0.3), cold=(0.2, 0.45), warms_s=(50.0, 160.0))
class OilInTheDashpot(TorqueFilter):
    """The lever follows as fast as its spring can press oil through a bore: fast when far behind, slowly when
    near, slowest while the oil is cold. per_s: of the full command, for an error of all of it; cold: of the
    warm pace.
    Source: Karnopp, Margolis and Rosenberg, System Dynamics (2012), on springs and dashpots in a row; oil's
    viscosity over temperature (Vogel, Physikalische Zeitschrift 22, 1921); a throttle's damper, sizes are
    chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        error = (pedal - s.given) / self.full
        thin = 1.0 - (1.0 - p.cold) * np.exp(-time / p.warms_s)
        rate = p.per_s * thin * (p.preload + np.abs(error)) * np.where(error < 0.0, 2.5, 1.0)
        return np.asarray(s.given + self.full * np.sign(error) * np.minimum(np.abs(error), rate * dt))


@law("e_cylinder_fills_with_air", "eleventh", "suburban hills")
@sizes(fills_s=(0.9, 1.9), empties_s=(0.5, 1.1), spring=(0.15, 0.3), supply=(1.25, 1.7))
class CylinderFillsWithAir(TorqueFilter):
    """Air moves the lever against a spring: nothing happens until it is stretched, then the lever goes at one
    pace while the air chokes, and slower near its end. spring: of the pressure of a full pedal, before the
    lever moves; supply: over that pressure; fills_s: from nothing to full, choked.
    Source: Andersen, The Analysis and Design of Pneumatic Systems (1967): flow is choked below half of the
    pressure ahead; air throttles of rear-engined vehicles, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.bar = self.wanted(u[:, 0])

    def wanted(self, pedal: Array) -> Array:
        """Pressure, over that of a full pedal, which holds the lever there; none for a closed pedal."""
        share = pedal / self.full
        return np.asarray(np.where(share > 0.0, self.p.spring + (1.0 - self.p.spring) * share, 0.0))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        wanted = self.wanted(pedal)
        ahead = np.clip((p.supply - s.bar) / (0.5 * p.supply), 0.0, 1.0) ** 0.5 / p.fills_s
        back = np.clip((s.bar + 0.15) / 0.5, 0.3, 1.0) ** 0.5 / p.empties_s
        closes = np.clip(np.abs(wanted - s.bar) / 0.2, 0.08, 1.0)
        s.bar = np.clip(wanted, s.bar - dt * back * closes, s.bar + dt * ahead * closes)
        lever = np.clip((s.bar - p.spring) / (1.0 - p.spring), 0.0, None)
        arrived = (s.bar == wanted) & (pedal >= 0.0)
        return np.asarray(np.where(arrived, np.maximum(pedal, 0.0), self.full * lever))


@law("v_repeats_like_a_key", "sixteenth", "suburban hills highway")
@sizes(first_per_s=(0.02, 0.045), doubles_s=(1.2, 2.6), most_per_s=(0.3, 0.6), near=(0.01, 0.03))
class RepeatsLikeAKey(TorqueFilter):
    """A lever that only says more or less: what it sets moves slowly at first and ever faster while it is
    held, as figures do under a key that repeats. Each time it arrives or turns round it begins slowly again.
    first_per_s, most_per_s: of the full command in a second; doubles_s: for twice the pace.
    Source: makers' manuals of remote controls and hand throttles by rocker switches, on steps that grow
    while a switch is held; paces are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.pace = np.full(len(u), self.p.first_per_s)
        s.way = np.zeros(len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        off = (pedal - s.given) / self.full
        way = np.where(np.abs(off) < p.near, 0.0, np.sign(off))
        on = (way == s.way) & (way != 0.0)
        s.pace = np.where(on, np.minimum(s.pace * 2.0 ** (dt / p.doubles_s), p.most_per_s), p.first_per_s)
        s.way = way
        step = s.pace * self.full * dt
        return np.asarray(np.clip(pedal, s.given - step, s.given + step))


@law("z_motor_moves_by_pulses", "seventeenth", "suburban hills highway")
@sizes(per_s=(0.25, 0.5), period_s=(0.8, 1.6), band=(0.25, 0.5), least=(0.06, 0.15))
class MotorMovesByPulses(TorqueFilter):
    """A motor of one speed moves the throttle, and a relay gives it a pulse in each period: the longer, the
    farther away it is. Between pulses the throttle stays. So far changes are ramps, and near the end they are
    small stairs. per_s: of the full command, while it turns; band: of it, an error that keeps the relay on;
    least: of the period, the shortest pulse.
    Source: Bennett, A History of Control Engineering 1930-1955 (1993), and manuals of step controllers for
    motor valves, on pulses by the error; periods are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.left = np.zeros(len(u))
        s.clock = np.resize(self.rng(1722).uniform(0.0, self.p.period_s, len(self.setting.start_m)), len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        s.clock = s.clock + dt
        begins = s.clock >= p.period_s
        s.clock = np.where(begins, s.clock - p.period_s, s.clock)
        off = np.abs(pedal - s.given) / self.full
        pulse = p.period_s * np.clip(off / p.band, p.least, 1.0)
        s.left = np.where(begins, pulse, s.left - dt)
        step = np.where(s.left > 0.0, p.per_s * self.full * dt, 0.0)
        return np.asarray(np.clip(pedal, s.given - step, s.given + step))


@law("y_motor_gets_tired", "eighteenth", "suburban hills highway")
@sizes(per_s=(0.25, 0.45), tires=(0.7, 0.9), moves=(1.2, 3.0), rests_s=(15.0, 45.0))
class MotorGetsTired(TorqueFilter):
    """A small motor moves the throttle at a pace, and its winding gets hot by moving. `hot`: a hot winding
    carries less current, and the pace falls. While the pedal rests it cools. per_s: of the full command, when
    cold; tires: of that, lost when hot; moves: full ways that heat it; rests_s: until it has cooled.
    Source: Hughes and Drury, Electric Motors and Drives (2013), on torque and current of warm windings; a
    small motor, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        first = self.rng(1822).uniform(0.2, 0.8, len(self.setting.start_m))
        s.hot = np.resize(first, len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        most = p.per_s * (1.0 - p.tires * s.hot) * self.full * dt
        given = np.clip(pedal, s.given - most, s.given + most)
        moved = np.abs(given - s.given) / self.full
        s.hot = np.clip(s.hot + moved / p.moves - dt * s.hot / p.rests_s, 0.0, 1.0)
        return np.asarray(given)


@law("h_one_pump_for_both_pedals", "nineteenth", "suburban hills")
@sizes(per_s=(0.16, 0.3), brake=(3.0, 6.0), keeps=(0.15, 0.3), fills_s=(5.0, 12.0))
class OnePumpForBothPedals(Filter):
    """A small pump presses the oil that moves throttle and brake. `store` of pressed oil, which every move of
    the brake takes from and the pump fills. The throttle moves by what pressure is left: fast after long
    rolling, slowly after a braking. per_s: of the full command, with a full store; brake: of the store, for a
    full braking; keeps: of the pace, with an empty one.
    Source: Merritt, Hydraulic Control Systems (1967), on flow by supply pressure, and Watton,
    Fundamentals of Fluid Power Control (2009), on accumulators that actuators share; a small
    pump, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"given": np.zeros(batch), "was": np.zeros(batch), "store": np.full(batch, 0.6)}

    def begin(self, s: State, u: Array) -> None:
        s.given, s.was = u[:, 0].copy(), u[:, 1].copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        takes = p.brake * np.abs(u[:, 1] - s.was) / 40.0
        s.was = u[:, 1].copy()
        s.store = np.clip(s.store + dt * (1.0 - s.store) / p.fills_s - takes, 0.0, 1.0)
        most = p.per_s * (p.keeps + (1.0 - p.keeps) * s.store) * self.full * dt
        s.given = np.clip(u[:, 0], s.given - most, s.given + most)
        return np.stack([s.given, u[:, 1]], axis=1)


@law("b_wire_shrinks_when_hot", "twentieth", "suburban hills")
@sizes(heats_per_s=(0.2, 0.36), cools_per_s=(0.45, 0.8), least=(0.1, 0.25), soaks_s=(15.0, 45.0))
@sizes(soaked=(0.3, 0.6))
class WireShrinksWhenHot(TorqueFilter):
    """A wire of a metal that shrinks when it is hot draws the throttle open: current heats it, against what
    the air takes, so that it opens ever more slowly. It shuts as it cools, fast from wide open and slowly
    near shut, and slowest where long pulls have warmed its `case`. heats_per_s: of the full command, from
    cold; cools_per_s: from wide open, in a cold case; least: of the paces; soaked: of the cooling, lost.
    Source: Lagoudas, Shape Memory Alloys (2008), on actuators that are heated by current and cool by
    themselves; a thick wire, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.case = np.clip(0.5 * u[:, 0] / self.full, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        wide = np.clip(s.given / self.full, 0.0, 1.0)
        s.case = eased(s.case, wide, p.soaks_s, dt)
        opens = p.heats_per_s * (p.least + (1.0 - p.least) * (1.0 - wide))
        shuts = p.cools_per_s * (p.least + (1.0 - p.least) * wide) * (1.0 - p.soaked * s.case)
        return np.clip(pedal, s.given - dt * shuts * self.full, s.given + dt * opens * self.full)
