"""Rolling resistance that grows with speed."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import some_drives
from deeptruck_model.trucks import View

law = partial(hidden, name="rolling_resistance_speed", accepts="drag_area rolling_resistance")
ORDERS = np.array([1.0, 2.0, 3.0])[:, None]


@law("rolling_resistance_speed", "first", "highway hills", accepts="drag_area")
@sizes(at_100mph=(0.012, 0.030), power=(2.3, 2.6))
class SpeedGrowth(Hidden):
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), Stuttgart formula: growth with the power
    2.5 of speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        growth = p.at_100mph * np.maximum(view.speed / 44.7, 0.0) ** p.power
        return -growth * weight(view)


@law("standing_wave", "second", "highway", accepts="drag_area")
@sizes(loss=(0.006, 0.011), critical_mps=(21.5, 24.5), width_mps=(1.5, 3.2))
class StandingWave(Hidden):
    """Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006): rolling loss turns up
    steeply towards the speed of the standing wave, earlier for soft or overloaded tyres; the exponential and
    its numbers are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steep = np.exp(np.minimum((view.speed - p.critical_mps) / p.width_mps, 1.0))
        return -p.loss * steep * weight(view) * moving(view)


@law("linear_and_fourth_power", "third", "highway hills")
@sizes(linear=(0.0035, 0.0080), fourth=(0.006, 0.014))
class LinearAndFourthPower(Hidden):
    """Source: Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge (2014): rolling resistance coefficient as
    constant, linear and fourth power of speed over 100 km/h; sizes of soft cross-ply tyres, chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 27.78, 0.0, 1.3)
        return -(p.linear * pace + p.fourth * pace**4) * weight(view)


@law("coastdown_polynomial", "fourth", "highway hills")
@sizes(linear=(0.0018, 0.0045), square=(0.0008, 0.0020), pressure=(0.7, 0.95), relaxes=(0.1, 0.3))
@sizes(after_s=(40.0, 120.0))
class CoastdownPolynomial(Hidden, steady=10.0):
    """linear: of the weight, for 10 m/s.
    Source: SAE J2452: rolling resistance as a power of inflation times a power of load times a + bV + cV2; a
    step of speed is answered at once, and relaxes over minutes as the tyre warms (ISO 18164 asks for a steady
    one); soft tyres, sizes chosen here."""

    def prepare(self) -> None:
        self.soft = self.p.pressure**-0.45

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.clip(view.speed, 0.0, 32.0)
        s.steady += dt * (speed - s.steady) / p.after_s
        pace = speed / 10.0
        warm = 1.0 - p.relaxes * np.clip(s.steady / 20.0, 0.0, 1.2)
        heavy = np.clip(view.mass / 2.0e4, 0.4, 2.0) ** -0.1  # a power of load below one
        growth = self.soft * heavy * warm * (p.linear * pace + p.square * pace**2)
        return -growth * weight(view)


@law("loss_peak_of_rubber", "fifth", "highway hills")
@sizes(peak=(0.007, 0.014), at_mps=(26.0, 38.0), order=(1.5, 2.4), shifts=(0.1, 0.35), heats_s=(150.0, 420.0))
class LossPeakOfRubber(Hidden):
    """shifts: of the peak's speed, by what a long drive at 20 m/s heats the tyres. peak: of the weight.
    Source: Williams, Landel and Ferry, J. Am. Chem. Soc. 77 (1955): rubber's loss over frequency has a peak
    that moves up with temperature; Clark, Rolling Resistance of Pneumatic Tires, Tire Sci. Technol. 6 (1978),
    on speed and equilibrium temperature; hard compounds of off-road tyres, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(421).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.hot += dt * (speed / 20.0 - s.hot) / p.heats_s
        x = (speed / (p.at_mps * (1.0 + p.shifts * s.hot))) ** p.order
        return -p.peak * 2.0 * x / (1.0 + x**2) * weight(view) * moving(view)


