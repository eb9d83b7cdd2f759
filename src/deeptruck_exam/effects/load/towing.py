"""What is towed or pushes. The tool has no name for it."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELL_M, Bends, OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("hitch_spring", "first", "suburban", trucks="trucksim volvo")
@sizes(trailer_share=(0.2, 0.4), hz=(0.9, 1.8), damping=(0.06, 0.15), play_m=(0.002, 0.012))
class Drawbar(Hidden, stretch=0.0, rate=0.0):
    """Source: Two masses on a spring with free play, fore and aft: textbook vibration of a towed vehicle;
    frequency and damping are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        elastic = np.sign(s.stretch) * np.maximum(np.abs(s.stretch) - p.play_m, 0.0)
        turning = -(omega**2) * elastic - 2.0 * p.damping * omega * s.rate - view.acceleration
        s.rate += dt * turning
        s.stretch = np.clip(s.stretch + dt * s.rate, -0.4, 0.4)
        return -p.trailer_share * view.mass * np.clip(turning, -3.0, 3.0) * moving(view)


@law("pushed_by_a_second_tractor", "fourth", "hills highway")
@sizes(per_mps=(0.012, 0.03), most=(0.03, 0.06), late_s=(1.5, 4.0), pace_s=(20.0, 45.0))
class PushedByASecondTractor(Hidden, pace=-1.0, heard=0.0, force=0.0):
    """per_mps, most: over weight. A truck that slows by its own brakes is not pushed.
    Source: Heavy haulage with a pusher (Specialized Carriers and Rigging Association guides; police permits
    for heavy loads): its driver helps when the train falls behind the pace of the last half minute, told by
    radio some seconds late, and eases off once it is back; gains are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pace = np.where(s.pace < 0.0, view.speed, s.pace)
        s.pace += dt * (view.speed - s.pace) / np.where(view.speed > s.pace, 4.0, p.pace_s)
        behind = np.maximum(s.pace - view.speed - 0.5, 0.0) * (view.u[:, 1] <= 0.02)
        s.heard += dt * (behind - s.heard) / p.late_s
        wanted = np.minimum(p.per_mps * s.heard, p.most) * weight(view)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 1.2, 0.5)
        return s.force * (view.u[:, 1] <= 0.02) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("tow_rope", "fifth", "suburban hills")
@sizes(towed=(0.12, 0.26), metres=(0.3, 0.9), rolls=(0.010, 0.020), brakes=(0.3, 0.9), late_s=(0.5, 1.3))
class TowRope(Hidden, slack=0.1, behind=-1.0, foot=0.0):
    """`slack` m, negative when the rope is stretched; `behind` m/s, the towed vehicle's speed. towed: of the
    truck's mass; metres: stretch under a tenth of the towed weight; brakes: m/s2.
    Source: Recovery on a rope: it pulls when it is tight and never pushes; whoever steers behind brakes when
    it goes slack (police and breakdown guides on towing); elasticity of polyester straps from makers'
    elongation tables; masses and habits are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.behind = np.where(s.behind < 0.0, view.speed, s.behind)
        slower = s.behind - view.speed
        pull = np.maximum(-s.slack, 0.0) * 0.981 / p.metres
        pull = np.clip(pull * (1.0 - np.clip(3.0 * slower, -0.8, 0.8)), 0.0, 2.2)  # m/s2 of the towed mass
        loose = np.clip(s.slack / 0.4, 0.0, 1.0) * p.brakes
        s.foot += dt * (loose - s.foot) / p.late_s
        resists = 9.81 * (p.rolls * (s.behind > 0.05) + view.grade) + s.foot
        s.behind = np.maximum(s.behind + dt * (pull - resists), 0.0)
        s.slack = np.clip(s.slack + dt * slower, -2.5, 3.0)
        return -p.towed * view.mass * pull * moving(view)


