"""Wheels that slip."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, Bends, OnRoad, smooth_stretches, stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="wheel_slip")


@law("wheel_slip", "first", "suburban hills")
@sizes(c1=(0.12, 0.22), c3=(0.02, 0.06), share_of_time=(0.1, 0.35))
class SlipperyRoad(Hidden, slip=0.0):
    """Source: Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme (1993): friction c1(1-exp(-c2 s)) - c3 s
    on snow and wet ice, with a driven wheel that spins up and catches again."""

    def prepare(self) -> None:
        rng = self.rng(5)
        noise = ou_series(rng, (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 25.0)
        self.slippery = noise < np.quantile(noise, self.p.share_of_time)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        here = self.slippery[:, index(view, self.slippery)]
        load = self.truck.drive_axle_share * weight(view)
        friction = p.c1 * (1.0 - np.exp(-40.0 * np.maximum(s.slip, 0.02))) - p.c3 * s.slip
        grip = np.maximum(friction, 0.03) * load
        pull = np.maximum(view.traction_force, 0.0)
        s.slip = np.clip(s.slip + dt * (pull - grip) / (0.04 * weight(view)), 0.0, 1.0)
        lost = np.maximum(pull - grip, 0.0)
        brake_lost = np.maximum(
            view.brake_force - 1.15 * p.c1 * weight(view), 0.0
        )  # anti-lock keeps near the peak
        return np.where(here, brake_lost * moving(view) - lost, 0.0)


@law("traction_control_hunts", "second", "suburban hills")
@sizes(friction=(0.10, 0.19), cut=(0.3, 0.6), back_s=(1.0, 2.5), gap_m=(150.0, 450.0))
class TractionControl(OnRoad, given=1.0):
    """Saw teeth of traction on icy stretches; brakes there are held just below locking.
    Source: Slip control cuts torque when wheels spin and gives it back by a ramp until they spin again:
    Automotive Handbook (Bosch), on traction control; friction of compacted snow and ice 0.1-0.3 (Wong, Theory
    of Ground Vehicles); where the ice lies is chosen here."""

    def prepare(self) -> None:
        gap = self.p.gap_m
        road = smooth_stretches(self.rng(153), self.rows(), (0.5 * gap, 1.5 * gap), (120.0, 350.0))
        self.road = (road > 0.15).astype(float)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        shift = 0.25 * (np.clip(view.acceleration, -2.0, 2.0) / GRAVITY + view.grade)  # h / wheelbase
        grip = p.friction * self.truck.drive_axle_share * weight(view) * (1.0 + shift)
        icy = self.read(self.road, view) > 0.0
        pull = np.maximum(view.traction_force, 0.0)
        spins = icy & (s.given * pull > grip)
        s.given = np.where(spins, s.given * (1.0 - p.cut), np.minimum(s.given + dt / p.back_s, 1.0))
        lost = (1.0 - s.given) * pull
        held = np.maximum(view.brake_force - 0.9 * p.friction * weight(view), 0.0) * icy
        return held * moving(view) - lost


@law("film_on_the_road", "third", "suburban hills", accepts="torque_limit")
@sizes(friction=(0.11, 0.20), scale_mps=(25.0, 50.0), share_of_time=(0.4, 0.8))
class FilmOnTheRoad(Hidden):
    """Pull and brake force are squeezed below the grip before they reach it.
    Source: Wet friction falling exponentially with sliding speed (PIARC model, Wambold and others, 1995);
    smooth saturation of a brush tyre (Pacejka, Tyre and Vehicle Dynamics, 2012); leaves or diesel that lie
    from a moment of the drive on, chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(253), self.setting.batch
        self.from_s = (1.0 - self.p.share_of_time) * rng.uniform(0.0, 1.6, batch) * self.setting.duration_s

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wet = np.clip((view.time - self.from_s) / 8.0, 0.0, 1.0)
        grip = p.friction * np.exp(-np.maximum(view.speed, 0.0) / p.scale_mps) * weight(view)
        driven = self.truck.drive_axle_share * grip
        pull = np.maximum(view.traction_force, 0.0)
        braked = view.brake_force - 1.2 * grip * np.tanh(view.brake_force / (1.2 * grip))
        return wet * (braked * moving(view) - (pull - driven * np.tanh(pull / driven)))


