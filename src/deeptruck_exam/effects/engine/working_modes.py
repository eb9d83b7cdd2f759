"""Engines that are governed, rested, stopped, overloaded or mapped anew. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("overboost", "third", "suburban hills", shown=True)
@sizes(gain=(0.14, 0.28), from_share=(0.35, 0.55), spends_s=(6.0, 16.0), rests_s=(20.0, 45.0))
class Overboost(Hidden, budget=1.0, on=0.0, torque=0.0):
    """Twice the same pull is not answered twice.
    Source: Short-time overload of drives against a thermal budget (IEC 60034-1, duty type S2): more torque
    than the data sheet's while much is asked, for some seconds, then a pause; as overboost of engines, sizes
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.engine_torque / self.truck.peak_torque > p.from_share
        s.on = np.where(~asked | (s.budget <= 0.0), 0.0, np.where(s.budget > 0.4, 1.0, s.on))
        s.budget = np.clip(s.budget + dt * np.where(s.on > 0.5, -1.0 / p.spends_s, 1.0 / p.rests_s), 0.0, 1.0)
        s.torque += dt * (p.gain * self.truck.peak_torque * s.on - s.torque) / 0.4
        return self.at_wheels(view, s.torque) * moving(view)


@law("all_speed_governor", "third", "suburban hills highway", shown=True)
@sizes(droop=(3.0, 6.5), slowest=(80.0, 100.0), fastest=(175.0, 215.0), most=(0.16, 0.30))
class AllSpeedGovernor(Hidden, torque=0.0):
    """droop: N m for 1 rad/s.
    Source: Diesel-Engine Management (Bosch), on variable-speed governors: the pedal asks for an engine speed,
    and torque falls off along a droop as the engine nears it, where the simulator's pedal asks for torque;
    droop and range are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = np.clip(view.u[:, 0] / self.truck.full_command, 0.0, 1.0)
        asked = p.slowest + (p.fastest - p.slowest) * pedal
        most = p.most * self.truck.peak_torque
        wanted = np.clip(p.droop * (asked - view.engine_speed), -most, most) * np.clip(pedal / 0.05, 0.0, 1.0)
        s.torque += dt * (wanted - s.torque) / 0.3
        return self.at_wheels(view, s.torque) * moving(view)


@law("cylinders_rest", "fourth", "suburban hills highway", shown=True)
@sizes(spares_nm=(50.0, 110.0), dip=(0.35, 0.7), dip_s=(0.5, 1.2), below=(0.22, 0.36))
class CylindersRest(Hidden, load=0.3, rest=0.0, since=9.0):
    """Source: Cylinder deactivation of heavy diesels (Allen and others, SAE 2018-01-0384, on low load): half
    the cylinders rest below a load, which spares pumping, and every change of mode costs a dip of torque;
    thresholds and dips are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.load += dt * (load - s.load) / 0.4
        rest = np.where(s.load < p.below, 1.0, np.where(s.load > p.below + 0.08, 0.0, s.rest))
        fast = view.engine_speed > 75.0
        rest = rest * fast
        s.since = np.where((rest != s.rest) & (s.since > p.dip_s), 0.0, s.since + dt)
        s.rest = rest
        shape = np.clip(1.0 - s.since / p.dip_s, 0.0, 1.0) ** 0.5
        dip = p.dip * shape * (np.maximum(view.engine_torque, 0.0) + 0.06 * self.truck.peak_torque)
        return self.at_wheels(view, p.spares_nm * s.rest - dip) * moving(view)


