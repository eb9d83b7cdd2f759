"""Wind."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import davenport, ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="headwind", accepts="drag_area")

YAW_DEG = np.array([0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0, 30.0, 60.0])
YAW_RISE = np.array([0.0, 0.05, 0.17, 0.33, 0.46, 0.52, 0.50, 0.32, 0.0])


@law("headwind", "first", "highway hills")
@sizes(wind_mps=(5.0, 12.0), turbulence=(0.10, 0.22), length_m=(150.0, 300.0), yaw_drag=(1.0, 2.5))
@sizes(from_deg=(0.0, 360.0))
class Wind(Hidden):
    """One wind for all recordings, from one direction; every road has its own winding heading.
    Source: Gusts by the Dryden (first-order) form of MIL-F-8785C, which approximates Kaimal's spectrum of IEC
    61400-1; drag area grows with yaw as SAE J1252 measures it; winding heading of the road."""

    def prepare(self) -> None:
        rng = self.rng(1)
        samples = int(self.setting.duration_s / 0.1) + 20
        shape = (self.setting.batch, samples)
        scale_s = self.p.length_m / max(self.p.wind_mps + 15.0, 1.0)
        self.gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        self.side_gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        routes = int(self.setting.route.max()) + 1
        self.bearing = rng.uniform(0.0, 2.0 * np.pi, routes)[self.setting.route]
        self.wave = rng.uniform(1500.0, 5000.0, routes)[self.setting.route]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.gust, 0.1)
        heading = self.bearing + 0.8 * np.sin(2.0 * np.pi * self.place(view) / self.wave)
        heading = heading + np.pi * (self.setting.direction < 0)
        angle = np.deg2rad(p.from_deg) - heading
        along = view.speed + p.wind_mps * np.cos(angle) + self.gust[:, at]
        across = p.wind_mps * np.sin(angle) + self.side_gust[:, at]
        yaw = np.arctan2(across, np.maximum(np.abs(along), 1.0))
        area = self.truck.drag_area * (1.0 + p.yaw_drag * np.sin(yaw) ** 2)
        wanted = 0.5 * self.truck.air_density * area * along * np.hypot(along, across)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("wind_in_gaps", "second", "highway hills")
@sizes(scale_mps=(8.0, 13.0), shelter=(0.45, 0.8), gap_m=(250.0, 700.0), gust=(0.3, 0.6), per_yaw=(0.3, 0.8))
class WindInGaps(Hidden):
    """Every recording has its own day: mean wind and angle to the road. shelter: share of the wind taken
    behind the trees; gust: of the mean wind; per_yaw: 1/rad.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991): drag coefficient
    linear in yaw; Weibull mean winds (Troen and Petersen, European Wind Atlas, 1989); discrete 1-cos gusts as
    in CS-25.341; shelter of woods and cuttings fixed to the road is chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(101), self.setting.batch
        mean = np.clip(self.p.scale_mps * rng.weibull(2.0, batch), 4.0, 17.0)
        angle = rng.uniform(0.0, 2.0 * np.pi, batch)
        self.along, self.across = mean * np.cos(angle), np.abs(mean * np.sin(angle))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (int(self.setting.route.max()) + 1, 2))
        slots = int(self.setting.duration_s / 10.0) + 3
        self.gust = self.p.gust * (rng.random((batch, slots)) < 0.35) * rng.uniform(0.5, 1.0, (batch, slots))
        self.gust_s = rng.uniform(3.0, 9.0, (batch, slots))

    def exposure(self, at: Array) -> Array:
        """From 1 - shelter to 1 along the road."""
        phase, wave = self.phase[self.setting.route], 2.0 * np.pi / self.p.gap_m
        trees = np.sin(0.5 * wave * at + phase[:, 0]) + 0.7 * np.sin(0.31 * wave * at + phase[:, 1])
        return 1.0 - self.p.shelter / (1.0 + np.exp(-6.0 * trees))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slot = index(view, self.gust, 10.0)
        inside = np.clip((view.time - 10.0 * slot) / self.gust_s[:, slot], 0.0, 1.0)
        gust = 0.5 * self.gust[:, slot] * (1.0 - np.cos(2.0 * np.pi * inside))
        blows = self.exposure(self.place(view)) * (1.0 + gust)
        met = view.speed + self.along * blows
        yaw = np.minimum(self.across * blows / np.maximum(np.abs(met), 5.0), 0.5)
        half_density = 0.5 * self.truck.air_density * self.truck.drag_area
        wanted = half_density * (1.0 + p.per_yaw * yaw) * met * np.abs(met)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("passing_front", "third", "highway hills")