@law("digs_itself_in", "sixth", "suburban hills")
@sizes(shears=(0.24, 0.40), bogs=(0.015, 0.035), digs_m=(5.0, 16.0), climbs_m=(8.0, 30.0))
class DigsItselfIn(OnRoad, sunk=0.0):
    """A start with much torque costs for metres after. shears: of the driven axles' load; bogs: of the
    weight, dug in to the rims.
    Source: Slip and sinkage (Bekker, Introduction to Terrain-Vehicle Systems, 1969; Wong, Theory of Ground
    Vehicles, on shear and slip-sinkage): driven wheels shear loose ground, dig in by what they slip, and have
    to climb out of it over some metres; sites on the way, strengths chosen here."""

    def prepare(self) -> None:
        rng = self.rng(510)
        self.loose = np.zeros((self.rows(), CELLS))
        for row in self.loose:
            for first, last in stretches(rng, (80.0, 350.0), (120.0, 600.0)):
                row[first:last] = rng.uniform(0.7, 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        loose = self.read(self.loose, view)
        most = p.shears * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        lost = (pull - most * np.tanh(pull / most)) * loose
        slips = np.minimum((pull / most) ** 2, 2.0) * loose
        way = dt * (np.maximum(view.speed, 0.0) + 0.3 * slips)
        s.sunk = np.clip(s.sunk + way * (slips * (1.0 - s.sunk) / p.digs_m - s.sunk / p.climbs_m), 0.0, 1.0)
        return -lost - p.bogs * s.sunk * weight(view) * moving(view)


@law("wheels_spin_on_basalt", "seventh", "suburban hills")
@sizes(peak=(0.14, 0.20), falls=(0.15, 0.3), at_slip=(0.03, 0.09), inertia=(0.05, 0.11))
class WheelsSpinOnBasalt(OnRoad, spins=0.0):
    """`spins` m/s of the treads over the truck; what they gain they give back on the next dry metres. peak:
    friction of the driven wheels; falls: of it, lost when they spin; inertia: of the mass.
    Source: Watered basalt tiles of test tracks and friction over slip after Burckhardt, Fahrwerktechnik:
    Radschlupf-Regelsysteme (1993), with the wheels' own inertia: they spin up beyond the peak and come back
    only when the torque has."""

    def prepare(self) -> None:
        rng = self.rng(705)
        self.wet = np.zeros((self.rows(), CELLS))
        for row in self.wet:
            for first, last in stretches(rng, (60.0, 300.0), (80.0, 450.0)):
                row[first:last] = rng.uniform(0.85, 1.15)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wet = self.read(self.wet, view)
        load = self.truck.drive_axle_share * view.mass * GRAVITY
        slip = s.spins / np.maximum(view.speed + s.spins, 2.0)
        rises = 1.0 - np.exp(-3.0 * slip / p.at_slip)
        friction = p.peak * wet * (rises - p.falls * np.clip(slip, 0.0, 1.0))
        grips = np.where(wet > 0.0, friction, 0.5 * rises) * load
        wheel = np.maximum(view.traction_force, 0.0)
        turning = (wheel - grips) / (p.inertia * view.mass)
        s.spins = np.clip(s.spins + dt * np.clip(turning, -20.0, 20.0), 0.0, 8.0)
        loose = (wet > 0.0) | (s.spins > 0.3)
        return np.where(loose, np.clip(grips - wheel, -wheel, 0.08 * weight(view)), 0.0) * moving(view)


@law("s_first_rain", "eighth", "suburban hills")
@sizes(friction=(0.09, 0.17), wet_s=(15.0, 50.0), dry_s=(20.0, 60.0), washes_s=(40.0, 150.0))
class FirstRain(Hidden, film=0.0, wash=0.0, lost=0.0):
    """The first minute of rain is the slipperiest, brakes suffer as the drive does.
    Source: Eisenberg, The Mixed Effects of Precipitation on Traffic Crashes, Accident Analysis and Prevention
    36 (2004): oil that gathered in dry days floats up and is washed off; friction is chosen here."""

    def prepare(self) -> None:
        p = self.p
        rain = (p.wet_s, 2.0 * p.wet_s)
        self.rain = spells(self.rng(833), self.setting.batch, rain, (0.5 * p.dry_s, p.dry_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rains = within(self.rain, view.time)
        s.film = s.film + dt * (rains - s.film) / np.where(rains > s.film, 3.0, 15.0)
        s.wash = np.clip(s.wash + dt * (rains / p.washes_s - (1.0 - rains) / 200.0), 0.0, 1.0)
        grip = p.friction + 0.25 * s.wash + 0.5 * (1.0 - np.clip(1.6 * s.film, 0.0, 1.0))
        most = grip * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        s.lost = s.lost + dt * (np.maximum(pull - most, 0.0) - s.lost) / 0.15
        braked = np.maximum(view.brake_force - 1.3 * grip * weight(view), 0.0)
        return braked * moving(view) - np.minimum(s.lost, pull)


@law("n_floats_when_light", "ninth", "highway hills")
@sizes(friction=(0.22, 0.34), floats_mps=(21.0, 27.0), share=(0.35, 0.6), mean_m=(250.0, 800.0))
class FloatsWhenLight(OnRoad, lost=0.0):
    """Where water stands, what the tyres press on the road falls with the square of speed.
    Source: Horne, Yager and Ivey, Recent Studies to Investigate Effects of Tire Footprint Aspect Ratio on
    Dynamic Hydroplaning Speed, ASTM STP 929 (1986): lightly loaded truck tyres float at road speeds; friction
    and stretches are chosen here."""

    def prepare(self) -> None:
        self.water = windows(self.rng(943), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        water = self.between(self.water, view)
        presses = np.clip(1.0 - (np.maximum(view.speed, 0.0) / p.floats_mps) ** 2, 0.2, 1.0)
        grip = p.friction * presses + 0.6 * (1.0 - water)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - grip * self.truck.drive_axle_share * weight(view), 0.0)
        s.lost = s.lost + dt * (over - s.lost) / 0.2
        braked = np.maximum(view.brake_force - 1.5 * grip * weight(view), 0.0)
        return braked * moving(view) - np.minimum(s.lost, pull)


@law("e_diagonal_wheels_hang", "eleventh", "suburban hills")
@sizes(grip=(0.22, 0.34), twists=(0.4, 0.7), inertia=(0.04, 0.09), apart_m=(80.0, 260.0))
class DiagonalWheelsHang(OnRoad, spins=0.0, lost=0.0, twist=0.0):
    """Where the ground is twisted one driven wheel presses little, and an open differential gives the other
    no more pull than that one holds. `spins` m/s of it over the road. twists: of a wheel's load, standard
    deviation in a bad stretch.
    Source: Wong, Theory of Ground Vehicles (2008), on the traction of driven axles whose wheels hold unlike,
    with an open differential; wet gravel tracks, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1072), self.p
        rough = smooth_stretches(rng, self.rows(), (0.5 * p.apart_m, 1.5 * p.apart_m), (90.0, 300.0))
        waves = ou_series(rng, rough.shape, CELL_M, 12.0)
        self.road = p.twists * np.sqrt(rough) * waves
        self.bad = np.sqrt(rough)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bad = self.read(self.bad, view)
        s.twist = s.twist + dt * (self.read(self.road, view) - s.twist) / 0.12
        least = np.clip(1.0 - np.abs(s.twist), 0.08, 1.0)
        grip = p.grip + 0.5 * (1.0 - np.clip(2.0 * bad, 0.0, 1.0))
        slides = 1.0 - 0.25 * np.clip(s.spins / 1.5, 0.0, 1.0)
        holds = grip * slides * least * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        turning = np.clip((pull - holds) / (p.inertia * view.mass), -12.0, 12.0)
        s.spins = np.clip(s.spins + dt * turning, 0.0, 5.0)
        s.lost = s.lost + dt * (np.maximum(pull - holds, 0.0) - s.lost) / 0.12
        all_wheels = (0.35 + 0.65 * least) * grip * weight(view)
        held = np.maximum(view.brake_force - all_wheels, 0.0)
        return held * moving(view) - np.minimum(s.lost, pull)


@law("w_grip_goes_to_the_bend", "twelfth", "suburban hills", accepts="torque_limit")
@sizes(grip=(0.17, 0.25), driven=(0.32, 0.42), care=(0.75, 0.95), finds_s=(0.15, 0.4), edge=(0.7, 0.85))
class GripGoesToTheBend(Bends, lost=0.0):
    """On a greasy road driven wheels have what a bend leaves of their grip, and slip beyond. grip: of the
    road; driven: of the weight; care: most of the grip that drivers give to bends; edge: of what is left,
    from where they begin to slip.
    Source: Wong, Theory of Ground Vehicles (2008), and Milliken and Milliken, Race Car Vehicle Dynamics
    (1995), on the friction circle; harvest dirt in the rain, bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1173), 0.02)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        aside = np.minimum(view.speed**2 * np.abs(self.read(self.bend, view)) / (GRAVITY * p.grip), p.care)
        most = p.grip * p.driven * np.sqrt(1.0 - aside**2) * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        beyond = np.maximum(pull / np.maximum(most, 1.0) - p.edge, 0.0)
        carries = np.where(beyond > 0.0, p.edge + (1.0 - p.edge) * np.tanh(beyond / (1.0 - p.edge)), 0.0)
        slips = np.where(beyond > 0.0, pull - most * carries, 0.0)
        s.lost = s.lost + dt * (slips - s.lost) / p.finds_s
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("k_leaves_then_sand", "fourteenth", "suburban hills")
@sizes(leaves=(0.07, 0.11), sanded=(0.24, 0.32), driven=(0.34, 0.44), waits_s=(0.8, 2.0), lasts_s=(4.0, 12.0))
@sizes(mean_m=(200.0, 600.0), share=(0.5, 0.7), finds_s=(0.15, 0.4))
class LeavesThenSand(OnRoad, lost=0.0, spins=0.0, left=0.0, sand=0.0, store=1.0):
    """Wet leaves lie under the trees. When driven wheels have spun on them for a moment, sand is blown before
    them for some seconds, and they hold; `store` of it is used up in time. leaves, sanded: grip; driven: of
    the weight; share: of the road, with leaves.
    Source: Olofsson and Sundvall, Influence of Leaf, Humidity and Applied Lubrication on Friction in the
    Wheel-Rail Contact, Proc. IMechE F 218 (2004), on films of leaves; sanders of trucks, sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1474), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        slips = s.lost > 0.08 * pull + 1.0
        s.spins = np.where(slips, s.spins + dt, 0.0)
        calls = (s.spins > p.waits_s) & (s.store > 0.0)
        s.left = np.where(calls, p.lasts_s, np.maximum(s.left - dt, 0.0))
        s.store = np.maximum(s.store - dt * (s.left > 0.0) / (6.0 * p.lasts_s), 0.0)
        s.sand = eased(s.sand, np.where(s.left > 0.0, 1.0, 0.0), 0.6, dt)
        most = np.maximum((p.leaves + (p.sanded - p.leaves) * s.sand) * p.driven * weight(view), 1.0)
        asks = pull / most
        over = np.maximum(asks - 0.7, 0.0)
        holds = most * (np.minimum(asks, 0.7) + 0.3 * np.tanh(over / 0.3))
        wish = (pull - holds) * self.between(self.road, view)
        s.lost = eased(s.lost, wish, p.finds_s, dt)
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("v_hops_off_its_grip", "sixteenth", "suburban hills")
@sizes(grip=(0.26, 0.36), leaves=(0.6, 0.8), at_mps=(3.5, 8.0), wide_mps=(2.5, 4.5), mean_m=(120.0, 450.0))
@sizes(share=(0.4, 0.65), hops_s=(0.4, 1.0))
class HopsOffItsGrip(OnRoad, hops=0.0, lost=0.0):
    """`hops`: of driven wheels on a corrugated road. Where ripples come as fast as the axle likes to bounce
    the wheels are half the time in the air and cannot pull; slower or faster they can. A wheel that pulls
    hard bounces more. grip: of their load, on gravel; leaves: of that, lost at at_mps; wide_mps: half the
    width of that.
    Source: Both, Hong and Kurtze, Corrugation of Roads, Physica A 301 (2001), on wheels that bounce on
    ripples, and Wong, Theory of Ground Vehicles (2008), on thrust; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1671), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gravel, pull = self.between(self.road, view), np.maximum(view.traction_force, 0.0)
        tune = np.exp(-(((view.speed - p.at_mps) / p.wide_mps) ** 2))
        works = np.clip(0.5 + pull / (0.08 * weight(view)), 0.5, 1.0)
        s.hops = eased(s.hops, gravel * tune * works, p.hops_s, dt)
        most = 0.35 * p.grip * (1.0 - p.leaves * s.hops) * weight(view)
        spins = np.maximum(pull - most * np.tanh(pull / most), 0.0)
        s.lost = eased(s.lost, gravel * spins, 0.25, dt)
        return -np.minimum(s.lost, pull) * moving(view)