@law("towed_dynamometer", "seventh", "highway hills suburban")
@sizes(pull=(0.010, 0.022), step_s=(12.0, 35.0), ramps_s=(1.0, 4.0), from_mps=(5.0, 9.0))
class TowedDynamometer(Hidden, pull=0.0):
    """Levels follow each other by the clock, whatever the truck does.
    Source: Towing dynamometers of proving grounds (Wong, Theory of Ground Vehicles, on drawbar tests): a
    programme of pulls in steps, held by a control on the coupling's force above a speed."""

    def prepare(self) -> None:
        rng, batch = self.rng(721), self.setting.batch
        levels = np.array([0.0, 0.0, 0.35, 0.7, 1.0])
        self.levels = rng.permuted(np.tile(levels, (batch, 8)), axis=1)
        self.first = rng.uniform(0.0, 1.0, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        step = (view.time / p.step_s + self.first).astype(int) % self.levels.shape[1]
        level = self.levels[np.arange(len(step)), step]
        wanted = level * np.clip(view.speed - p.from_mps, 0.0, 1.0)
        s.pull += dt * (wanted - s.pull) / p.ramps_s
        return -p.pull * s.pull * weight(view) * moving(view)


@law("s_winch_assist", "eighth", "hills")
@sizes(tension=(0.012, 0.028), from_slope=(0.008, 0.02), winds_s=(1.0, 4.0), slack_m=(20.0, 80.0))
class WinchAssist(Hidden, on=0.0, taken=0.0, tight=0.0):
    """tension: of the weight, while it climbs. The rope is taken up over the way first.
    Source: Visser and Stampfer, Expanding Ground-Based Harvesting onto Steep Terrain, Croatian Journal of
    Forest Engineering 36 (2015): a winch uphill holds a set tension; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        below = view.grade < 0.4 * p.from_slope
        s.on = np.where(view.grade > p.from_slope, 1.0, np.where(below, 0.0, s.on))
        rolled = dt * np.maximum(view.speed, 0.0)
        s.taken = np.where(s.on > 0.0, np.minimum(s.taken + rolled / p.slack_m, 1.0), 0.0)
        s.tight = s.tight + dt * ((s.taken >= 1.0) - s.tight) / p.winds_s
        return p.tension * s.tight * weight(view) * np.clip(view.speed - 0.5, 0.0, 1.0)


@law("s_pays_out_cable", "eighth", "suburban")
@sizes(most=(0.014, 0.028), way_m=(80.0, 260.0), cut_s=(1.0, 3.0))
class PaysOutCable(Hidden, out=0.0, stood=0.0):
    """most: of the weight. It drags the more the longer the way since the last stand.
    Source: A cable that is laid slides behind the truck with friction along its length (Buehler and others,
    Guide for cable pulling, IEEE Std 1185, on pulling tension); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        rolled = dt * np.maximum(view.speed, 0.0)
        s.out = np.where(s.stood > p.cut_s, 0.0, s.out + (1.0 - s.out) * rolled / p.way_m)
        return -p.most * s.out * weight(view) * moving(view)


@law("n_skid_trailer_locks_its_wheels", "ninth", "highway suburban")
@sizes(force=(0.025, 0.05), every_m=(120.0, 350.0), locks_s=(1.0, 2.5), fades_mps=(15.0, 40.0))
class SkidTrailerLocksItsWheels(Hidden, left=0.0, locked=0.0):
    """A trailer that measures skid resistance locks its wheels for a moment, every so many metres. force: of
    the weight, at walking pace; fades_mps: speed over which wet friction falls.
    Source: ASTM E274, Standard Test Method for Skid Resistance of Paved Surfaces Using a Full-Scale Tire; a
    heavy one that tests at any speed, intervals and sizes are chosen here."""

    def prepare(self) -> None:
        self.first_m = self.rng(912).uniform(0.0, self.p.every_m, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "next": self.first_m.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = view.distance > s.next
        s.next = np.where(begins, view.distance + p.every_m, s.next)
        s.left = np.where(begins, p.locks_s, np.maximum(s.left - dt, 0.0))
        s.locked = s.locked + dt * ((s.left > 0.0) - s.locked) / 0.15
        grips = np.exp(-np.maximum(view.speed, 0.0) / p.fades_mps)
        return -p.force * s.locked * grips * weight(view) * moving(view)


@law("n_jet_of_the_monitor", "ninth", "suburban hills")
@sizes(thrust=(0.012, 0.028), sweeps_rad=(0.5, 1.6), turns_s=(12.0, 40.0), sprays_s=(20.0, 60.0))
class JetOfTheMonitor(Hidden, pressure=0.0):
    """A jet pushes the truck the other way; the nozzle is swept from side to side about any direction.
    thrust: of the weight.
    Source: Momentum of a jet, mass flow times speed, as tables of nozzle reaction give it (Fire Protection
    Handbook, NFPA); a monitor that sprays on the way, spells and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p, batch = self.rng(913), self.p, self.setting.batch
        self.spells = spells(rng, batch, (0.6 * p.sprays_s, 1.4 * p.sprays_s), (10.0, 40.0))
        self.aim = rng.choice([0.0, 0.0, np.pi], batch) + rng.normal(0.0, 0.4, batch)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pressure = s.pressure + dt * (within(self.spells, view.time) - s.pressure) / 1.2
        swept = p.sweeps_rad * np.sin(2.0 * np.pi * view.time / p.turns_s + self.phase)
        return -p.thrust * s.pressure * np.cos(self.aim + swept) * weight(view) * moving(view)


@law("n_brush_has_its_own_speed", "ninth", "suburban")
@sizes(rubs=(0.012, 0.025), tip_mps=(5.0, 10.0), soft_mps=(0.8, 3.0), down_s=(25.0, 70.0))
class BrushHasItsOwnSpeed(Hidden, down=0.0):
    """It pushes a truck that is slower than its bristles and holds a faster one. rubs: of the weight.
    Source: Coulomb friction by the sign of the sliding speed, smoothed by bristles that bend (Persson,
    Sliding Friction, 2000); a sweeper's broom that is driven at a set speed, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        self.spells = spells(
            self.rng(914), self.setting.batch, (0.6 * p.down_s, 1.4 * p.down_s), (10.0, 40.0)
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.down = s.down + dt * (within(self.spells, view.time) - s.down) / 1.5
        slides = np.tanh((p.tip_mps - view.speed) / p.soft_mps)
        return p.rubs * s.down * slides * weight(view) * moving(view)


@law("t_drags_logs", "tenth", "suburban hills")
@sizes(drags=(0.009, 0.02), ploughs=(0.2, 0.7), heaps_m=(30.0, 140.0), takes_s=(1.5, 4.0))
class DragsLogs(Hidden, stood=0.0, stops=0.0, heap=0.0):
    """Logs lie with one end on the ground and push up a heap of earth before them; at each stand that lasts
    some are put down or taken on. drags: of the truck's weight; ploughs: more of it, with the whole heap.
    Source: Hassan and Gustafson, Factors Affecting Tree Skidding Forces, Transactions of the ASAE 26 (1983):
    friction on the ground and soil pushed ahead; bundles and soils are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(987), (self.setting.batch, 200)
        self.loads = rng.uniform(0.4, 1.1, shape) * (rng.random(shape) < 0.7)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        s.stops = s.stops + ((stood >= p.takes_s) & (s.stood < p.takes_s))
        s.stood = stood
        load = self.loads[np.arange(len(stood)), s.stops.astype(int) % self.loads.shape[1]]
        grows = np.maximum(view.speed, 0.0) * (1.0 - s.heap) / p.heaps_m
        s.heap = np.where(stood > 0.5, 0.0, s.heap + dt * grows)
        return -p.drags * load * (1.0 + p.ploughs * s.heap) * weight(view) * moving(view)


@law("x_box_fills_with_earth", "thirteenth", "suburban hills descent")
@sizes(cuts=(0.006, 0.012), pushes=(0.02, 0.035), fills_m=(15.0, 50.0), spills_m=(40.0, 120.0))
@sizes(mean_m=(120.0, 350.0), floats_mps=(12.0, 16.0))
class BoxFillsWithEarth(OnRoad, heap=0.0):
    """`heap` in a box that is towed to level the verge: hard places are cut and fill it, holes empty it, and
    what it carries has to be pushed. Too fast it floats up. cuts: of the weight, on the hardest; pushes: of
    the weight, full.
    Source: McKyes, Soil Cutting and Tillage (1985), and Reece, The Fundamental Equation of Earth-Moving
    Mechanics, Proc. IMechE (1964-65): cohesion and surcharge before a blade; places and sizes are chosen
    here."""

    def prepare(self) -> None:
        rng = self.rng(1352)
        number = sections(rng, self.rows(), self.p.mean_m)
        hard = rng.choice([-0.6, 0.0, 0.5, 1.0], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(hard, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hard = self.read(self.road, view)
        down = np.clip((p.floats_mps - view.speed) / 2.0, 0.15, 1.0)
        way = dt * np.maximum(view.speed, 0.0)
        takes = np.maximum(hard, 0.0) * down * (1.0 - s.heap) / p.fills_m
        drops = (0.3 + np.maximum(-hard, 0.0) * 2.0 + 1.0 - down) * s.heap / p.spills_m
        s.heap = np.clip(s.heap + way * (takes - drops), 0.0, 1.0)
        drag = p.pushes * s.heap**1.3 + p.cuts * np.maximum(hard, 0.0) * down
        return -drag * weight(view) * np.clip(view.speed, 0.0, 1.0)


@law("k_sledge_on_its_film", "fourteenth", "suburban hills highway")
@sizes(
    dry=(0.008, 0.015), film=(0.45, 0.7), sucks=(0.004, 0.008), melts_m=(200.0, 700.0), dries_s=(20.0, 60.0)
)
@sizes(freezes_s=(4.0, 15.0), grips=(0.01, 0.025), tears_m=(4.0, 15.0))
class SledgeOnItsFilm(Hidden, wet=0.3, stuck=0.0):
    """A sledge is towed over a winter road. Its runners rub dry until they have melted a film, `wet`, which
    carries them well and sucks the more, the faster; it freezes away when slow. At stands the runners freeze
    down, `stuck`, and have to be torn off. dry, sucks, grips: of the weight, the second at 20 m/s; film: of
    the dry friction, spared.
    Source: Colbeck, A Review of the Processes that Control Snow Friction, CRREL Monograph 92-2 (1992): dry
    friction, lubrication and capillary drag; a sledge behind a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        melts, dries = speed / p.melts_m, 1.0 / p.dries_s
        s.wet = eased(s.wet, melts / (melts + dries), 1.0 / (melts + dries), dt)
        rests = speed < 0.3
        s.stuck = eased(
            s.stuck, np.where(rests, 1.0, 0.0), np.where(rests, p.freezes_s, p.tears_m / (speed + 0.1)), dt
        )
        costs = p.dry * (1.0 - p.film * s.wet) + p.sucks * s.wet * (speed / 20.0) ** 1.5 + p.grips * s.stuck
        return -costs * weight(view) * moving(view)


@law("q_casualty_turns_its_gearbox", "fifteenth", "suburban hills")
@sizes(thick=(0.005, 0.009), runs_dry=(0.006, 0.012), warms_s=(40.0, 120.0), dries_m=(300.0, 1200.0))
@sizes(wets_s=(4.0, 15.0))
class CasualtyTurnsItsGearbox(Hidden, warm=0.0):
    """A broken truck is towed with its propeller shaft in place. Its gearbox turns backwards with cold oil,
    which grows thin; but without the countershaft nothing is splashed, bearings run `dry` over the way, and
    they rub until a stand lets oil flow back. thick, runs_dry: of the weight, the first at 20 m/s.
    Source: Eaton Fuller, heavy duty transmissions, Driver Instructions, on towing: pull the axle shafts or
    take off the propeller shaft, or the gearbox runs without oil; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "dry": self.rng(1553).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pace = np.minimum(speed / 20.0, 1.4)
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.1 + pace), dt)
        wets = np.clip(1.0 - speed / 2.0, 0.0, 1.0) / p.wets_s
        s.dry = np.clip(s.dry + dt * (speed / p.dries_m * (1.0 - s.dry) - wets * s.dry), 0.0, 1.0)
        costs = p.thick * (1.0 - 0.75 * s.warm) * pace + p.runs_dry * s.dry**1.5
        return -costs * weight(view) * moving(view)


@law("z_joint_is_damped", "seventeenth", "suburban hills highway")
@sizes(damps=(0.05, 0.11), rubs=(0.004, 0.008), tightest=(0.008, 0.016), soft=(0.02, 0.06), long_m=(4.0, 8.0))
class JointIsDamped(Bends, bent=0.0):
    """`bent`: angle between two halves of a bus with a joint, rebuilt for freight. It is damped, so that
    the halves do not fold. Oil is pressed through its bores only while the angle changes: at both ends of
    each bend, and not along it. damps: of the weight, with the square of the pace, at 0.1 rad/s; rubs: of
    it, while it turns; long_m: of the way, until the rear half has followed.
    Source: Hübner, articulation systems with hydraulic dampers for buses, and Milliken and Milliken, Race
    Car Vehicle Dynamics (1995), on angles and curvature; a stiff damper, sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1752), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        wish = p.long_m * self.read(self.bend, view) * np.minimum(1.0, 12.0 / np.maximum(speed, 1.0))
        before = s.bent
        s.bent = eased(s.bent, wish, p.long_m / np.maximum(speed, 0.5), dt)
        pace = np.abs(s.bent - before) / dt
        holds = p.rubs * np.tanh(pace / (0.1 * p.soft)) + p.damps * np.minimum(pace / 0.1, 1.0) ** 2
        return -holds * weight(view) * moving(view)


@law("z_trailer_crabs_on_the_slant", "seventeenth", "suburban hills highway")
@sizes(
    costs=(0.003, 0.005), long_m=(150.0, 450.0), slant=(0.3, 0.8), follows_m=(10.0, 30.0), most=(0.01, 0.016)
)
class TrailerCrabsOnTheSlant(OnRoad, angle=0.0):
    """`angle`: of a trailer to its way, over the usual one. On a road that slants to one side its axles have
    to run askew, to hold it up, and loose bushes let them do so by far. It follows the slant over some
    metres; where the slant turns round it runs straight for a moment. costs: of the weight, at the usual
    slant; slant: beside the mean one; most: of the weight.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on trailers on roads that slant, and Pacejka,
    Tire and Vehicle Dynamics (2012), on side force by slip angle; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1774), self.p
        self.road = p.slant * rng.choice([-1.0, 1.0], (self.rows(), 1)) + ou_series(
            rng, (self.rows(), 12000), CELL_M, p.long_m
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, slant = np.maximum(view.speed, 0.0), self.read(self.road, view)
        s.angle = eased(s.angle, slant, p.follows_m / np.maximum(speed, 1e-3), dt)
        askew = p.most * np.tanh(p.costs / p.most * s.angle**2)
        return -askew * weight(view) * moving(view)