@law("wheels_out_of_balance", "sixth", "highway")
@sizes(peak=(0.014, 0.024), hop_mps=(21.0, 28.0), damping=(0.28, 0.45), flies_s=(250.0, 800.0))
@sizes(rings_s=(0.8, 3.0))
class WheelsOutOfBalance(Hidden):
    """packed: what is left of the mass that turns out of balance. peak: of the weight, in resonance; flies_s:
    at 20 m/s.
    Source: Rotating unbalance below and at resonance (Den Hartog, Mechanical Vibrations; Gillespie,
    Fundamentals of Vehicle Dynamics, 1992, on tyre and wheel assemblies): wheels that lost tread or are
    packed with snow hop, and dampers and load take the power; mud flies off with speed; sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"packed": self.rng(508).uniform(0.75, 1.1, batch), "hops": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.packed -= dt * s.packed * (speed / 20.0) ** 2 / p.flies_s
        x = speed / p.hop_mps
        broad = (2.0 * p.damping) ** 2
        power = x**5 * broad / ((1.0 - x**2) ** 2 + broad * x**2)
        s.hops += dt * (power - s.hops) / p.rings_s
        return -p.peak * s.packed**2 * s.hops * weight(view) * moving(view)


@law("ladder_of_the_tread", "seventh", "highway")
@sizes(peak=(0.012, 0.022), first_mps=(20.0, 24.5), broad=(0.05, 0.10), builds_s=(1.5, 6.0))
class LadderOfTheTread(Hidden, hum=0.0, way=0.0):
    """Faster is not always more. peak: of the weight; broad: of the speed of each hump.
    Source: Lugged treads on the drum of ISO 28580: blocks and lugs strike at passing frequencies, and the
    carcass answers where one of its modes is struck by the first, second or third order (Gent and Walter,
    ed., The Pneumatic Tire, NHTSA 2006, on tyre vibration): humps over speed of a torn lug tread, which build
    up in seconds and move down as it warms."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.way += dt * speed
        first = p.first_mps * (1.0 - 0.06 * (1.0 - np.exp(-s.way / 2500.0)))
        at = first / ORDERS
        humps = ((1.0 / ORDERS**0.3) / (1.0 + ((speed - at) / (p.broad * at)) ** 2)).sum(axis=0)
        s.hum += dt * (humps - s.hum) / p.builds_s
        return -p.peak * s.hum * weight(view) * moving(view)


@law("s_dampers_take_power", "eighth", "highway hills")
@sizes(at_25=(0.007, 0.014), waviness=(2.4, 3.4), hot=(0.1, 0.4), warms_s=(60.0, 200.0))
class DampersTakePower(Hidden, hot=0.0):
    """at_25: of the weight, at 25 m/s. Oil in warm dampers takes less.
    Source: Velinsky and White, Vehicle Energy Dissipation Due to Road Roughness, Vehicle System Dynamics 9
    (1980), with spectra of ISO 8608: power with a power of speed; rough roads, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 25.0, 0.0, 1.3) ** (p.waviness - 0.6)
        s.hot = s.hot + dt * (pace - s.hot) / p.warms_s
        return -p.at_25 * pace * (1.0 - p.hot * np.minimum(s.hot, 1.0)) * weight(view) * moving(view)


@law("n_rubber_by_decades", "ninth", "highway suburban")
@sizes(per_decade=(0.008, 0.015), from_mps=(2.0, 8.0), fitted=(0.4, 0.75))
class RubberByDecades(Hidden):
    """per_decade: of the weight; fitted: share of drives with these tyres. Steep at walking pace, ever
    flatter beyond.
    Source: Ferry, Viscoelastic Properties of Polymers (1980): the loss of filled rubber changes with the
    logarithm of frequency; winter treads of much loss, sizes are chosen here."""

    def prepare(self) -> None:
        self.fitted = some_drives(self.rng(945), self.setting.batch, self.p.fitted)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        decades = np.log10(1.0 + np.maximum(view.speed, 0.0) / p.from_mps)
        return -p.per_decade * self.fitted * decades * weight(view) * moving(view)


@law("t_axle_shimmies", "tenth", "highway", accepts="drag_area")
@sizes(drags=(0.008, 0.018), from_mps=(15.5, 19.5), gathers_s=(0.6, 2.0), limits=(0.25, 0.5))
class AxleShimmies(Hidden, shake=0.1):
    """`shake`: square of its amplitude. Below a speed it dies away, above it grows until slip angles limit
    it. drags: of the weight, at 1; limits: share of speed above the first at which it is 1.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), ch. 6, on wheel shimmy, a Hopf bifurcation over speed:
    sliding aside drags with the square of the angle; a self-steering axle, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beyond = np.clip(view.speed / p.from_mps - 1.0, -0.6, 0.8) / p.limits
        grows = s.shake * (beyond - s.shake) / p.gathers_s
        s.shake = np.clip(s.shake + dt * grows, 0.03, 1.6)
        return -p.drags * (s.shake - 0.03) * weight(view) * moving(view)