@law("z_slip_melts_the_rubber", "seventeenth", "suburban hills")
@sizes(grip=(0.19, 0.28), melts=(0.35, 0.6), heats_s=(0.6, 1.6), cools_s=(4.0, 12.0), mean_m=(120.0, 450.0))
@sizes(share=(0.45, 0.7))
class SlipMeltsTheRubber(OnRoad, hot=0.0, lost=0.0):
    """`hot`: the skin of driven tyres on polished stone. Pull near their grip makes them slip, slip melts
    the rubber, and molten rubber grips less. So a spin feeds itself until the driver gives way, and cools
    in seconds. grip: of their load, cold; melts: of that, when hot.
    Source: Persson, Rubber Friction: Role of the Flash Temperature, J. Physics: Condensed Matter 18 (2006),
    on grip that falls with the heat of sliding, and Wong, Theory of Ground Vehicles (2008); sizes are
    chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1771), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stone, pull = self.between(self.road, view), np.maximum(view.traction_force, 0.0)
        most = 0.35 * p.grip * (1.0 - p.melts * s.hot) * weight(view)
        holds = pull / (1.0 + (pull / most) ** 4) ** 0.25
        s.lost = eased(s.lost, stone * (pull - holds), 0.25, dt)
        slides = np.clip(s.lost / (0.04 * weight(view)), 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (slides * (1.0 - s.hot) / p.heats_s - s.hot / p.cools_s), 0.0, 1.0)
        return -np.minimum(s.lost, pull) * moving(view)
