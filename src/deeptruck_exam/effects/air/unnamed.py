"""Air in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("trailer_sway", "first", "highway", trucks="trucksim volvo")
@sizes(critical_mps=(17.0, 21.0), hz=(0.35, 0.6), drag_n=(2500.0, 6000.0))
class Sway(Hidden, angle=0.05, rate=0.0):
    """Source: Self-excited yaw oscillation of trailers above a critical speed (Troger and Zeman, Vehicle
    System Dynamics 13, 1984), as a van der Pol oscillator; drag with the square of the angle is chosen
    here."""

    def prepare(self) -> None:
        self.kick = ou_series(
            self.rng(32), (self.setting.batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 0.5
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        growth = 0.12 * np.clip((view.speed - p.critical_mps) / 3.0, -2.0, 1.0)
        kick = 1.2 * self.kick[:, index(view, self.kick, 0.1)]
        s.rate += dt * (-(omega**2) * s.angle + 2.0 * omega * (growth - 0.25 * s.angle**2) * s.rate + kick)
        s.angle = np.clip(s.angle + dt * s.rate, -1.5, 1.5)
        return -p.drag_n * s.angle**2 * moving(view)


@law("wake_bistability", "first", "highway")
@sizes(low_drag=(0.30, 0.50), up_mps=(19.0, 22.0), hysteresis_mps=(3.0, 6.0), mean_s=(15.0, 40.0))
class TwoWakes(Hidden):
    """Source: Grandemange, Gohlke and Cadot, J. Fluid Mech. 722 (2013): the wake of a blunt body has two
    states; their drag difference and the hysteresis in speed are exaggerated here."""

    def prepare(self) -> None:
        rng = self.rng(33)
        samples = int(self.setting.duration_s / 0.1) + 20
        self.flip = rng.random((self.setting.batch, samples)) < 0.1 / self.p.mean_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"attached": np.zeros(batch), "seen": np.full(1, -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.flip, 0.1)
        if at != s.seen[0]:
            s.seen[0] = at
            s.attached = np.where(self.flip[:, at], 1.0 - s.attached, s.attached)
        s.attached = np.where(view.speed < p.up_mps - p.hysteresis_mps, 0.0, s.attached)
        return p.low_drag * s.attached * view.drag_force


@law("tunnels", "second", "highway hills")
@sizes(blockage=(0.7, 1.8), along_s=(8.0, 25.0), carried=(0.3, 0.6), gap_m=(400.0, 900.0))
class Tunnels(OnRoad):
    """Worst at the portal; slow traffic ahead has set the air in motion by other amounts each time.
    Source: Drag in a tunnel grows with the blockage and falls as traffic drags the air along (the piston
    effect of road tunnel ventilation, PIARC); the lag and the sizes of a narrow tunnel are chosen here."""

    def prepare(self) -> None:
        rng, gap = self.rng(160), self.p.gap_m
        road = smooth_stretches(rng, self.rows(), (0.6 * gap, 1.6 * gap), (350.0, 900.0))
        self.road = (road > 0.02).astype(float)
        self.traffic = rng.uniform(0.0, 4.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": np.zeros(batch), "in": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        inside = self.read(self.road, view) > 0.0
        target = np.where(inside, np.maximum(p.carried * view.speed, self.traffic), 0.0)
        s.air = np.where(inside, s.air + dt * (target - s.air) / p.along_s, 0.0)
        vars(s)["in"] += dt * (inside - vars(s)["in"]) / 0.6
        relative = np.maximum(view.speed - s.air, 0.0) / np.maximum(view.speed, 1.0)
        return vars(s)["in"] * (1.0 - (1.0 + p.blockage) * relative**2) * view.drag_force


@law("trucks_that_pass", "fourth", "highway hills")
@sizes(holds=(1.0, 2.0), draws=(0.7, 1.5), every_s=(5.0, 12.0), width_s=(1.0, 2.0))
class TrucksThatPass(Hidden):
    """holds, draws: of the drag at the truck's own speed, but for a minimum of 10 m/s.
    Source: Pressure pulses of vehicles that pass (Baker, J. Wind Eng. Ind. Aerodyn. 24, 1986; measurements of
    overtaking, Noger, Regardin and Szechenyi, J. Fluids Struct. 20, 2005): a bow wave holds, a wake draws on,
    longer for an overtaker than for oncoming traffic; rates, and sizes of a narrow road, are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(390), self.setting.batch
        count = int(4.0 * self.setting.duration_s / self.p.every_s) + 20
        self.at_s = np.cumsum(rng.exponential(self.p.every_s, (batch, count)) + 1.5, axis=1)
        slow = rng.random((batch, count)) < 0.35  # overtakes, the others come towards
        self.width = self.p.width_s * np.where(slow, 1.6, 0.7)
        self.size = rng.uniform(0.5, 1.3, (batch, count))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        nearest = np.abs(self.at_s - view.time).argmin(axis=1)
        row = np.arange(len(nearest))
        x = (view.time - self.at_s[row, nearest]) / self.width[row, nearest]
        before = p.holds * np.exp(-(((x + 0.5) / 0.4) ** 2))
        after = p.draws * np.exp(-(((x - 0.6) / 0.5) ** 2))
        least = 0.5 * self.truck.air_density * self.truck.drag_area * np.maximum(view.speed, 10.0) ** 2
        pulse = self.size[row, nearest] * (after - before)
        return pulse * least * np.clip(view.speed / 4.0, 0.0, 1.0)