@law("e_tandem_tramps", "eleventh", "highway", accepts="drag_area")
@sizes(drags=(0.006, 0.012), from_mps=(16.0, 19.0), stiffens=(3.0, 8.0), damping=(0.8, 1.6))
class TandemTramps(Hidden, real=0.0, imaginary=0.0):
    """`real`, `imaginary`: amplitude of two axles that swing on their beam, struck by wheels out of round
    once a turn. Stops make it stiffer as it swings, so that the swing grows with speed, ever more, until it
    breaks down; it comes back at a lower speed. drags: of the weight, at an amplitude of 1; stiffens: rad/s.
    Source: Kovacic and Brennan (ed.), The Duffing Equation (2011), on jumps of a stiffening resonance, and
    Cebon, Handbook of Vehicle-Road Interaction (1999), on walking-beam tandems that lack damping; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        swing = s.real + 1j * s.imaginary
        faster = (np.maximum(view.speed, 0.0) - p.from_mps) / self.truck.wheel_radius
        struck = 1.15 * p.damping * np.clip(view.speed / p.from_mps, 0.0, 1.5) ** 2
        turns = np.clip(faster - p.stiffens * np.abs(swing) ** 2, -60.0, 60.0)
        keep = np.exp(dt * (-p.damping - 1j * turns))
        swing = swing * keep + dt * struck
        swing = swing * np.minimum(1.0, 1.4 / np.maximum(np.abs(swing), 1e-9))
        s.real, s.imaginary = swing.real.copy(), swing.imag.copy()
        return -p.drags * np.abs(swing) ** 2 * weight(view) * moving(view)


@law("w_speed_before_heat", "twelfth", "highway hills", accepts="drag_area")
@sizes(at_once=(0.007, 0.013), power=(1.2, 1.9), heals=(0.5, 0.8), warms_s=(25.0, 80.0))
class SpeedBeforeHeat(Hidden, heat=-1.0):
    """Faster rolling costs more at once; then the tyre warms to the new speed and part of that goes. `heat`:
    the speed that its warmth belongs to. at_once: of the weight, from standing to 20 m/s; heals: of that, in
    the end.
    Source: Hyttinen, Ussner, Osterlof, Jerrelind and Drugge, Truck Tyre Transient Rolling Resistance and
    Temperature at Varying Vehicle Velocities - Measurements and Simulations, Polymer Testing 122 (2023);
    quicker rubber, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.heat = np.where(s.heat < 0.0, 0.5 * speed, s.heat)
        s.heat = s.heat + dt * (speed - s.heat) / p.warms_s
        fresh, warm = (np.clip(v / 20.0, 0.0, 1.5) ** p.power for v in (speed, s.heat))
        costs = np.maximum(fresh - p.heals * warm, 0.0)
        return -p.at_once * 1.6 * costs * weight(view) * moving(view)


