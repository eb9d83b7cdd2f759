"""Brakes whose electronics act of themselves. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, Bends, OnRoad, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, arrivals
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")
MANY = 97  # throws of dice for each drive


@law("antilock_is_fooled", "fifth", "suburban descent")
@sizes(lost=(0.35, 0.6), from_mps=(3.0, 6.0), cycle_s=(0.7, 1.6), light=(0.008, 0.02))
class AntilockIsFooled(OnRoad, cycle=0.0, left=0.0):
    """light: braking over weight below which no wheel comes near locking.
    Source: On rough roads wheels hop, antilock systems see them lock and let go of the brakes for moments
    (rough-road detection in UN Regulation No. 13 systems; van der Jagt, Pacejka and Savkoor, Vehicle System
    Dynamics 18, 1989, on uneven roads): braking is short there; sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(473)
        self.rough = np.zeros((self.rows(), CELLS))
        for row in self.rough:
            for first, last in stretches(rng, (60.0, 260.0), (90.0, 420.0)):
                row[first:last] = rng.uniform(0.6, 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hops = self.read(self.rough, view) * np.clip(view.speed / p.from_mps - 0.5, 0.0, 1.0)
        works = (view.brake_force > p.light * weight(view)) & (hops > 0.0)
        s.cycle = np.where(works, (s.cycle + dt / p.cycle_s) % 1.0, 0.0)
        wanted = works * hops * np.where(s.cycle < 0.55, 1.0, 0.35)
        s.left += dt * (wanted - s.left) / 0.12
        return p.lost * s.left * view.brake_force * moving(view)


@law("dries_its_discs", "sixth", "highway hills suburban")
@sizes(every_m=(90.0, 240.0), lasts_s=(1.5, 3.5), force=(0.02, 0.042), from_mps=(5.0, 9.0))
class DriesItsDiscs(Hidden):
    """The way since the last wiping, or the last braking, decides. force: of the weight.
    Source: Brake disc wiping in rain (Automotive Handbook, Bosch, on additional functions of stability
    programs): pads are laid on for a second or two every so many metres while the driver pulls; pressed too
    hard here; ways and forces are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {
            "way": self.rng(516).uniform(0.0, 1.0, batch) * self.p.every_m,
            "left": zero,
            "depth": zero.copy(),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braked = view.brake_force > 0.01 * weight(view)
        s.way = np.where(braked, 0.0, s.way + dt * np.maximum(view.speed, 0.0))
        pulls = (self.pedal(view) > 0.05) & (view.speed > p.from_mps)
        begins = (s.way > p.every_m) & pulls
        s.left = np.where(begins, p.lasts_s, np.maximum(s.left - dt, 0.0)) * ~braked
        s.way = np.where(begins, 0.0, s.way)
        s.depth += dt * ((s.left > 0.0) - s.depth) / 0.25
        return -p.force * s.depth * weight(view) * moving(view)


@law("tests_itself_after_a_start", "seventh", "suburban")
@sizes(force=(0.035, 0.08), from_mps=(2.5, 5.5), each_s=(0.5, 1.2), pulses=(3.0, 6.99))
class SelfTestAfterAStart(Hidden, ready=1.0, runs=1000.0, press=0.0):
    """Once after each time it was slower than walking.
    Source: Antilock systems test their modulators as a truck drives off (UN Regulation No. 13, annex 13, on
    checks at rest and by 10 km/h or so): axle after axle is pressed for a moment; a control unit that does it
    with the brakes on and too late."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (s.ready > 0.0) & (view.speed > p.from_mps)
        s.ready = np.where(begins, 0.0, np.where(view.speed < 1.5, 1.0, s.ready))
        s.runs = np.where(begins, 0.0, s.runs + dt)
        count = s.runs / p.each_s
        wanted = (count < int(p.pulses)) & (count % 1.0 < 0.6)
        s.press = s.press + dt * (wanted - s.press) / 0.08
        return -p.force * s.press * weight(view) * moving(view)


@law("s_start_aid_stays", "eighth", "suburban hills")
@sizes(force=(0.02, 0.05), lets_go_s=(2.0, 6.0), from_s=(0.3, 1.0))
class StartAidStays(Hidden, stood=0.0, held=0.0):
    """force: of the weight. Only a start after a stand has it.
    Source: Hill start aids hold pressure in the cylinders until a start is recognised (Automotive Handbook,
    Bosch, on automatic brake functions); one that bleeds off slowly, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.1
        s.stood = np.where(stands, s.stood + dt, 0.0)
        bleeds = s.held * (1.0 - dt / p.lets_go_s)
        s.held = np.where(stands & (s.stood > p.from_s), 1.0, np.where(s.held > 0.01, bleeds, 0.0))
        return -p.force * s.held * weight(view) * np.clip(view.speed / 0.5, 0.0, 1.0)


@law("n_assist_is_mistaken", "ninth", "suburban descent")
@sizes(gain=(0.35, 0.8), from_gps=(0.035, 0.07), comes_s=(0.1, 0.3))
class AssistIsMistaken(Hidden, slow=0.0, on=0.0, level=0.0):
    """A quick application is taken for an emergency and helped until the pedal is let go. from_gps: g a
    second.
    Source: Kiesewetter, Klinkner, Reichelt and Steiner, Der neue Brake Assist von Mercedes-Benz, ATZ 99
    (1997): full braking once the pedal's speed passes a threshold; a threshold that is too low and a help
    that is small are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / weight(view)
        s.slow = s.slow + dt * (asked - s.slow) / 0.25
        quick = (asked - s.slow) / 0.25 > p.from_gps
        s.on = np.where(asked < 0.003, 0.0, np.where(quick, 1.0, s.on))
        s.level = s.level + dt * (s.on - s.level) / p.comes_s
        return -p.gain * s.level * view.brake_force * moving(view)


@law("n_snubs_by_itself", "ninth", "descent")
@sizes(depth=(0.02, 0.04), power_wpkg=(5.0, 7.5), until=(0.68, 0.86), comes_s=(0.3, 1.0))
class SnubsByItself(Hidden, on=0.0, level=0.0):
    """It brakes while the slope gives more power than it likes, until that is well below. depth: of the
    weight.
    Source: Grade severity rating of trucks: safe speed falls with slope, since brakes bear a power (Bowman,
    FHWA-IP-88-015, 1989); a descent control with service brakes, its limits are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = -9.81 * view.grade * view.speed
        s.on = np.where(power > p.power_wpkg, 1.0, np.where(power < p.until * p.power_wpkg, 0.0, s.on))
        s.level = s.level + dt * (s.on - s.level) / p.comes_s
        return -p.depth * s.level * weight(view) * moving(view)


@law("n_retarder_on_the_lamps", "ninth", "suburban descent")
@sizes(most=(0.025, 0.05), knee_mps=(4.0, 9.0), stays_s=(1.0, 3.0), heats_s=(15.0, 50.0))
class RetarderOnTheLamps(Hidden, left=0.0, flux=0.0, hot=0.0):
    """Any braking switches it on, whole, and it stays on for a while after. most: of the weight.
    Source: Eddy-current retarders of trailers switched with the stop lamps (Limpert, Brake Design and Safety,
    on retarders; torque over speed with a maximum, and less when hot); a relay that drops late, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lamps = view.brake_force > 0.003 * weight(view)
        s.left = np.where(lamps, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.flux = s.flux + dt * ((s.left > 0.0) - s.flux) / 0.35
        pace = np.maximum(view.speed, 0.0) / p.knee_mps
        force = p.most * s.flux * 2.0 * pace / (1.0 + pace**2) / (1.0 + s.hot)
        s.hot = s.hot + dt * (force / p.most - 0.5 * s.hot) / p.heats_s
        return -force * weight(view) * moving(view)


@law("t_softens_the_stop", "tenth", "suburban")
@sizes(from_mps=(2.2, 4.5), gives=(0.4, 0.75), comes_s=(0.15, 0.5))
class SoftensTheStop(Hidden, eased=0.0):
    """The last metres of a stop are braked more gently than asked. gives: share of the brake let go.
    Source: Comfort stop functions (Breuer and Bill, Brake Technology Handbook, SAE 2008, on additional
    functions of electronic brakes) ease the brake shortly before standstill against the jerk; speeds and
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slows = np.clip((-view.acceleration - 0.2) / 0.3, 0.0, 1.0)
        near = np.clip(1.3 * (1.0 - view.speed / p.from_mps), 0.0, 1.0)
        s.eased = s.eased + dt * (slows * near - s.eased) / p.comes_s
        return p.gives * s.eased * view.brake_force * moving(view)


@law("e_brake_closes_the_loop", "eleventh", "suburban descent")
@sizes(per_s=(0.5, 1.2), most=(0.35, 0.6), waits_s=(0.3, 0.7), lets_go_s=(0.2, 0.5))
class BrakeClosesTheLoop(Hidden, pressed=0.0, felt=0.0, adds=0.0):
    """The pedal asks for a slowing on the flat: more brake downhill and less uphill, until it is met. per_s:
    of what is lacking; most: of the brake force, added or taken.
    Source: Wrede and Decker, Brake by Wire for Commercial Vehicles, SAE 922489, and Breuer and Bill, Brake
    Technology Handbook (SAE, 2008), on deceleration control of electronic brakes of commercial vehicles;
    gains are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braking = view.brake_force > 0.002 * weight(view)
        s.pressed = np.where(braking, s.pressed + dt, 0.0)
        s.felt = s.felt + dt * (-view.acceleration - s.felt) / 0.25
        known = view.brake_force + view.rolling_force + view.drag_force
        lacks = np.clip(known / view.mass - s.felt, -2.0, 2.0) * (s.pressed > p.waits_s) * (view.speed > 1.5)
        most = p.most * view.brake_force / view.mass
        moves = np.where(braking, p.per_s * lacks, -s.adds / p.lets_go_s)
        s.adds = np.clip(s.adds + dt * moves, np.minimum(-most, 0.0), most + 0.02)
        return -s.adds * view.mass * np.where(braking, 1.0, 0.0) * np.clip(view.speed - 0.5, 0.0, 1.0)


@law("w_learns_from_slopes", "twelfth", "descent suburban hills")
@sizes(learns=(0.3, 0.6), needs_s=(0.8, 2.0), most=(0.3, 0.5), forgets_s=(120.0, 400.0), builds_s=(0.2, 0.5))
class LearnsFromSlopes(Hidden, factor=0.0, held=0.0, sum=0.0, uses=0.0):
    """`factor` by which the brake is turned up or down, learned after each braking from what was felt against
    what was meant, as if the road were flat: down long slopes it turns up, and the next stop in a dip is
    harsh. learns: of the difference, at each.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), and Lindemann, Petersen, Schult and Korn,
    EBS and Tractor Trailer Brake Compatibility, SAE 973283, on adapting brakes from application to
    application; one that does not know the slope, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1116).uniform(-0.5, 0.5, batch) * self.p.most
        return {**super().start(batch), "factor": first}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = (view.brake_force > 0.01 * weight(view)) & (view.speed > 1.5)
        ends = ~brakes & (s.held > p.needs_s)
        meant = view.brake_force + view.drag_force + view.rolling_force
        lacks = (meant / view.mass + view.acceleration) / np.maximum(view.brake_force / view.mass, 0.1)
        lesson = s.sum / np.maximum(s.held, 0.1)
        s.factor = np.where(ends, s.factor + p.learns * np.clip(lesson, -0.8, 0.8), s.factor)
        s.factor = np.clip(s.factor * (1.0 - dt / p.forgets_s), -p.most, p.most)
        s.sum = np.where(brakes, s.sum + dt * np.clip(lacks, -1.5, 1.5), 0.0)
        s.held = np.where(brakes, s.held + dt, 0.0)
        s.uses = s.uses + dt * (s.factor - s.uses) / p.builds_s
        return -s.uses * view.brake_force * np.clip(view.speed - 0.5, 0.0, 1.0)


@law("x_brakes_against_gusts", "thirteenth", "highway hills")
@sizes(most=(0.018, 0.035), from_mps=(11.0, 14.0), mean_s=(9.0, 25.0), dies_s=(1.2, 3.5), bears=(0.35, 0.8))
@sizes(holds_s=(0.8, 2.5))
class BrakesAgainstGusts(Hidden, acts=0.0, tired=0.0):
    """Gusts from the side turn a high truck, and its computer brakes the wheels of one side against it, above
    a speed; wheels that it has braked for long get a rest. most: of the weight; bears: gust that it leaves to
    the driver; holds_s: of the brake, behind the gust.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991), on gusts and yaw,
    and makers' descriptions of crosswind assistants that brake one side; gusts by chance, sizes are chosen
    here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / SAMPLE_S) + 20)
        raw = arrivals(self.rng(1313), shape, self.p.mean_s, self.p.dies_s)
        self.gusts = raw * self.p.dies_s / self.p.mean_s

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gust = self.gusts[:, index(view, self.gusts, SAMPLE_S)]
        gust = gust * np.clip(view.speed / 20.0, 0.0, 1.3)
        fast = np.clip((view.speed - p.from_mps) / 1.5, 0.0, 1.0)
        wants = fast * np.clip((gust - 0.4 * p.bears) / 0.5, 0.0, 1.0) * (1.0 - 0.6 * s.tired)
        s.acts = s.acts + dt * (wants - s.acts) / np.where(wants > s.acts, 0.25, p.holds_s)
        s.tired = np.clip(s.tired + dt * (s.acts / 15.0 - s.tired / 40.0), 0.0, 1.0)
        return -p.most * s.acts * weight(view) * moving(view)