@sizes(after_mps=(8.0, 14.0), before=(0.1, 0.5), turbulence=(0.12, 0.24), scale_m=(80.0, 250.0))
@sizes(yaw_drag=(1.0, 2.2), from_deg=(0.0, 360.0))
class PassingFront(Hidden):
    """before: of the wind after the front; yaw_drag: 1/rad2.
    Source: Von Karman's spectrum (MIL-HDBK-1797) frozen into the air by Taylor's hypothesis, as a sum of
    waves met at road plus wind; the mean wind rises and veers as a front passes; drag with yaw squared (SAE
    J1252 wind tunnel practice); polygon roads, sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(201), self.setting.batch
        self.front_s = rng.uniform(0.1, 0.7, batch) * self.setting.duration_s
        self.veer = np.deg2rad(self.p.from_deg + rng.normal(0.0, 25.0, batch))
        self.wave = 2.0 * np.pi / np.geomspace(25.0, 2500.0, 18)[:, None]
        power = (1.0 + 70.8 * (self.wave * self.p.scale_m / (2.0 * np.pi)) ** 2) ** (-5.0 / 6.0) * self.wave
        self.size = self.p.turbulence * np.sqrt(2.0 * power / power.sum())
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (18, batch))
        routes = int(self.setting.route.max()) + 1
        self.bearing = rng.uniform(0.0, 2.0 * np.pi, (routes, 1)) + np.cumsum(
            rng.normal(0.0, 0.45, (routes, 200)), axis=1
        )

    def heading(self, at: Array) -> Array:
        """Of the road, which bends every 700 m, rad."""
        leg = (at / 700.0).astype(int) % self.bearing.shape[1]
        return self.bearing[self.setting.route, leg] + np.pi * (self.setting.direction < 0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        passed = 0.5 + 0.5 * np.tanh((view.time - self.front_s) / 15.0)
        mean = p.after_mps * (p.before + (1.0 - p.before) * passed)
        met = self.wave * (view.distance + mean * view.time) + self.phase
        wind = mean * (1.0 + (self.size * np.sin(met)).sum(axis=0))
        angle = self.veer + 1.2 * passed - self.heading(self.place(view))
        along, across = view.speed + wind * np.cos(angle), wind * np.sin(angle)
        yaw = np.clip(np.arctan2(across, np.maximum(along, 2.0)), -0.6, 0.6)
        area = self.truck.drag_area * (1.0 + p.yaw_drag * yaw**2)
        wanted = 0.5 * self.truck.air_density * area * along * np.abs(along)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("station_gusts", "fourth", "highway hills")
@sizes(station_mps=(10.0, 17.0), roughness_m=(0.02, 0.12), yaw=(0.7, 1.4), veers_deg=(20.0, 60.0))
class StationGusts(Hidden):
    """Every drive has another hour of one windy day; a road keeps to its corridor. yaw: of the table's rise.
    Source: Davenport, The Spectrum of Horizontal Gustiness near the Ground in High Winds, Q. J. R. Met. Soc.
    87 (1961), brought from a station's 10 m to a truck's height by the logarithmic law and met faster by a
    moving observer (Cooper, J. Wind Eng. Ind. Aerodyn. 17, 1984); drag over yaw as tunnel tables of
    tractor-trailers show it, rising to 15 degrees and then falling; sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(301), self.setting.batch
        height = np.log(2.7 / self.p.roughness_m)
        hour = self.p.station_mps * rng.uniform(0.7, 1.15, batch)
        self.mean = hour * height / np.log(10.0 / self.p.roughness_m)
        self.angle = rng.uniform(0.0, 2.0 * np.pi) + np.deg2rad(self.p.veers_deg) * rng.normal(
            0.0, 1.0, batch
        )
        corridor = rng.uniform(0.0, 2.0 * np.pi, int(self.setting.route.max()) + 1)
        self.angle = self.angle - corridor[self.setting.route] - np.pi * (self.setting.direction < 0)
        per_hz = (1200.0 / (hour + 20.0))[:, None]
        shape = (batch, 2 * (int(self.setting.duration_s / 0.2) // 2) + 20)
        self.gust = 1.0 + davenport(rng, shape, 0.2, per_hz) / height
        self.swing = 0.22 * davenport(rng, shape, 0.2, per_hz)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.gust, 0.2)
        wind = self.mean * np.maximum(self.gust[:, at], 0.0)
        angle = self.angle + self.swing[:, at]
        along, across = view.speed + wind * np.cos(angle), wind * np.sin(angle)
        yaw = np.rad2deg(np.abs(np.arctan2(across, np.maximum(np.abs(along), 3.0))))
        rise = 1.0 + p.yaw * np.interp(yaw, YAW_DEG, YAW_RISE)
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * rise * along * np.hypot(along, across)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("downbursts", "sixth", "highway hills")
@sizes(outflow_mps=(11.0, 20.0), peak_m=(450.0, 950.0), lives_s=(120.0, 330.0))
class Downbursts(Hidden):
    """Three in each drive. Off the road's line they blow from the side as well, which costs nothing here.
    peak_m: from the centre to the strongest wind.
    Source: Oseguera and Bowles, A Simple, Analytic 3-Dimensional Downburst Model Based on Boundary Layer
    Stagnation Flow, NASA TM-100632 (1988): air falls to the ground and flows off to all sides, so that a
    truck meets it from the front, then from behind; growth and decay in minutes after Fujita, The Downburst
    (1985); places and sizes are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(501), (3, self.setting.batch)
        lasts = self.setting.duration_s
        self.centre = rng.uniform(0.05, 1.0, shape) * 20.0 * lasts
        self.aside = rng.normal(0.0, 0.5, shape) * self.p.peak_m
        self.begins = self.centre / 20.0 - rng.uniform(0.25, 0.75, shape) * self.p.lives_s
        self.size = rng.uniform(0.55, 1.0, shape) * self.p.outflow_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = view.distance - self.centre
        away = np.maximum(np.hypot(along, self.aside), 1.0)
        radius = away / p.peak_m
        life = np.sin(np.pi * np.clip((view.time - self.begins) / p.lives_s, 0.0, 1.0))
        outward = self.size * life * radius * np.exp(0.5 * (1.0 - radius**2))
        air = view.speed - (outward * along / away).sum(axis=0)
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * air * np.abs(air)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("wind_round_the_oval", "seventh", "highway hills")
@sizes(wind_mps=(6.0, 11.0), yaw=(1.0, 3.0), round_m=(1400.0, 3200.0), veers_s=(25.0, 90.0))
class WindRoundTheOval(Hidden):
    """Straights and bends follow each other along the way; wind along the road is wind at an angle soon. yaw:
    more drag for each rad squared of yaw.
    Source: SAE J1263, Road Load Measurement and Dynamometer Simulation Using Coastdown Techniques, and
    Regulation (EU) 2017/2400, annex VIII: wind is limited and runs are made both ways, because on an oval it
    comes from all sides, and drag rises with the angle of yaw."""

    def prepare(self) -> None:
        rng, one = self.rng(701), self.setting
        self.first = rng.uniform(-np.pi, np.pi)
        slots = int(one.duration_s) + 2
        self.veer = 0.4 * ou_series(rng, (1, slots), 1.0, self.p.veers_s)[0]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lap = (self.place(view) / p.round_m) % 1.0
        # half a turn in each bend, a quarter of the lap long
        turned = np.pi * (np.clip(4.0 * lap - 1.0, 0.0, 1.0) + np.clip(4.0 * lap - 3.0, 0.0, 1.0))
        angle = self.first + turned + self.veer[int(view.time) % len(self.veer)]
        along = view.speed + self.setting.direction * p.wind_mps * np.cos(angle)
        across = p.wind_mps * np.sin(angle)
        total = np.hypot(along, across)
        yaw = np.minimum(np.abs(np.arctan2(across, np.maximum(np.abs(along), 1.0))), 0.5)
        area = 0.5 * self.truck.air_density * self.truck.drag_area * (1.0 + p.yaw * yaw**2)
        return (view.drag_force - area * total * along) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("s_rolls_of_the_boundary_layer", "eighth", "highway hills")
@sizes(mean_mps=(2.0, 6.0), rolls_mps=(2.5, 5.0), length_m=(500.0, 1800.0), drifts_mps=(1.0, 6.0))
class Rolls(Hidden):
    """Bands of wind that drift over the road, met faster or slower by the way one drives.
    Source: Etling and Brown, Roll Vortices in the Planetary Boundary Layer, Boundary-Layer Meteorology 65
    (1993): regular bands of fast and slow air; two wavelengths, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(801), self.setting.batch
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (2, batch))
        self.mean = self.p.mean_mps * rng.choice([-1.0, 1.0]) * self.setting.direction

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) - p.drifts_mps * view.time
        long = np.sin(2.0 * np.pi * at / p.length_m + self.phase[0])
        short = np.sin(2.0 * np.pi * at / (0.37 * p.length_m) + self.phase[1])
        wind = self.mean + self.setting.direction * p.rolls_mps * (0.7 * long + 0.45 * short)
        speed = np.maximum(view.speed, 0.5)
        relative = np.clip(1.0 + wind / speed, -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("n_gusts_of_the_standard", "ninth", "highway hills")
@sizes(
    mean_mps=(3.0, 7.0), gust_mps=(9.0, 16.0), lasts_s=(8.0, 16.0), every_s=(8.0, 25.0),
    winds_m=(1500.0, 5000.0), turns_rad=(0.5, 1.3),
)  # fmt: skip
class GustsOfTheStandard(Hidden):
    """Each gust dips, rises and dips again, in a mean wind through which the road winds.
    Source: IEC 61400-1, Wind Turbines, Design Requirements: the extreme operating gust is -0.37 of its size
    times sin(3 pi t/T)(1 - cos(2 pi t/T)); how often, how strong, and the road's turns are chosen here."""

    def prepare(self) -> None:
        rng, p, batch = self.rng(901), self.p, self.setting.batch
        shape = (batch, int(2.0 * self.setting.duration_s / p.lasts_s) + 8)
        pauses = p.lasts_s + rng.exponential(p.every_s, shape)
        self.begins = np.cumsum(pauses, axis=1) - p.every_s
        self.size = p.gust_mps * rng.uniform(0.5, 1.2, shape) * rng.choice([-0.6, 1.0, 1.0], shape)
        self.blows = rng.uniform(0.0, 2.0 * np.pi)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, int(self.setting.route.max()) + 1)

    def gust(self, time: float) -> Array:
        """(batch,) m/s."""
        last = np.maximum((self.begins <= time).sum(axis=1) - 1, 0)
        row = np.arange(len(last))
        x = np.clip((time - self.begins[row, last]) / self.p.lasts_s, 0.0, 1.0)
        return np.asarray(-0.37 * self.size[row, last] * np.sin(3 * np.pi * x) * (1 - np.cos(2 * np.pi * x)))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = 2.0 * np.pi * self.place(view) / p.winds_m + self.phase[self.setting.route]
        angle = self.blows - p.turns_rad * np.sin(at)
        wind = p.mean_mps + self.gust(view.time)
        speed = np.maximum(view.speed, 0.5)
        along = speed + self.setting.direction * wind * np.cos(angle)
        total = np.hypot(along, wind * np.sin(angle))
        felt = np.clip(along * total / speed**2, -2.0, 4.0) - 1.0
        return -felt * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("w_bursts_in_a_calm_night", "twelfth", "highway hills")