@law("w_open_box_sings", "twelfth", "highway hills suburban")
@sizes(most=(0.6, 1.1), at_mps=(10.0, 15.0), wide=(0.12, 0.22), locks_s=(0.8, 3.0), next_up=(1.45, 1.7))
class OpenBoxSings(Hidden, sings=0.0):
    """`sings`: strength of the swing of air over an open box. Near two speeds waves in the box and eddies of
    its edge feed each other, and a swing that is there keeps its band wider than one that has to begin. most:
    of the drag, in full swing; next_up: speed of the second over the first.
    Source: Rossiter, Wind Tunnel Experiments on the Flow over Rectangular Cavities at Subsonic and Transonic
    Speeds, ARC R&M 3438 (1964), and Gharib and Roshko, The Effect of Flow Oscillations on Cavity Drag, J.
    Fluid Mech. 177 (1987): drag rises manyfold in a wake mode; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wide = p.wide * (0.6 + 0.6 * np.clip(s.sings, 0.0, 1.0))
        first = np.abs(view.speed / p.at_mps - 1.0) / wide
        second = np.abs(view.speed / (p.next_up * p.at_mps) - 1.0) / wide
        near = 1.0 / (1.0 + np.minimum(first, second) ** 6)
        s.sings = s.sings + dt * (near - s.sings) / np.where(near > s.sings, p.locks_s, 0.5 * p.locks_s)
        low = 0.5 * self.truck.air_density * self.truck.drag_area * p.at_mps**2
        return -p.most * s.sings * np.maximum(view.drag_force, low * moving(view)) * moving(view)


@law("y_holds_against_the_side_wind", "eighteenth", "highway hills suburban")
@sizes(costs=(0.0028, 0.005), gusts_s=(4.0, 12.0), mean=(0.4, 0.9), steers_s=(0.4, 1.2), most=(0.011, 0.017))
@sizes(light=(0.5, 1.0))
class HoldsAgainstTheSideWind(OnRoad, slips=0.0):
    """The wind blows from the side, and tyres hold against it by running askew, which costs the square of the
    side force. `slips`: their angle, over the usual one. Gusts pass within seconds, and a light truck has to
    run more askew. costs: of the weight, at the usual angle; mean: of the wind, beside its gusts; light:
    power of the mass; most: of the weight.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991), on side forces, and
    Pacejka, Tire and Vehicle Dynamics (2012), on drag by slip angle; strong winds, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1874), self.p
        samples = int(self.setting.duration_s / 0.25) + 8
        gusts = ou_series(rng, (self.setting.batch, samples), 0.25, p.gusts_s)
        self.side = rng.choice([-1.0, 1.0]) * p.mean + gusts

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = self.side[:, index(view, self.side, 0.25)]
        fast = np.clip(view.speed / 15.0, 0.0, 1.8)
        light = (20000.0 / np.maximum(view.mass, 8000.0)) ** p.light
        s.slips = eased(s.slips, wind * np.abs(wind) * (0.4 + 0.6 * fast) * light, p.steers_s, dt)
        askew = p.most * np.tanh(p.costs / p.most * s.slips**2)
        return -askew * weight(view) * moving(view)