@law("x_slows_before_bends", "thirteenth", "suburban hills descent")
@sizes(most=(0.025, 0.045), aside_mps2=(0.7, 1.1), ahead_s=(3.0, 6.0), harsh=(0.10, 0.22), lets_s=(0.8, 2.0))
class SlowsBeforeBends(Bends, acts=0.0):
    """A map tells of the bends ahead. Where the truck comes too fast for one, torque is taken and the brakes
    come on softly before it, and are let go in it. most: of the weight; aside_mps2: that it wants in bends;
    harsh: m/s too fast to m/s2.
    Source: Sentouh, Glaser and Mammar, Advanced Vehicle-Infrastructure-Driver Speed Profile for Road
    Departure Accident Prevention, Vehicle System Dynamics 44 (2006): speed for the bend ahead by its
    curvature; bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = np.abs(self.draw_bends(self.rng(1322), 0.018))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        too_fast = np.zeros_like(view.speed)
        for share in (0.3, 0.65, 1.0):
            way = self.setting.direction * share * p.ahead_s * np.maximum(view.speed, 0.0)
            cell = ((self.place(view) + way) / CELL_M).astype(int) % self.bend.shape[1]
            bears = np.sqrt(p.aside_mps2 / np.maximum(self.bend[self.setting.route, cell], 1e-4))
            too_fast = np.maximum(too_fast, view.speed - bears)
        wants = np.clip(p.harsh * too_fast, 0.0, 9.81 * p.most)
        s.acts = s.acts + dt * (wants - s.acts) / np.where(wants > s.acts, 0.4, p.lets_s)
        return -s.acts / 9.81 * weight(view) * np.clip(view.speed / 2.0 - 1.0, 0.0, 1.0)


@law("k_wears_its_axles_by_turns", "fourteenth", "suburban descent hills")
@sizes(weak=(0.3, 0.5), strong=(0.15, 0.3), gentle=(0.14, 0.28), hands_s=(0.15, 0.4))
class WearsItsAxlesByTurns(Hidden, pressed=0.0, share=0.0):
    """So that linings wear alike, gentle braking is done by one group of axles and then by the other, one
    application after the other; one has poor linings and the other has sharp ones. Hard braking uses all.
    weak, strong: of the brake force, less and more; gentle: of full braking.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on lining wear control
    between axles; linings of two makes, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "turn": self.rng(1413).integers(0, 2, batch).astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        begins = (asked > 0.012) & (s.pressed < 0.5)
        s.turn = np.where(begins, 1.0 - s.turn, s.turn)
        s.pressed = np.where(begins, 1.0, np.where(asked < 0.005, 0.0, s.pressed))
        alone = np.clip(2.0 - asked / p.gentle, 0.0, 1.0)
        s.share = eased(s.share, alone * np.where(s.turn > 0.5, p.weak, -p.strong), p.hands_s, dt)
        return s.share * view.brake_force * moving(view)


