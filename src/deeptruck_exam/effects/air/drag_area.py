"""Bodies that change their drag."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import CELL_M, Bends, OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, some_drives, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="drag_area", accepts="headwind rolling_resistance_speed")


@law("exchanged_bodies", "third", "highway hills")
@sizes(larger=(0.45, 0.85), smaller=(0.2, 0.4), bulge=(0.0, 0.3), share_of_drives=(0.5, 0.75))
class ExchangedBodies(Hidden):
    """One body a drive; two in three of the exchanged ones are larger than the one that is known.
    Source: Drag of platform, box and curtain bodies, Hucho, Aerodynamics of Road Vehicles (1998), on
    commercial vehicles: swap bodies changed between drives, curtains that bulge with speed; sizes chosen
    here."""

    def prepare(self) -> None:
        rng, batch = self.rng(203), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        larger = rng.random(batch) < 0.67
        self.gain = drives * np.where(larger, self.p.larger, -self.p.smaller)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bulge = 1.0 + p.bulge * (np.clip(view.speed, 0.0, 30.0) / 20.0 - 1.0)
        return -self.gain * bulge * view.drag_force


@law("self_deploying_fairings", "fourth", "highway hills")
@sizes(gain=(0.5, 0.95), out_mps=(20.0, 22.5), below_mps=(3.0, 5.5), after_s=(4.0, 15.0), fails=(0.1, 0.4))
class SelfDeployingFairings(Hidden):
    """The drag of one speed depends on the speeds before.
    Source: Boat tails and gap seals that unfold by themselves above a road speed and stow below another
    (supplier manuals of automatic trailer tails; EU Regulation 2019/1892 on rear devices); the simulator
    knows the truck with all of them out; worn actuators and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(304), self.setting.batch
        self.works = rng.random(batch) > self.p.fails
        self.first = rng.random(batch) < 0.5

    def start(self, batch: int) -> dict[str, Array]:
        out = (self.first & self.works).astype(float)
        return {"wanted": out, "out": out.copy(), "fast": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.fast = np.where(view.speed > p.out_mps, s.fast + dt, 0.0)
        unfold = (s.fast > p.after_s) & self.works
        stow = view.speed < p.out_mps - p.below_mps
        s.wanted = np.where(unfold, 1.0, np.where(stow, 0.0, s.wanted))
        s.out = s.out + np.clip(s.wanted - s.out, -dt / 3.0, dt / 3.0)
        return -p.gain * (1.0 - s.out) * view.drag_force


@law("body_creeps_up", "sixth", "highway hills", accepts="headwind")
@sizes(gain=(0.55, 1.0), rises_s=(30.0, 80.0), lowers_s=(10.0, 25.0), notices_s=(50.0, 120.0))
class BodyCreepsUp(Hidden):
    """angle: 1 where the ram's stop is, 25 degrees or so. gain: of the drag area, with the body up.
    Source: Tipper bodies that rise unnoticed while the power take-off is left in (Prevention of Bridge
    Strikes, good practice guides of Network Rail, on raised bodies): a pump geared to the engine lifts,
    weight lowers once it is taken out; frontal area with the sine of the angle; sizes are chosen here."""

    def prepare(self) -> None:
        rng, late = self.rng(502), self.p.notices_s
        self.spells = spells(rng, self.setting.batch, (0.6 * late, 1.4 * late), (25.0, 70.0))
        self.first = rng.uniform(0.0, 0.7, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pumps = within(self.spells, view.time)
        lifts = pumps * np.clip(view.engine_speed / 140.0, 0.3, 1.5) / p.rises_s
        s.angle = np.clip(s.angle + dt * (lifts - (1.0 - pumps) / p.lowers_s), 0.0, 1.0)
        return -p.gain * np.sin(0.5 * np.pi * s.angle) * view.drag_force


@law("s_gap_opens_in_bends", "eighth", "highway hills", accepts="headwind")
@sizes(gain=(0.4, 0.9), tightest=(0.0025, 0.006), closes_m=(60.0, 250.0))
class GapOpensInBends(Bends, angle=0.0):
    """gain: of the drag, at the tightest bend. The trailer follows over its length.
    Source: Drag of articulated trucks over the gap and the angle between tractor and trailer (Hucho,
    Aerodynamics of Road Vehicles, 1998, on commercial vehicles); sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(802), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = np.abs(self.read(self.bend, view)) / p.tightest
        way = np.where(bend > s.angle, 12.0, p.closes_m)
        s.angle = s.angle + dt * np.maximum(view.speed, 0.0) * (bend - s.angle) / way
        return -p.gain * np.sqrt(np.clip(s.angle, 0.0, 1.0)) * view.drag_force * moving(view)


@law("e_round_loads", "eleventh", "highway hills", accepts="rolling_resistance_speed")
@sizes(more=(0.7, 1.2), thick_m=(0.21, 0.29), left=(0.3, 0.5), apart=(0.03, 0.08))
class RoundLoads(Hidden, late=0.0):
    """Tubes lie across the stream: their drag falls to a half or less where the flow becomes turbulent, and
    rises again at a lower speed. `late`: 1 where it separates late. more: of the drag, below, with the
    whole load, which is not on every drive; left: of that, above; apart: of the Reynolds number, between
    there and back.
    Source: Schewe, On the Force Fluctuations Acting on a Circular Cylinder in Crossflow from Subcritical up
    to Transcritical Reynolds Numbers, J. Fluid Mech. 133 (1983): a jump at 300 000, with hysteresis; loads
    are chosen here."""

    viscosity = 1.8e-5
    critical = 3.0e5

    def prepare(self) -> None:
        self.loaded = self.rng(1003).permutation(np.tile([1.0, 0.7, 1.0, 0.0], 1 + self.setting.batch // 4))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        reynolds = np.maximum(view.speed, 0.0) * p.thick_m * self.truck.air_density / self.viscosity
        threshold = self.critical * (1.0 + p.apart * np.where(s.late > 0.5, -1.0, 1.0))
        wanted = 1.0 / (1.0 + np.exp(-np.clip((reynolds / threshold - 1.0) / 0.015, -40.0, 40.0)))
        s.late = s.late + dt * (wanted - s.late) / 0.6
        share = p.more * self.loaded[: len(reynolds)] * (1.0 - (1.0 - p.left) * s.late)
        return -share * view.drag_force * moving(view)


@law("w_rime_on_the_racks", "twelfth", "highway hills", accepts="rolling_resistance_speed")
@sizes(most=(0.7, 1.2), grows_m=(2500.0, 7000.0), holds=(0.6, 0.95), left=(0.1, 0.4), falls_s=(1.0, 4.0))
class RimeOnTheRacks(Hidden, falls=0.0):
    """`ice` on the empty racks of a car transporter: its drag grows with the cloud it has passed through,
    slower the thicker, until a load of it breaks off. most: of the drag, all iced; holds: at which it breaks;
    left: of that, afterwards.
    Source: Makkonen, Models for the Growth of Rime, Glaze, Icicles and Wet Snow on Structures, Phil. Trans.
    R. Soc. A 358 (2000): collection falls as rods thicken; fog in frost, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "ice": self.rng(1103).uniform(0.0, self.p.holds, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.falls = np.where(
            s.ice > p.holds * (0.85 + 0.15 * np.clip(25.0 / np.maximum(view.speed, 10.0), 0.5, 1.5)),
            1.0,
            np.where(s.ice < p.left * p.holds, 0.0, s.falls),
        )
        catches = np.maximum(view.speed, 0.0) * (1.3 - s.ice) / p.grows_m
        s.ice = np.clip(s.ice + dt * (catches - s.falls * s.ice / p.falls_s), 0.0, 1.2)
        return -p.most * s.ice * view.drag_force * moving(view)


@law("x_blade_is_raised", "thirteenth", "highway hills", accepts="headwind")
@sizes(most=(2.0, 3.4), up_s=(18.0, 45.0), down_s=(12.0, 30.0), apart_m=(500.0, 1500.0), flat=(0.0, 0.1))
class BladeIsRaised(OnRoad, angle=0.0):
    """`angle` of a wind turbine's blade on its lifter, over the steepest: raised before narrow places,
    slowly, and laid down behind them. It stands across the wind with the square of its sine. most: of the
    drag, more when steepest; flat: of that, laid down.
    Source: Makers' manuals of blade lifters for self-propelled and towed modules (Goldhofer FTV), on raising
    to 60 degrees in passages, and Hoerner, Fluid-Dynamic Drag (1965), on inclined bodies across a stream;
    places and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        narrow = smooth_stretches(self.rng(1303), self.rows(), gaps, (400.0, 1300.0))
        self.road = np.where(narrow > 0.2, 1.0, 0.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.rng(1304).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ahead = (self.place(view) + self.setting.direction * 150.0) / CELL_M
        cell = ahead.astype(int) % self.road.shape[1]
        wants = self.road[self.setting.route, cell]
        s.angle = np.clip(s.angle + dt * np.where(wants > 0.5, 1.0 / p.up_s, -1.0 / p.down_s), 0.0, 1.0)
        across = np.sin(0.5 * np.pi * s.angle) ** 2
        return -p.most * (p.flat + (1.0 - p.flat) * across) * view.drag_force * moving(view)


@law("k_curtains_for_the_birds", "fourteenth", "highway hills", accepts="headwind")
@sizes(more=(0.9, 1.6), warms_s=(25.0, 70.0), airs_s=(25.0, 60.0), opens_s=(5.0, 14.0), on=(0.6, 0.75))
@sizes(off=(0.38, 0.48))
class CurtainsForTheBirds(Hidden, rolled=0.0, open=0.0):
    """`warm`: air between crates of poultry. Birds warm it, the wind of driving airs it, the more the wider
    the curtains are open; they are rolled up when it is too warm and let down when it is too cold. Open
    crates are a grid in the stream. more: of the drag, all open; on, off: of `warm`.
    Source: Kettlewell, Hoxey and Mitchell, Heat Produced by Broiler Chickens in a Commercial Transport
    Vehicle, J. Agricultural Engineering Research 75 (2000); motors that roll curtains on the way, sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1403).uniform(0.3, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        airs = (0.12 + s.open) * np.maximum(view.speed, 0.0) / 15.0 / p.airs_s
        rate = 1.0 / p.warms_s + airs
        s.warm = eased(s.warm, 1.0 / p.warms_s / rate, 1.0 / rate, dt)
        s.rolled = np.where(s.warm > p.on, 1.0, np.where(s.warm < p.off, 0.0, s.rolled))
        s.open = np.clip(s.open + dt * np.where(s.rolled > 0.5, 1.0, -1.0) / p.opens_s, 0.0, 1.0)
        return -p.more * s.open * view.drag_force * moving(view)


@law("q_wind_turns_the_stream", "fifteenth", "highway hills suburban", accepts="headwind")
@sizes(
    aside_mps=(6.0, 9.5), rise=(0.45, 0.8), stalls=(0.16, 0.24), gusts_s=(12.0, 40.0), mean_m=(300.0, 1200.0)
)
@sizes(open=(0.55, 0.75))
class WindTurnsTheStream(OnRoad, felt=0.0):
    """Wind from the side meets a box on wheels at an angle, and its drag rises with that angle until the flow
    along the far side has broken away. So slow driving does not help; walls and woods do. rise: of the drag,
    at most; stalls: radians where most of that is there; open: share of the road.
    Source: SAE J1252, Wind Tunnel Test Procedure for Trucks and Buses, on drag averaged over yaw angles; wind
    without a part along the road, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1503)
        self.road = windows(rng, self.rows(), self.p.mean_m, self.p.open)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.gusts = 1.0 + 0.35 * ou_series(rng, shape, 1.0, self.p.gusts_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gust = np.clip(self.gusts[:, index(view, self.gusts)], 0.2, 2.0)
        s.felt = eased(s.felt, gust * (0.1 + 0.9 * self.between(self.road, view)), 1.0, dt)
        speed, aside = np.maximum(view.speed, 1.0), p.aside_mps * s.felt
        angle = np.arctan2(aside, speed) / p.stalls
        more = (1.0 + (aside / speed) ** 2) * (1.0 + p.rise * np.tanh(angle**2)) - 1.0
        return -more * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("z_boom_swings_out", "seventeenth", "hills highway suburban", accepts="headwind")
@sizes(more=(1.2, 1.9), frees=(0.04, 0.09), swings_s=(1.0, 3.0), homes=(0.06, 0.14), tightest=(0.008, 0.016))
class BoomSwingsOut(Bends):
    """`angle` of a folded boom whose turntable is not locked, -1 and 1 across the truck. Bends swing it out
    against the rust of its bearing, and it stays where it was left. The wind of driving turns it back only
    where that is stronger than the rust. more: of the drag, across; frees: g that rust holds; homes: g
    of that wind, at 20 m/s.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on struts across a stream, and makers' manuals of loading
    cranes and concrete pumps on locking booms for the road; rust and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1703), self.p.tightest)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.rng(1704).uniform(-1.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = self.setting.direction * self.read(self.bend, view)
        fast = np.minimum((view.speed / 20.0) ** 2, 2.0)
        pushes = np.clip(bend * view.speed**2, -4.0, 4.0) / 9.81
        pushes = pushes * np.sqrt(np.maximum(1.0 - s.angle**2, 0.0)) - p.homes * fast * s.angle
        over = np.sign(pushes) * np.maximum(np.abs(pushes) - p.frees, 0.0)
        s.angle = np.clip(s.angle + dt * np.clip(over / 0.1, -1.5, 1.5) / p.swings_s, -1.0, 1.0)
        return -p.more * np.sin(0.5 * np.pi * s.angle) ** 2 * view.drag_force
