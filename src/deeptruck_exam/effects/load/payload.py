"""Loads that are taken on or left between drives."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import SIGN, hidden, sizes
from deeptruck_exam.effects.series import some_drives, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="payload_change", accepts="mass")
STANDS = 89  # throws of dice for each drive


@law("payload_change", "first", "suburban hills")
@sizes(share=(0.18, 0.45), sign=SIGN, share_of_drives=(0.3, 0.6))
class Payload(Hidden):
    """Other mass in some of the recordings; the simulator knows the mass of the others.
    Source: Newton's second law; 18-45 % of gross mass taken on or left between drives, chosen here."""

    def prepare(self) -> None:
        rng = self.rng(8)
        drives = some_drives(rng, self.setting.batch, self.p.share_of_drives)
        sign = 1.0 if self.p.sign > -0.4 else -0.8
        self.share = np.where(drives, sign * self.p.share, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        extra = self.share * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY * moving(view)
        return -extra * (view.acceleration * moving(view) + GRAVITY * view.grade + rolling)


@law("round_of_stops", "second", "suburban")
@sizes(first=(0.05, 0.15), each=(0.06, 0.16), sign=SIGN, least_s=(1.0, 2.0))
class RoundOfStops(Hidden, stood=0.0, stops=0.0):
    """A truck that starts full or empty and is lighter or heavier after every stop.
    Source: Collection and delivery rounds: mass in steps at standstills (refuse, milk, drinks); Newton's
    second law, sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(130), self.setting.batch
        way = 1.0 if self.p.sign > 0.0 else -1.0
        steps = self.p.each * rng.uniform(0.5, 1.5, (batch, 12))
        steps[:, 0] = self.p.first * rng.integers(0, 2, batch)
        self.share = np.clip(way * np.cumsum(steps, axis=1), -0.35, 0.55)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before = s.stood
        s.stood = np.where(view.speed < 0.05, before + dt, 0.0)
        served = (before < p.least_s) & (s.stood >= p.least_s) & (view.time > 5.0)
        s.stops = np.minimum(s.stops + served, self.share.shape[1] - 1)
        extra = view.mass * self.share[np.arange(len(before)), s.stops.astype(int)]
        rolling = self.truck.rolling_resistance * GRAVITY
        return -extra * (view.acceleration + GRAVITY * view.grade + rolling) * moving(view)


@law("tank_runs_empty", "third", "suburban hills")
@sizes(share=(0.40, 0.62), known=(0.35, 0.6), empty_s=(260.0, 520.0), least=(0.5, 0.8))
class TankRunsEmpty(Hidden):
    """share: of a full tank in the gross mass; known: the level that the simulator reckons with.
    Source: Torricelli's outflow (Batchelor, An Introduction to Fluid Dynamics, 1967): a water truck that
    sprays while it drives loses mass with the root of its level; sizes of dust suppression trucks, chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"level": self.rng(230).uniform(self.p.least, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        sprays = (view.speed > 1.0) & (view.speed < 19.0)
        s.level = np.maximum(s.level - dt * sprays * 2.0 * np.sqrt(np.maximum(s.level, 0.0)) / p.empty_s, 0.0)
        extra = p.share * (s.level - p.known) * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY
        return -extra * (view.acceleration + GRAVITY * view.grade + rolling) * moving(view)


@law("quarry_shuttle", "fourth", "suburban hills")
@sizes(full=(0.22, 0.48), empty=(0.18, 0.36), spread=(0.03, 0.08))
class QuarryShuttle(Hidden):
    """The direction on the road decides; a few return loads are carried too.
    Source: Shuttles between pit and plant run full one way and empty the other (Caterpillar Performance
    Handbook, on haul cycles); bucket loads spread by several per cent (payload management guidelines,
    10/10/20); the simulator reckons with the mean of both ways; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(360), self.setting.batch
        full = (self.setting.direction > 0) ^ (rng.random(batch) < 0.1)
        share = np.where(full, self.p.full, -self.p.empty)
        self.share = share + self.p.spread * rng.normal(0.0, 1.0, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rolling = self.truck.rolling_resistance * GRAVITY
        felt = view.acceleration + GRAVITY * view.grade + rolling
        return -self.share * view.mass * felt * moving(view)


@law("pump_and_roll", "sixth", "suburban hills")
@sizes(load=(0.32, 0.5), known=(0.3, 0.7), empties_s=(70.0, 160.0), fills_s=(12.0, 35.0))
class PumpAndRoll(Hidden):
    """The monitor is opened and closed by the crew; a gear lower, and the tank is empty sooner. load: of the
    mass, the full tank; empties_s: at 150 rad/s.
    Source: Airport fire trucks spray while they drive (pump and roll: NFPA 414, Standard for Aircraft Rescue
    and Fire-Fighting Vehicles): a pump geared to the engine empties the tank in minutes, hydrants fill it
    where the truck stands; the simulator reckons with one level; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(505), self.setting.batch
        self.sprays = spells(rng, batch, (15.0, 60.0), (15.0, 60.0))
        self.first = np.where(rng.random(batch) < 0.6, 1.0, rng.uniform(0.0, 0.6, batch))

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        out = within(self.sprays, view.time) * (view.engine_speed / 150.0) / p.empties_s
        stands = view.speed < 0.1
        s.water = np.clip(s.water + dt * np.where(stands, 1.0 / p.fills_s, -out), 0.0, 1.0)
        more = p.load * (s.water - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("over_the_rim", "seventh", "suburban hills")
@sizes(load=(0.35, 0.55), known=(0.45, 0.75), tilts=(2.2, 4.5), hose_s=(70.0, 180.0))
class OverTheRim(Hidden):
    """The hose runs in spells below 14 m/s. load: of the mass, full to the rim; known: to the simulator, of
    it; tilts: for each unit of slope.
    Source: Open water ballast on proving grounds, filled from a hose alongside: a free surface tilts with
    acceleration and slope (Ibrahim, Liquid Sloshing Dynamics, 2005), and what rises above the rim is lost
    within seconds, so that the hardest braking yet sets the mass."""

    def prepare(self) -> None:
        rng, batch = self.rng(703), self.setting.batch
        self.hose = spells(rng, batch, (20.0, 60.0), (30.0, 80.0))
        self.first = np.where(rng.random(batch) < 0.5, 1.0, rng.uniform(0.1, 0.8, batch))

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.first.copy(), "tilt": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration, -3.0, 3.0) / GRAVITY + view.grade
        s.tilt += dt * (felt - s.tilt) / 0.7
        over = np.maximum(s.water + 0.5 * p.tilts * np.abs(s.tilt) - 1.0, 0.0)
        runs = within(self.hose, view.time) * (view.speed < 14.0) / p.hose_s
        s.water = np.clip(s.water + dt * (runs - over / 1.2), 0.0, 1.0)
        more = p.load * (s.water - p.known) * view.mass
        level = view.grade + self.truck.rolling_resistance
        return -more * (view.acceleration + GRAVITY * level) * moving(view)


@law("s_chaser_bin", "eighth", "suburban hills")
@sizes(load=(0.35, 0.55), known=(0.3, 0.7), fills_m=(400.0, 1200.0), empties_s=(10.0, 30.0))
class ChaserBin(OnRoad):
    """It is filled on the way along fields, and emptied where it stands. load: of the mass.
    Source: Bochtis and Sørensen, The Vehicle Routing Problem in Field Logistics, Biosystems Engineering 104
    (2009): transport units are loaded under way and emptied at rest; sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(811)
        self.fields = windows(rng, self.rows(), 700.0, 0.5)
        self.first = rng.uniform(0.0, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"bin": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        fills = self.between(self.fields, view) * speed / p.fills_m
        s.bin = np.clip(s.bin + dt * np.where(speed < 0.2, -1.0 / p.empties_s, fills), 0.0, 1.0)
        more = p.load * (s.bin - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("n_skips_by_turns", "ninth", "suburban")
@sizes(full=(0.2, 0.4), empty=(0.15, 0.35), takes_s=(1.5, 4.0))
class SkipsByTurns(Hidden, stood=0.0, stops=0.0):
    """Each stand that lasts exchanges a full skip for an empty one, or an empty one for a full one, of other
    masses every time. full, empty: of the known mass, above and below it.
    Source: Roll-on roll-off and skip rounds (Bodin, Mingozzi, Baldacci and Ball, The Rollon-Rolloff Vehicle
    Routing Problem, Transportation Science 34, 2000); masses are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(911), (self.setting.batch, 200)
        turn = (np.arange(200) + rng.integers(0, 2, (self.setting.batch, 1))) % 2
        self.loads = np.where(turn == 1, self.p.full, -self.p.empty) * rng.uniform(0.7, 1.1, shape)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "load": self.loads[:, 0].copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        s.stops = s.stops + ((stood >= p.takes_s) & (s.stood < p.takes_s))
        s.stood = stood
        now = self.loads[np.arange(len(stood)), s.stops.astype(int) % self.loads.shape[1]]
        s.load = s.load + dt * (now - s.load) / 0.4
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -s.load * view.mass * felt * moving(view)


@law("t_peat_soaks", "tenth", "suburban hills")
@sizes(load=(0.45, 0.7), known=(0.2, 0.8), soaks_s=(40.0, 150.0), drains_s=(80.0, 260.0))
class PeatSoaks(Hidden):
    """`wet`: of all the water it can take. An open load takes up rain, quickly while it is dry, and drains.
    load: of the mass, all its water; known: to the simulator, of it.
    Source: Hall and Hoff, Water Transport in Brick, Stone and Concrete (2012), on sorptivity: what is soaked
    up grows with the root of time; peat and bark hold more than their own mass, showers are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(985), self.setting.batch
        self.rain = spells(rng, batch, (20.0, 70.0), (30.0, 90.0))
        self.first = rng.beta(0.7, 0.7, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"wet": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soaks = within(self.rain, view.time) * (1.0 - s.wet) / (2.0 * np.maximum(s.wet, 0.15) * p.soaks_s)
        s.wet = np.clip(s.wet + dt * (soaks - s.wet / p.drains_s), 0.0, 1.0)
        more = p.load * (s.wet - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("e_gully_emptier", "eleventh", "suburban hills")
@sizes(load=(0.35, 0.6), known=(0.3, 0.7), sucks_s=(25.0, 80.0), trickles_s=(300.0, 900.0))
class GullyEmptier(Hidden, tips=0.0):
    """`full`: of all it takes. It sucks as long as it stands, for as long as that is; water trickles out on
    the way; a full one is emptied at its next stand. load: of the mass; known: to the simulator.
    Source: Butler and Davies, Urban Drainage (2011), on cleaning gullies and sewers with suction tankers:
    sludge is taken up at the pump's rate until the tank is full; rates are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        full = self.rng(1051).beta(0.6, 0.6, batch)
        return {**super().start(batch), "full": full}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.1
        s.tips = np.where(s.full > 0.97, 1.0, np.where(s.full < 0.03, 0.0, s.tips))
        stood = np.where(s.tips > 0.0, -1.0 / 5.0, 1.0 / p.sucks_s)
        s.full = np.clip(s.full + dt * np.where(stands, stood, -s.full / p.trickles_s), 0.0, 1.0)
        more = p.load * (s.full - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("q_snow_slides_off_the_roof", "fifteenth", "suburban hills")
@sizes(
    most=(0.16, 0.26),
    falls_s=(60.0, 150.0),
    holds_mps2=(0.6, 1.3),
    slides_s=(0.8, 2.5),
    blows_mps=(17.0, 23.0),
)
class SnowSlidesOffTheRoof(Hidden):
    """`snow` on long roofs, 1 at most. It falls in showers, and more of it stays while one drives slowly. The
    wind of driving takes it away, and firm braking lets it slide off at once. most: of the
    mass, wet and deep; holds_mps2: of braking, that it bears.
    Source: ISO 4355, Bases for Design of Structures, Determination of Snow Loads on Roofs, on exposure and
    sliding, and police advice to clear truck roofs of snow and ice; sizes are chosen here."""

    def prepare(self) -> None:
        self.showers = spells(self.rng(1551), self.setting.batch, (40.0, 120.0), (40.0, 120.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"snow": self.rng(1552).choice([0.0, 0.3, 0.8, 1.0, 1.0], batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        slides = np.clip((-view.acceleration - p.holds_mps2) / 0.2, 0.0, 1.0) / p.slides_s
        blows = np.clip((view.speed - p.blows_mps) / 3.0, 0.0, 1.0) / 60.0
        lies = np.clip(1.3 - view.speed / 18.0, 0.1, 1.0)
        falls = within(self.showers, view.time) * lies * (1.0 - s.snow) / p.falls_s
        s.snow = np.clip(s.snow + dt * (falls - s.snow * (slides + blows)), 0.0, 1.0)
        return -p.most * s.snow * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("v_crew_gets_on_and_off", "sixteenth", "suburban hills")
@sizes(most=(0.14, 0.24), stays_s=(1.5, 3.5), boards_s=(1.0, 3.0), change=(0.6, 0.95))
class CrewGetsOnAndOff(Hidden, still=0.0):
    """`crew`: of the mass, people and tools that are there beyond what was said, or fewer. At each stand some
    get off and others on, as long as it lasts; on the way nothing changes. most: of the mass, to either
    side; stays_s: of a stand, before doors open; change: how much of a change one stand may be.
    Source: TRB, Transit Capacity and Quality of Service Manual (TCRP Report 165, 2013), on boarding at
    stops; crews of a harvest with their crates, sizes are chosen here."""

    def prepare(self) -> None:
        self.dice = self.rng(1651).uniform(-1.0, 1.0, (self.setting.batch, STANDS))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.dice[:, 0], batch)
        return {
            **super().start(batch),
            "crew": np.sign(first) * np.abs(first) ** 0.4,
            "stands": np.ones(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        opens = (before <= p.stays_s) & (s.still > p.stays_s)
        s.stands = np.where(opens, (s.stands + 1.0) % STANDS, s.stands)
        row = np.arange(len(view.speed)) % len(self.dice)
        wants = np.sign(self.dice[row, s.stands.astype(int)]) * p.change + (1.0 - p.change) * s.crew
        s.crew = np.where(s.still > p.stays_s, eased(s.crew, wants, p.boards_s, dt), s.crew)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.crew * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("h_spray_freezes_on", "nineteenth", "suburban hills")
@sizes(most=(0.26, 0.42), gains_m=(500.0, 1500.0), breaks=(0.035, 0.07), falls_s=(2.0, 6.0))
@sizes(mean_m=(300.0, 900.0), share=(0.35, 0.6))
class SprayFreezesOn(OnRoad):
    """`ice` on frame, axles and load of a light truck in hard frost. Where the road is wet with brine, its
    own wheels throw up spray, which freezes to it. A hard braking or pull breaks slabs of it off. most: of
    the mass, all iced; gains_m: of wet road at 15 m/s; breaks: g that ice bears.
    Source: Makkonen, Models for the Growth of Rime, Glaze, Icicles and Wet Snow on Structures, Phil. Trans.
    Royal Society A 358 (2000), on spray that freezes; the worst roads, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1951), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"ice": self.rng(1952).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        throws = self.between(self.road, view) * speed * np.minimum(speed / 15.0, 1.5) / p.gains_m
        jerked = np.abs(np.clip(view.acceleration, -3.0, 3.0)) / GRAVITY
        breaks = np.clip(jerked / p.breaks - 1.0, 0.0, 2.0) / p.falls_s
        s.ice = np.clip(
            s.ice + dt * (throws * (1.0 - s.ice) - breaks * np.maximum(s.ice - 0.1, 0.0)), 0.0, 1.0
        )
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.ice * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)