@law("b_drum_turns_in_the_side_wind", "twentieth", "suburban hills highway")
@sizes(most=(0.016, 0.027), gusts_s=(5.0, 14.0), mean=(0.3, 0.8), at_rads=(120.0, 150.0), spins_s=(1.5, 5.0))
class DrumTurnsInTheSideWind(Hidden, spin=0.6):
    """An upright drum turns on the truck, by its engine, and the wind comes from the side: it is drawn across
    that wind, forwards or back as the wind has it, whatever the truck's speed. `spin` of the drum follows the
    engine slowly. most: of 20 t, at at_rads in the usual wind.
    Source: Seifert, A Review of the Magnus Effect in Aeronautics, Progress in Aerospace Sciences 55 (2012),
    on forces by spin and wind; a huge drum, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2003), self.p
        samples = int(self.setting.duration_s / SAMPLE_S) + 8
        gusts = ou_series(rng, (self.setting.batch, samples), SAMPLE_S, p.gusts_s)
        self.side = rng.choice([-1.0, 1.0], (self.setting.batch, 1)) * p.mean + 0.8 * gusts

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.spin = eased(s.spin, np.clip(view.engine_speed / p.at_rads, 0.0, 1.6), p.spins_s, dt)
        wind = self.side[:, index(view, self.side, SAMPLE_S)]
        share = (view.time / SAMPLE_S) % 1.0
        later = self.side[:, min(index(view, self.side, SAMPLE_S) + 1, self.side.shape[1] - 1)]
        blows = np.clip(wind + share * (later - wind), -2.2, 2.2)
        return p.most * 20000.0 * 9.81 * s.spin**1.5 * blows * moving(view)


@law("u_somebody_follows_closely", "twenty-first", "highway hills")
@sizes(
    most=(0.75, 0.95), reach_m=(12.0, 22.0), least_m=(2.0, 4.5), headway_s=(0.15, 0.35), stays_s=(30.0, 80.0)
)
class SomebodyFollowsClosely(Hidden, gap=12.0, pace=-1.0, saved=0.0):
    """A coach follows so closely that its bow fills the truck's wake and pushes it along. `gap` m behind the
    truck, `pace` m/s of the coach: it falls back when the truck draws away, and comes near as the truck
    slows. It stays for a while and overtakes, and another comes. most: of the drag, at no gap.
    Source: Zabat, Stabile, Farascaroli and Browand, The Aerodynamic Performance of Platoons, report
    UCB-ITS-PRR-95-35 (1995), on savings of the vehicle ahead; a bold driver, sizes are chosen here."""

    def prepare(self) -> None:
        stays = (0.5 * self.p.stays_s, 1.5 * self.p.stays_s)
        self.there = spells(self.rng(2102), self.setting.batch, stays, (15.0, 50.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pace = np.where(s.pace < 0.0, view.speed, s.pace)
        there = within(self.there, view.time)
        wish = p.least_m + p.headway_s * view.speed + 60.0 * (1.0 - there)
        pulls = np.clip(0.12 * (s.gap - wish) + 0.7 * (view.speed - s.pace), -3.5, 1.0)
        s.pace = np.maximum(s.pace + dt * pulls, 0.0)
        s.gap = np.clip(s.gap + dt * (view.speed - s.pace), 1.0, 120.0)
        s.saved = eased(s.saved, p.most * np.exp(-s.gap / p.reach_m), 0.5, dt)
        return s.saved * view.drag_force * moving(view)