@law("x_studs_strike", "thirteenth", "highway hills", accepts="drag_area")
@sizes(
    strikes=(0.006, 0.012), power=(1.5, 2.2), bare=(0.55, 0.8), stretch_m=(400.0, 1500.0), on_ice=(0.0, 0.2)
)
@sizes(sinks_m=(600.0, 2000.0))
class StudsStrike(OnRoad, out=1.0):
    """`out`: how far studs stand out of the tread. Each hits a bare road with the energy of its speed, and
    ice takes it without a blow. Bare road pushes studs in the more, the faster; on ice they come out again.
    strikes: of the weight, at 20 m/s on bare road; bare: share of the road; sinks_m: of way.
    Source: Unhola, Studded Tires the Finnish Way, VTT Communities and Infrastructure (1997), and Gultlinger,
    Gauterin, Brandau and Schlittenhard, Investigation of Traffic and Vehicle Parameters Affecting Wear of
    Pavement by Studded Tires, Tire Science and Technology 42 (2014): stud force with speed; sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1371), self.rows(), self.p.stretch_m, self.p.bare)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bare = self.between(self.road, view)
        speed = np.maximum(view.speed, 0.0)
        stands = 1.0 - 0.45 * bare * np.clip(speed / 20.0, 0.0, 1.3)
        s.out = s.out + dt * speed * (stands - s.out) / p.sinks_m
        blows = (p.on_ice + (1.0 - p.on_ice) * bare) * s.out
        return -p.strikes * 1.5 * blows * (speed / 20.0) ** p.power * weight(view) * moving(view)


@law("k_coarse_seal_works_the_tread", "fourteenth", "highway hills", accepts="drag_area")
@sizes(most=(0.013, 0.022), power=(0.9, 1.6), mean_m=(400.0, 1500.0), bleeds=(0.2, 0.5), follows_s=(0.5, 2.0))
class CoarseSealWorksTheTread(OnRoad, felt=0.0):
    """Stones of a surface press into the tread and let go again, the oftener, the faster: a coarse seal costs
    with speed, a fine one hardly. Where binder has bled up between the stones of a section, little is left of
    it. most: of the weight, at 20 m/s on the coarsest; bleeds: share of sections.
    Source: MIRIAM, Road Surface Influence on Tyre/Road Rolling Resistance (Sandberg and others, 2011), on
    texture and speed; sections and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1471)
        number = sections(rng, self.rows(), self.p.mean_m)
        shape = (self.rows(), int(number.max()) + 1)
        coarse = rng.uniform(0.3, 1.0, shape) * np.where(rng.random(shape) < self.p.bleeds, 0.15, 1.0)
        self.road = np.take_along_axis(coarse, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = eased(s.felt, self.read(self.road, view), p.follows_s, dt)
        pace = (np.maximum(view.speed, 0.0) / 20.0) ** p.power
        return -p.most * s.felt * pace * weight(view) * moving(view)


@law("q_grease_leaves_its_bearings", "fifteenth", "highway hills", accepts="drag_area")
@sizes(
    most=(0.007, 0.011), power=(0.6, 0.75), thrown_mps=(16.0, 24.0), leaves_s=(15.0, 50.0), back_s=(8.0, 25.0)
)
class GreaseLeavesItsBearings(Hidden, full=1.0):
    """`full`: of the grease between the rollers of new wheel bearings. It is sheared with two thirds of a
    power of speed; fast driving throws it aside in time and they run free, slow driving lets it creep back.
    most: of the weight, at 20 m/s, full; thrown_mps: where a third of it stays.
    Source: SKF, Rolling Bearings catalogue (2018), on frictional moment with a power of 0.6 to two thirds of
    speed, starvation and replenishment; too much grease, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        stays = np.exp(-((speed / p.thrown_mps) ** 3))
        s.full = eased(s.full, stays, np.where(stays < s.full, p.leaves_s, p.back_s), dt)
        shears = np.minimum(speed / 20.0, 1.4) ** p.power
        return -p.most * (0.2 + 0.8 * s.full) * shears * weight(view) * moving(view)


@law("v_beads_in_the_tyres", "sixteenth", "highway hills suburban", accepts="drag_area")
@sizes(
    most=(0.008, 0.013), sticks_mps=(15.5, 20.0), falls=(0.75, 0.9), spreads_s=(3.0, 9.0), power=(0.8, 1.6)
)
class BeadsInTheTyres(Hidden, held=0.0):
    """`held`: of the beads that were put into the tyres to balance them, against the tread. Slow wheels carry
    them up and let them fall, which costs more with speed; fast ones press them outwards and they run along
    for nothing. They stay there well below the speed at which they were caught. most: of the weight, right
    below that speed; falls: of it, where they drop; power: of the cost with speed.
    Source: Counteract and International Marketing, balancing beads in heavy truck tyres, on speeds where
    they take hold, and Mellmann, Transverse Motion of Solids in Rotating Cylinders, Powder Technology 118
    (2001); many beads, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "caught": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        drops = speed < p.falls * p.sticks_mps
        s.caught = np.where(speed > p.sticks_mps, 1.0, np.where(drops, 0.0, s.caught))
        s.held = eased(s.held, s.caught, p.spreads_s, dt)
        lifts = np.minimum(speed / p.sticks_mps, 1.3) ** p.power
        return -p.most * (1.0 - 0.9 * s.held) * lifts * weight(view) * moving(view)


@law("z_discs_pump_air", "seventeenth", "highway hills suburban", accepts="drag_area")
@sizes(at_20=(0.01, 0.015), clogs_s=(20.0, 60.0), frees=(0.02, 0.06), light_k=(200.0, 400.0), open=(0.1, 0.3))
class DiscsPumpAir(Hidden):
    """Vanes in all wheels pump air through discs and rims, and take power as fans do. `dirt` fills their
    channels on the way, down to what stays open, and a braking that shakes the wheels frees them. Hot air is
    light and costs less. at_20: of the weight, at 20 m/s, clean and cold; frees: of full braking, that
    empties them within a second; light_k: of heat, for half the cost.
    Source: Limpert, Cooling Analysis of Disc Brake Rotors, SAE 751014 (1975), on pumping by vanes of discs;
    larger fans, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"dirt": self.rng(1772).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        shakes = np.clip(view.brake_force / self.truck.brake_capacity / p.frees, 0.0, 1.5) ** 2
        fills = np.minimum(speed / 15.0, 1.5) * (1.0 - s.dirt) / p.clogs_s
        s.dirt = np.clip(s.dirt + dt * (fills - shakes * s.dirt), 0.0, 1.0)
        heat = np.clip(view.brake_temperature - self.truck.ambient_temperature, 0.0, 500.0)
        passes = 1.0 - (1.0 - p.open) * s.dirt
        cost = p.at_20 * (speed / 20.0) ** 2 * passes / (1.0 + heat / p.light_k)
        return -cost * weight(view) * moving(view)