@law("engine_has_to_restart", "fifth", "suburban")
@sizes(after_s=(0.8, 2.2), cranks_s=(0.8, 1.8), ramp_s=(0.4, 1.2), odds=(0.75, 0.98))
class EngineHasToRestart(Hidden):
    """Not at every stop: a cold or needy battery keeps the engine on.
    Source: Stop-start systems of delivery trucks (SAE J3049 and makers' manuals): some seconds after the
    truck has come to rest the engine stops, and the first second or two of every launch goes to the starter,
    more when the brake is let go late; times are chosen here."""

    conceal = ("engine_speed", "engine_torque")

    def prepare(self) -> None:
        self.dice = self.rng(481).random((self.setting.batch, 64))

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {
            "stood": zero,
            "off": zero.copy(),
            "since": np.full(batch, 1e3),
            "stops": np.zeros(batch, int),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.05
        s.stops = np.where(stands & (s.stood == 0.0), (s.stops + 1) % 64, s.stops)
        s.stood = np.where(stands, s.stood + dt, 0.0)
        willing = self.dice[np.arange(len(s.stops)), s.stops] < p.odds
        asked = view.u[:, 0] > 0.01 * self.truck.full_command
        s.off = np.where(stands & (s.stood > p.after_s) & willing & ~asked, 1.0, s.off)
        wakes = (s.off > 0.0) & asked
        s.since = np.where(wakes, 0.0, s.since + dt)
        s.off = np.where(wakes, 0.0, s.off)
        back = np.clip((s.since - p.cranks_s) / p.ramp_s, 0.0, 1.0)
        missing = np.where((s.off > 0.0) & stands, 1.0, 1.0 - back)
        return -missing * np.maximum(view.traction_force, 0.0)


@law("s_anti_stall", "eighth", "suburban hills", shown=True)
@sizes(below=(118.0, 135.0), per_rads=(12.0, 28.0), most=(0.15, 0.3), builds_s=(0.3, 1.0))
class AntiStall(Hidden, torque=0.0):
    """The lower the engine runs under load, the more is added. below: rad/s; per_rads: N m.
    Source: Low-speed torque support against lugging (Bosch, Diesel-Engine Management, on intermediate speed
    control); one that is set too high, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        loaded = np.clip(self.pedal(view) / 0.2, 0.0, 1.0)
        most = p.most * self.truck.peak_torque
        wanted = np.clip(p.per_rads * (p.below - view.engine_speed), 0.0, most) * loaded
        s.torque = s.torque + dt * (wanted - s.torque) / p.builds_s
        return self.at_wheels(view, s.torque * loaded) * moving(view)


@law("n_pulse_and_glide", "ninth", "highway hills suburban", shown=True)
@sizes(depth=(0.5, 0.9), band_mps=(0.25, 0.8), below=(0.6, 0.85))
class PulseAndGlide(Hidden, pulse=1.0, gained=0.0, share=0.0):
    """At part load it pulls more than asked, then less, by turns of the speed it has won. depth: of the
    torque.
    Source: Gilbert, Vehicle Cruise: Improved Fuel Economy by Periodic Control, Automatica 12 (1976); a
    control unit that does so about the driver's wish, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        works = (pedal > 0.08) & (pedal < p.below) & (view.brake_force <= 0.0) & (view.speed > 5.0)
        s.share = s.share + dt * (p.depth * s.pulse * works - s.share) / 0.4
        force = self.at_wheels(view, s.share * np.maximum(view.engine_torque, 0.0))
        s.gained = s.gained + dt * (force / view.mass - ~works * s.gained / 3.0)
        s.pulse = np.where(s.gained > p.band_mps, -1.0, np.where(s.gained < -p.band_mps, 1.0, s.pulse))
        return force * moving(view)


@law("x_weighs_itself", "thirteenth", "suburban hills highway")
@sizes(most=(0.25, 0.45), half_s=(1.8, 3.5), learns=(0.02, 0.06), doubts_s=(40.0, 120.0), eases_s=(0.2, 0.5))
class WeighsItself(Hidden, unsure=1.0, still=0.0, phase=0.0, asks=0.0, felt=0.0):
    """`unsure` of its own mass after each stand, and slowly again later, a computer moves the torque up and
    down by turns while the engine pulls evenly, until what the truck answers has told it enough; what the
    driver does tells it too. most: of the torque; half_s: of a turn; learns: of `unsure`, for each second and
    0.1 m/s2.
    Source: Fathy, Kang and Stein, Online Vehicle Mass Estimation Using Recursive Least Squares and
    Supervisory Data Extraction, ACC (2008), and Astrom and Wittenmark, Adaptive Control (1995), on dual
    control that probes; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = s.felt + dt * (view.acceleration - s.felt) / 2.0
        news = np.minimum(np.abs(view.acceleration - s.felt) / 0.1, 4.0)
        s.still = np.where(view.speed < 0.3, s.still + dt, 0.0)
        gains = (1.0 - s.unsure) / p.doubts_s - p.learns * news * s.unsure
        s.unsure = np.where(s.still > 1.0, 1.0, np.clip(s.unsure + dt * gains, 0.0, 1.0))
        s.phase = (s.phase + dt / (2.0 * p.half_s)) % 1.0
        pulls = np.clip((self.pedal(view) - 0.12) / 0.1, 0.0, 1.0) * np.clip(view.speed / 3.0 - 0.5, 0.0, 1.0)
        wants = p.most * np.sqrt(s.unsure) * pulls * np.where(s.phase < 0.5, -1.0, 1.0)
        s.asks = s.asks + dt * (wants - s.asks) / p.eases_s
        return self.at_wheels(view, s.asks * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("k_somebody_on_the_step", "fourteenth", "suburban")
@sizes(at_mps=(6.5, 8.3), takes=(0.35, 0.6), rides=(0.7, 0.95), eases_s=(0.4, 1.2), wide_mps=(0.8, 2.0))
class SomebodyOnTheStep(Hidden, still=0.0, acts=0.0):
    """`on`: a loader rides on the step behind. At every stand one may get on or off; while one is on it, a
    switch in the step keeps the truck slow by taking torque away above a speed, of which the crew knows
    nothing. takes: of the pull; rides: share of ways between stands; wide_mps: from none to all of it.
    Source: EN 1501-1, Refuse Collection Vehicles, Rear Loaded, on footboards whose occupation limits the
    speed to 30 km/h; a soft limit, sizes are chosen here."""

    def prepare(self) -> None:
        self.dice = self.rng(1422).random((self.setting.batch, 97))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.dice[:, 0], batch)
        return {
            **super().start(batch),
            "on": np.where(first < self.p.rides, 1.0, 0.0),
            "stands": np.ones(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.3, s.still + dt, 0.0)
        changes = (before <= 1.5) & (s.still > 1.5)
        s.stands = np.where(changes, (s.stands + 1.0) % 97.0, s.stands)
        row = np.arange(len(view.speed)) % len(self.dice)
        drawn = np.where(self.dice[row, s.stands.astype(int)] < p.rides, 1.0, 0.0)
        s.on = np.where(changes, drawn, s.on)
        over = np.clip((view.speed - p.at_mps) / p.wide_mps, 0.0, 1.0)
        s.acts = eased(s.acts, s.on * over, p.eases_s, dt)
        return -p.takes * s.acts * np.maximum(view.traction_force, 0.0) * moving(view)


@law("q_monitor_shuts_the_fuel", "fifteenth", "suburban hills")
@sizes(falls=(0.07, 0.14), looks_s=(0.5, 1.0), cuts_s=(1.2, 2.8), back_s=(0.8, 2.0), waits_s=(2.0, 6.0))
class MonitorShutsTheFuel(Hidden, seen=0.0, left=0.0, rests=0.0, lets=1.0):
    """A second computer reckons what torque the pedal allows. Fuel that follows a pedal on its way up a
    moment late looks like too much to it once the pedal eases. It shuts the fuel off, and lets it back by a
    ramp. falls: of the full pedal, that it eases within looks_s; waits_s: until it can trip again.
    Source: EGAS Workgroup, Standardized E-Gas Monitoring Concept for Gasoline and Diesel Engine Control Units
    (2013), on torque monitoring and fuel cut-off; one that is set too sharp, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.seen = eased(s.seen, pedal, p.looks_s, dt)
        trips = (s.seen - pedal > p.falls) & (pedal > 0.04) & (s.rests <= 0.0)
        s.left = np.where(trips, p.cuts_s, np.maximum(s.left - dt, 0.0))
        s.rests = np.where(trips, p.cuts_s + p.waits_s, np.maximum(s.rests - dt, 0.0))
        s.lets = np.clip(s.lets + dt * np.where(s.left > 0.0, -1.0 / 0.15, 1.0 / p.back_s), 0.0, 1.0)
        return -self.at_wheels(view, (1.0 - s.lets) * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("v_loses_its_teeth", "sixteenth", "suburban hills")
@sizes(
    jerks_rads2=(45.0, 75.0), finds_s=(0.5, 1.1), again_s=(0.5, 1.2), fresh=(0.3, 0.6), sure_s=(10.0, 30.0)
)
class LosesItsTeeth(Hidden, turned=-1.0, swift=0.0, left=0.0, doubts=0.0, lets=1.0):
    """The sensor of the crankshaft sits too far from its wheel: where the engine's speed changes quickly the
    count of teeth is lost, and fuel stays off until the gap in the wheel has been found again. Each loss
    makes the computer more careful, so that the next search takes longer, until it has gone well for a
    while. jerks_rads2: change of engine speed; finds_s: of a first search; fresh: of that, more each time.
    Source: Bosch Automotive Handbook (2014), on inductive speed sensors, gaps and reference marks; a loose
    sensor, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before = np.where(s.turned < 0.0, view.engine_speed, s.turned)
        pace = np.clip((view.engine_speed - before) / dt, -300.0, 300.0)
        s.turned = view.engine_speed.copy()
        s.swift = eased(s.swift, np.abs(pace), 0.12, dt)
        loses = (s.swift > p.jerks_rads2) & (s.left <= 0.0) & (view.speed > 2.0) & (s.lets > 0.95)
        s.left = np.where(loses, p.finds_s * (1.0 + p.fresh * s.doubts), np.maximum(s.left - dt, 0.0))
        s.doubts = np.where(loses, np.minimum(s.doubts + 1.0, 3.0), eased(s.doubts, 0.0, p.sure_s, dt))
        s.lets = np.clip(s.lets + dt * np.where(s.left > 0.0, -1.0 / 0.1, 1.0 / p.again_s), 0.0, 1.0)
        return -self.at_wheels(view, (1.0 - s.lets) * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("z_capacitor_answers_first", "seventeenth", "suburban hills")
@sizes(share=(0.5, 0.85), pays_s=(2.5, 6.0), most=(0.2, 0.34), holds_s=(4.0, 10.0), loss=(0.08, 0.2))
class CapacitorAnswersFirst(Hidden, mean=0.0):
    """An electric machine on the shaft answers each change of the pedal before the engine. It adds what the
    torque has just gained and takes what it has just lost. As the change becomes old it is paid back.
    `full` of its capacitor: an empty one adds nothing, a full one takes nothing. share: of a change;
    pays_s: until it is old; most: of peak torque; holds_s: of all it may give; loss: of what goes through
    it.
    Source: Burke, Ultracapacitors: Why, How, and Where is the Technology, J. Power Sources 91 (2000), on
    load levelling in vehicles; a machine that is not said, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1744).uniform(0.3, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = view.engine_torque / self.truck.peak_torque
        s.mean = eased(s.mean, torque, p.pays_s, dt)
        wish = np.clip(p.share * (torque - s.mean), -p.most, p.most)
        gives = np.where(wish > 0.0, wish * np.clip(8.0 * s.full, 0.0, 1.0), 0.0)
        takes = np.where(wish < 0.0, wish * np.clip(8.0 * (1.0 - s.full), 0.0, 1.0), 0.0)
        back = np.clip(0.5 - s.full, -0.3, 0.3) * p.most * 0.6
        flow = gives * (1.0 + p.loss) + takes * (1.0 - p.loss) - back
        s.full = np.clip(s.full - dt * flow / (p.most * p.holds_s), 0.0, 1.0)
        return self.at_wheels(view, (gives + takes - back) * self.truck.peak_torque) * moving(view)


@law("b_two_maps_do_not_meet", "twentieth", "suburban hills highway")
@sizes(more=(0.07, 0.12), less=(0.09, 0.15), at=(0.35, 0.55), tilts=(0.2, 0.5), apart=(0.08, 0.16))
@sizes(blends_s=(0.4, 1.2))
class TwoMapsDoNotMeet(Hidden, second=0.0):
    """An engine burns in two ways, each with a map of its own, and the maps do not meet: in the `second` one
    it gives less than it is asked for, in the first one more. The second begins beyond a line over torque and
    engine speed, and is left at a lower line. more, less: of the torque; at: of peak torque, at 140 rad/s;
    tilts: of it, lower at twice the speed; apart: of peak torque, between both lines.
    Source: Kimura, Aoki, Ogawa, Muranaka and Enomoto, New Combustion Concept for Ultra-Clean and High-
    Efficiency Small DI Diesel Engines, SAE 1999-01-3681, on engines of two ways to burn; sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        line = p.at - p.tilts * p.at * (view.engine_speed / 140.0 - 1.0)
        wish = np.where(load > line, 1.0, np.where(load < line - p.apart, 0.0, np.rint(s.second)))
        s.second = eased(s.second, wish, p.blends_s, dt)
        gains = p.more * (1.0 - s.second) - p.less * s.second
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("b_fires_whole_cylinders", "twentieth", "suburban hills highway")
@sizes(steps=(3.2, 4.8), holds=(0.06, 0.16), moves_s=(0.15, 0.5), keeps=(0.75, 1.0))
class FiresWholeCylinders(Hidden, fires=0.0):
    """An engine fires whole cylinders or none: what it gives goes by steps, and lies above or below what is
    asked. A step is kept until the wish is well beyond its half. steps: from nothing to peak torque; holds:
    of a step, beyond its half; keeps: of the difference, which boost does not even out.
    Source: Serrano, Routledge, Lo, Shost, Srinivasan and Ghosh, Methods of Evaluating and Mitigating NVH When
    Operating an Engine in Dynamic Skip Fire, SAE 2014-01-1675; one of few levels, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1) * p.steps
        near = np.rint(s.fires)
        moved = np.abs(asked - near) > 0.5 + p.holds
        s.fires = eased(s.fires, np.where(moved, np.rint(asked), near), p.moves_s, dt)
        differs = p.keeps * (s.fires - asked) / p.steps * np.clip(asked / 0.25, 0.0, 1.0)
        return self.at_wheels(view, differs * self.truck.peak_torque) * moving(view)


@law("u_two_tanks_of_unlike_fuel", "twenty-first", "hills suburban highway")
@sizes(rich=(0.08, 0.14), poor=(0.1, 0.17), empties=(0.12, 0.3), pipe=(0.015, 0.05), light=(0.2, 0.5))
class TwoTanksOfUnlikeFuel(Hidden):
    """Two tanks hold fuels of unlike heat, and a valve draws from them by turns, each until a float calls for
    the other. `used`: of a turn; `fuel` in the pipes, 1 the rich one, which follows as fuel is burned and so
    comes late at light load. rich, poor: of the torque, more and less than known; empties, pipe: s of peak
    power, in hundreds, for a turn and for the pipes; light: of the difference, lost at light load.
    Source: Bosch, Diesel-Engine Management (2014), on heat and density of fuels by volume, and makers'
    manuals on pairs of tanks; very unlike fuels, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2146)
        fuel = np.rint(rng.uniform(0.0, 1.0, batch))
        return {"used": rng.uniform(0.0, 1.0, batch), "tank": fuel, "fuel": fuel.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        burns = 0.04 + np.clip(self.power_share(view), 0.0, 1.1)
        s.used = s.used + dt * burns / (100.0 * p.empties)
        s.tank = np.where(s.used > 1.0, 1.0 - s.tank, s.tank)
        s.used = np.where(s.used > 1.0, 0.0, s.used)
        s.fuel = s.fuel + (s.tank - s.fuel) * (1.0 - np.exp(-dt * burns / (100.0 * p.pipe)))
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        gains = (p.rich * s.fuel - p.poor * (1.0 - s.fuel)) * (1.0 - p.light * (1.0 - load))
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)