@sizes(aloft_mps=(13.0, 20.0), builds_s=(25.0, 60.0), mixes_s=(4.0, 10.0), critical=(0.55, 0.75))
class BurstsInACalmNight(Hidden):
    """`shear`: wind aloft over its most, which grows while the air below lies still; `mixed`: 1 while it
    breaks and the wind comes down, until the shear is spent. aloft_mps: at its most.
    Source: Van de Wiel, Ronda, Moene, de Bruin and Holtslag, Intermittent Turbulence and Oscillations in the
    Stable Boundary Layer over Land, J. Atmospheric Sciences 59 (2002): a loop of decoupling and bursts;
    quicker ones, in basins that trucks drive through, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1101), self.setting.batch
        self.side = rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.0)
        self.gusts = ou_series(rng, (batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 2.0)
        self.begins = rng.uniform(0.2, 1.0, batch)

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.begins, batch)
        return {"shear": first * self.p.critical, "mixed": np.zeros(batch), "bursts": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.bursts = np.where(s.shear > p.critical, 1.0, np.where(s.shear < 0.3 * p.critical, 0.0, s.bursts))
        s.mixed = s.mixed + dt * (s.bursts - s.mixed) / 1.5
        falls = s.mixed * s.shear / p.mixes_s
        s.shear = np.clip(s.shear + dt * ((1.0 - s.shear) / p.builds_s - falls), 0.0, 1.0)
        gust = 1.0 + 0.25 * self.gusts[:, index(view, self.gusts, 0.1)]
        wind = p.aloft_mps * s.shear * (0.12 + 0.88 * s.mixed * gust)
        along = self.side * self.setting.direction * wind
        relative = np.clip(1.0 + along / np.maximum(view.speed, 0.5), -1.0, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("q_traffic_drags_the_air", "fifteenth", "highway hills")
@sizes(
    most_mps=(7.0, 11.0), along=(0.35, 0.7), dies_s=(4.0, 12.0), platoon_s=(14.0, 40.0), pause_s=(15.0, 45.0)
)
class TrafficDragsTheAir(Hidden, against=0.0, behind=0.0):
    """`against`, `behind`: share of the air that platoons have set in motion, those who come the other way
    and those who drive ahead. It is there at once and dies away after the last of them. most_mps: of the
    wind against, at 20 m/s; along: of that, from the own lane.
    Source: Eskridge and Hunt, Highway Modeling, Part I: Prediction of Velocity and Turbulence Fields in the
    Wake of Vehicles, J. Applied Meteorology 18 (1979); a narrow road, platoons and sizes are chosen here."""

    def prepare(self) -> None:
        rng, on = self.rng(1501), (0.5 * self.p.platoon_s, 1.5 * self.p.platoon_s)
        off = (0.5 * self.p.pause_s, 1.5 * self.p.pause_s)
        self.come = spells(rng, self.setting.batch, on, off)
        self.lead = spells(rng, self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        come, lead = within(self.come, view.time), within(self.lead, view.time)
        s.against = eased(s.against, come, np.where(come > s.against, 1.5, p.dies_s), dt)
        s.behind = eased(s.behind, lead, np.where(lead > s.behind, 4.0, p.dies_s), dt)
        pace = 0.3 + 0.7 * np.clip(view.speed / 20.0, 0.0, 1.3)
        wind = p.most_mps * pace * (s.against - p.along * s.behind)
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 3.0), 0.0, 3.0)
        return -(relative**2 - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
