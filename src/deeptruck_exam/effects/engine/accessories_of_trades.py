"""What the engine drives for a trade: drums, presses, pumps, blowers, lifts, cold boxes."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="accessory_load", accepts="engine_friction")


@law("mixer_drum", "third", "hills highway suburban")
@sizes(power_w=(14000.0, 30000.0), stiffens=(0.1, 0.5), fast=(1.3, 1.8), each_s=(50.0, 90.0))
class MixerDrum(Hidden):
    """A light truck has a small drum.
    Source: Hydrostatic drive of a constant power, torque in inverse proportion to engine speed (Automotive
    Handbook, Bosch, on hydrostatic transmissions); a mixer drum whose concrete stiffens, with minutes of fast
    turning; powers and times chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(212).uniform(0.0, 1.0, self.setting.batch)
        self.power = self.p.power_w * np.clip(self.truck.mass / 2.0e4, 0.5, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = (view.time / p.each_s + self.first) % 1.0 < 0.35
        stiff = 1.0 + p.stiffens * view.time / self.setting.duration_s
        watts = self.power * stiff * np.where(fast, p.fast, 1.0)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 60.0), 0.10 * self.truck.peak_torque)
        return -self.at_wheels(view, torque) * moving(view)


@law("packs_on_the_go", "fourth", "suburban")
@sizes(torque_nm=(170.0, 330.0), stroke_s=(5.0, 11.0), strokes=(1.6, 3.4))
class PacksOnTheGo(Hidden, stood=0.0, since=1000.0):
    """Source: Refuse bodies that pack while the truck pulls away (body makers' manuals; NREL's refuse
    vocational duty cycles): a pump of fixed displacement works one stroke after every stop, pressure rising
    as the load is squeezed; pressures and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.05
        s.since = np.where(stands & (s.stood > 1.0), 0.0, s.since + dt)
        s.stood = np.where(stands, s.stood + dt, 0.0)
        stroke = s.since / p.stroke_s
        works = np.floor(stroke) < np.round(p.strokes)
        most = np.minimum(p.torque_nm, 0.14 * self.truck.peak_torque)
        squeeze = 0.25 + 0.75 * (stroke - np.floor(stroke)) ** 2
        return -self.at_wheels(view, most * squeeze * works) * moving(view)


@law("blows_off_cement", "fifth", "hills highway suburban")
@sizes(torque_nm=(150.0, 300.0), creeps_s=(8.0, 25.0), left=(0.3, 0.6), on_share=(0.4, 0.7))
class BlowsOffCement(Hidden):
    """A saw tooth of torque, in parts of the drives.
    Source: Compressors and pumps on a clutch-independent power take-off that the driver leaves on between
    yards (bulk and vacuum tankers, body makers' manuals): a fixed displacement against a back pressure that
    creeps up and is blown off by a valve; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(454), self.setting.batch
        first = rng.uniform(0.0, 0.6, batch) * self.setting.duration_s
        self.from_s = np.where(rng.random(batch) < 0.5, 0.0, first)
        self.until_s = self.from_s + self.p.on_share * self.setting.duration_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"pressure": np.full(batch, self.p.left)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        on = (self.from_s <= view.time) & (view.time < self.until_s)
        pumped = dt * np.clip(view.engine_speed / 130.0, 0.4, 1.6) / p.creeps_s
        s.pressure = np.where(s.pressure >= 1.0, p.left, np.minimum(s.pressure + pumped * on, 1.0))
        return -self.at_wheels(view, p.torque_nm * s.pressure * on) * moving(view)


@law("n_lift_drains_the_battery", "ninth", "suburban")
@sizes(power_wpkg=(1.0, 2.2), uses_s=(6.0, 20.0), charges_s=(25.0, 80.0), tapers=(0.2, 0.6))
class LiftDrainsTheBattery(Hidden):
    """`flat`: 1 for empty. Stands use it up, driving fills it, ever slower from `tapers` on.
    Source: Bucket trucks and lifts that work from a battery which the engine fills on the way (NREL field
    evaluations of hybrid utility trucks); constant power, then a taper, as chargers do; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"flat": self.rng(921).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = np.clip(s.flat / p.tapers, 0.0, 1.0)
        change = np.where(view.speed < 0.1, 1.0 / p.uses_s, -share / p.charges_s)
        s.flat = np.clip(s.flat + dt * change, 0.0, 1.0)
        power = p.power_wpkg * view.mass * share
        torque = np.minimum(power / np.maximum(view.engine_speed, 60.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("t_box_is_kept_cold", "tenth", "hills highway suburban")
@sizes(nm=(90.0, 170.0), pulls_s=(18.0, 40.0), leaks_s=(35.0, 90.0), frosts_s=(60.0, 160.0))
class BoxIsKeptCold(Hidden, on=0.0, frost=0.0, thaws=0.0, runs=0.0):
    """`box`: 0 cold enough to 1 too warm. Doors warm it at stands; frost weakens the evaporator until it is
    thawed, when nothing runs.
    Source: ASHRAE Handbook, Refrigeration, on truck bodies, door openings and defrosting: a compressor on the
    engine, switched by a thermostat with a band, takes the more torque the warmer it is inside; sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(983)
        begin = {"box": rng.uniform(0.2, 1.3, batch), "frost": rng.uniform(0.0, 0.9, batch)}
        return {**super().start(batch), **begin}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.box >= 1.0, 1.0, np.where(s.box <= 0.0, 0.0, s.on))
        s.thaws = np.where(s.frost >= 1.0, 1.0, np.where(s.frost <= 0.0, 0.0, s.thaws))
        works = s.on * (1.0 - s.thaws)
        warms = 1.0 / p.leaks_s + 0.08 * (view.speed < 0.1)
        cools = works * (1.0 - 0.4 * s.frost) * (1.0 / p.pulls_s + 1.0 / p.leaks_s)
        s.box = np.clip(s.box + dt * (warms - cools), 0.0, 1.6)
        s.frost = np.clip(s.frost + dt * np.where(s.thaws > 0.0, -1.0 / 18.0, works / p.frosts_s), 0.0, 1.0)
        s.runs = s.runs + dt * (works - s.runs) / 0.5
        return -self.at_wheels(view, p.nm * (0.75 + 0.35 * s.box) * s.runs) * moving(view)