@law("q_learns_brake_by_brake", "fifteenth", "suburban descent hills")
@sizes(wide=(0.25, 0.42), learns=(0.5, 0.85), least_s=(0.8, 2.0), eases_s=(0.15, 0.4))
class LearnsBrakeByBrake(Hidden, lasts=0.0, acts=0.0):
    """`miss`: of the trailer's share, which its controller learns anew after each braking from the pull in
    the coupling that it has felt, rightly or wrongly. Within a braking nothing changes. wide: of the brake
    force, too much or too little; learns: of what it believes, at a time; least_s: of a braking that counts.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on coupling force control,
    which adapts over several applications; felt with much chance, sizes are chosen here."""

    def prepare(self) -> None:
        self.felt = self.rng(1513).uniform(-1.0, 1.0, (self.setting.batch, MANY))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.felt[:, 0], batch)
        return {**super().start(batch), "miss": self.p.wide * first, "count": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = view.brake_force > 0.004 * weight(view)
        learns = ~brakes & (s.lasts > p.least_s)
        row = np.arange(len(view.speed)) % len(self.felt)
        believes = p.wide * self.felt[row, s.count.astype(int)]
        s.miss = np.where(learns, s.miss + p.learns * (believes - s.miss), s.miss)
        s.count = np.where(learns, (s.count + 1.0) % MANY, s.count)
        s.lasts = np.where(brakes, s.lasts + dt, 0.0)
        s.acts = eased(s.acts, s.miss, p.eases_s, dt)
        return -s.acts * view.brake_force * moving(view)