@law("e_condenser_lacks_wind", "eleventh", "hills highway suburban")
@sizes(nm=(60.0, 110.0), head=(0.6, 1.4), heats_s=(8.0, 25.0), on_s=(25.0, 60.0), off_s=(10.0, 30.0))
class CondenserLacksWind(Hidden, on=1.0, runs=0.0):
    """`head`: pressure behind the compressor, which the wind of driving lowers; it trips above a limit until
    it has cooled. Cabins or cargo call for it by a thermostat. nm: with much wind; head: more without.
    Source: Kiss, Chaney and Meyer, A New Automotive Air Conditioning System Simulation Tool Developed in
    MATLAB/Simulink, SAE 2013-01-0850, and the ASHRAE Handbook on condensers; a coach's system on a truck,
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1045)
        begin = {"room": rng.uniform(0.0, 1.0, batch), "head": rng.uniform(0.2, 0.9, batch)}
        return {**super().start(batch), **begin, "tripped": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.room >= 1.0, 1.0, np.where(s.room <= 0.0, 0.0, s.on))
        s.tripped = np.where(s.head > 1.15, 1.0, np.where(s.head < 0.5, 0.0, s.tripped))
        works = s.on * (1.0 - s.tripped)
        s.runs = s.runs + dt * (works - s.runs) / 0.4
        s.room = np.clip(s.room + dt * np.where(works > 0.0, -1.0 / p.on_s, 1.0 / p.off_s), 0.0, 1.0)
        lacks = 1.3 / (1.0 + (np.maximum(view.speed, 0.0) / 9.0) ** 1.5)
        s.head = s.head + dt * (lacks * works - s.head) / p.heats_s
        return -self.at_wheels(view, p.nm * (1.0 + p.head * s.head) * s.runs) * moving(view)


@law("w_sprays_by_the_metre", "twelfth", "highway suburban hills")
@sizes(kw=(35.0, 70.0), at_mps=(9.0, 14.0), opens_s=(0.5, 1.5), apart_m=(250.0, 800.0), idles=(0.1, 0.25))
class SpraysByTheMetre(OnRoad, sprays=0.0):
    """A sprayer gives each metre of the strips that are to be treated the same, so that its pump needs power
    with a power of speed, up to its relief valve. kw: of the pump, most; at_mps: where the valve opens;
    idles: of that, between.
    Source: Akesson and Yates, Pesticide Application Equipment and Techniques, FAO Agricultural Services
    Bulletin 38 (1979), on pressure with the square of ground speed at a constant rate; de-icing sprayers of
    airports, strips and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        strips = smooth_stretches(self.rng(1144), self.rows(), gaps, (200.0, 900.0))
        self.road = np.where(strips > 0.15, 1.0, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.sprays = s.sprays + dt * (self.read(self.road, view) - s.sprays) / p.opens_s
        rate = np.clip(view.speed / p.at_mps, 0.0, 1.0) ** 2.2
        watts = 1000.0 * p.kw * (p.idles + (1.0 - p.idles) * rate * s.sprays)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("v_sieve_at_resonance", "sixteenth", "suburban hills highway")
@sizes(
    kw=(24.0, 38.0), at_rads=(112.0, 135.0), narrow_rads=(9.0, 18.0), bends=(0.06, 0.14), grows_s=(0.6, 1.8)
)
class SieveAtResonance(Hidden, swings=0.1):
    """`swings`: of a sieve on springs that a belt from the engine shakes. It takes power where the engine
    meets its resonance; springs of rubber stiffen as it swings, so that it follows a rising engine for a
    while and jumps in late when the engine falls. kw: of shaft power, in full swing, for a 20 t truck; bends:
    of the resonance, higher in full swing; narrow_rads: half width.
    Source: Thomson and Dahleh, Theory of Vibration with Applications (1998), on forced vibration and on
    hardening springs that jump; a sieve that is left on, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        own = p.at_rads * (1.0 + p.bends * s.swings)
        near = 1.0 / np.sqrt(1.0 + ((view.engine_speed - own) / p.narrow_rads) ** 2)
        s.swings = eased(s.swings, near, p.grows_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        watts = 1000.0 * p.kw * size * (0.08 + 0.92 * s.swings**2)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 380.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("z_fan_sucks_leaves", "seventeenth", "suburban hills highway")
@sizes(kw=(17.0, 27.0), at_rads=(130.0, 165.0), chokes=(0.5, 0.75), leaves_s=(8.0, 25.0), clear_s=(8.0, 25.0))
@sizes(moves_s=(0.5, 1.5))
class FanSucksLeaves(Hidden, choked=0.0):
    """A fan that sucks leaves was left on, driven by the engine: its power grows with the cube of the speed.
    Where its mouth is choked by leaves it moves less air and takes less power, until they come loose. kw: of
    shaft power, free, for a 20 t truck, at at_rads; chokes: of the power, spared with a choked mouth.
    Source: Eck, Fans: Design and Operation of Centrifugal, Axial-Flow and Cross-Flow Fans (1973), on power
    with the cube of speed and at a throttled inlet; leaves and sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        on, off = (0.5 * p.leaves_s, 1.5 * p.leaves_s), (0.5 * p.clear_s, 1.5 * p.clear_s)
        self.leaves = spells(self.rng(1743), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.choked = eased(s.choked, within(self.leaves, view.time), p.moves_s, dt)
        turns = np.clip(view.engine_speed / p.at_rads, 0.3, 1.4)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        nm = 1000.0 * p.kw * size / p.at_rads * turns**2 * (1.0 - p.chokes * s.choked)
        return -self.at_wheels(view, np.minimum(nm, 420.0)) * moving(view)


@law("h_works_hardest_half_way", "nineteenth", "suburban hills highway")
@sizes(nm=(190.0, 300.0), empties_s=(10.0, 26.0), opens_s=(3.0, 8.0), shut_s=(20.0, 50.0), idles=(0.05, 0.15))
class WorksHardestHalfWay(Hidden, pumps=0.0):
    """A pump on the engine makes the vacuum of a tank that gathers mud. `air` left in it, 1 as outside. Into
    a full atmosphere there is nothing to press, and in a vacuum little air to be pressed: the pump works
    hardest half way. The hose is opened in spells, which lets air in. nm: of torque, at most; empties_s: at
    140 rad/s; idles: of the torque, all the time.
    Source: Hoffman, Singh and Thomas, Handbook of Vacuum Science and Technology (1998), on work of
    compression by inlet pressure; tank and hose, sizes are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.6 * p.opens_s, 1.6 * p.opens_s), (0.5 * p.shut_s, 1.5 * p.shut_s)
        self.hose = spells(self.rng(1945), batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1946).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.5)
        lets_in = 0.5 * within(self.hose, view.time) * (1.0 - s.air)
        s.air = np.clip(s.air + dt * (lets_in - turns * s.air / p.empties_s), 0.02, 1.0)
        work = -np.e * s.air * np.log(s.air)  # over its most, at a third of the air
        s.pumps = eased(s.pumps, p.idles + (1.0 - p.idles) * work, 0.3, dt)
        return -self.at_wheels(view, p.nm * s.pumps) * moving(view)


@law("h_belt_carries_it_up", "nineteenth", "hills suburban")
@sizes(nm=(110.0, 190.0), tilts=(6.0, 11.0), full_s=(12.0, 35.0), empty_s=(15.0, 40.0), belt_s=(3.0, 8.0))
class BeltCarriesItUp(Hidden, laden=0.5):
    """A belt on the truck carries its load up to the rear, and the engine drives it. On a climb the belt is
    steeper and takes more, and where the road goes down it takes less, until it carries itself. `laden`: of
    the belt; the heap before it comes and goes in spells. nm: of torque on the level, laden; tilts: more, for
    a slope of 1; belt_s: from one end of the belt to the other.
    Source: CEMA, Belt Conveyors for Bulk Materials (2014), on power by lift and by length; belt and spells
    are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.5 * p.full_s, 1.5 * p.full_s), (0.5 * p.empty_s, 1.5 * p.empty_s)
        self.heap = spells(self.rng(1949), batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / 140.0, 0.4, 1.4)
        s.laden = eased(s.laden, within(self.heap, view.time), p.belt_s / turns, dt)
        lifts = np.maximum(1.0 + p.tilts * np.clip(view.grade, -0.1, 0.1), 0.0)
        return -self.at_wheels(view, p.nm * (0.15 + 0.85 * s.laden * lifts)) * moving(view)


@law("b_chipper_waits_for_the_engine", "twentieth", "suburban hills highway", accepts="")
@sizes(nm=(210.0, 330.0), on_rads=(118.0, 132.0), below=(0.06, 0.14), bites_s=(0.4, 1.0), knots_s=(2.0, 6.0))
@sizes(idles=(0.05, 0.15))
class ChipperWaitsForTheEngine(Hidden, feeds=0.0, bites=0.0):
    """The engine drives a chipper whose feed stops itself when the engine gets slow, and starts again when it
    turns fast enough: it works or idles by the engine's speed, and each has to be left by some margin. Thick
    wood and thin come by chance. nm: of torque, for usual wood; below: of on_rads, where it stops.
    Source: Spinelli, Cavallo, Eliasson and Facello, Comparing the Efficiency of Drum and Disc Chippers, Silva
    Fennica 47 (2013), and makers' notes on no-stress feeds; sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.5 * self.p.knots_s, 2.5 * self.p.knots_s), (0.5 * self.p.knots_s, 2.5 * self.p.knots_s)
        self.thick = spells(self.rng(2043), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stops = view.engine_speed < p.on_rads * (1.0 - p.below)
        s.feeds = np.where(view.engine_speed > p.on_rads, 1.0, np.where(stops, 0.0, s.feeds))
        wish = s.feeds * (0.75 + 0.5 * within(self.thick, view.time))
        s.bites = eased(s.bites, wish, p.bites_s, dt)
        return -self.at_wheels(view, p.nm * (p.idles + (1.0 - p.idles) * s.bites)) * moving(view)


@law("b_pump_of_two_strokes", "twentieth", "suburban hills highway")
@sizes(nm=(200.0, 320.0), turns=(55.0, 130.0), dips=(0.6, 0.95), dips_s=(0.4, 0.9), presses=(0.2, 0.5))
class PumpOfTwoStrokes(Hidden, pumps=0.5):
    """Two pistons press mortar through a hose by turns, while the truck drives on. Within each stroke the
    pressure rises as the mortar is packed, and between strokes a valve swings over and nothing is pressed. A
    stroke takes so many `turns` of the engine. nm: of torque, on the way; presses: of it, that comes along
    the stroke; dips: of it, that is gone between strokes.
    Source: Putzmeister and Schwing, makers' notes on two-piston pumps for concrete, and ACI 304.2R, Placing
    Concrete by Pumping Methods; pumping on the way and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "stroke": self.rng(2044).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        per_s = np.maximum(view.engine_speed, 40.0) / (2.0 * np.pi * p.turns)
        s.stroke = (s.stroke + dt * per_s) % 1.0
        swings = np.where(s.stroke < np.minimum(p.dips_s * per_s, 0.4), 1.0, 0.0)
        wish = (1.0 - p.dips * swings) * (1.0 - p.presses * (0.5 - s.stroke))
        s.pumps = eased(s.pumps, wish, 0.12, dt)
        return -self.at_wheels(view, p.nm * s.pumps) * moving(view)


@law("u_pump_was_left_engaged", "twenty-first", "suburban hills highway")
@sizes(thick_nm=(130.0, 220.0), flow_nm=(60.0, 110.0), at_rads=(130.0, 160.0), warms_s=(40.0, 110.0))
@sizes(thins=(0.6, 0.85), opens=(0.5, 0.9))
class PumpWasLeftEngaged(Hidden):
    """The pump of a tipper was left engaged and drives its oil round without use: through narrow pipes, where
    thick oil resists with its flow, and through a valve, where it resists with the square. `warm`: the oil,
    by that work itself. thick_nm: in cold oil, flow_nm: at the valve, both at at_rads; thins: of thick_nm,
    gone when it is warm; opens: speed over at_rads, beyond which a second valve keeps the pressure even.
    Source: makers' manuals of tippers on pumps that were left engaged, and Watton, Fundamentals of Fluid
    Power Control (2009), on losses of open circuits; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2145).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.6)
        nm = p.thick_nm * (1.0 - p.thins * s.warm) * turns + p.flow_nm * np.minimum(turns, 0.6 + p.opens) ** 2
        s.warm = eased(s.warm, np.clip(nm * turns / 220.0, 0.0, 1.0), p.warms_s, dt)
        return -self.at_wheels(view, nm) * moving(view)
