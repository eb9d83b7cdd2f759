"""Fourth forms of the air: weather-station gusts, valley winds, convoys, fairings that deploy."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, ou_series, place
from deeptruck_model.trucks import View

YAW_DEG = np.array([0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0, 30.0, 60.0])
YAW_RISE = np.array([0.0, 0.05, 0.17, 0.33, 0.46, 0.52, 0.50, 0.32, 0.0])


def davenport(rng: np.random.Generator, shape: tuple[int, int], dt: float, per_hz: Array) -> Array:
    """Unit-variance series of Davenport's spectrum along the last axis; `per_hz` (batch, 1) is the reduced
    frequency of 1 Hz."""
    hertz = np.fft.rfftfreq(shape[1], dt)[None, 1:]
    reduced = per_hz * hertz
    power = reduced**2 / (1.0 + reduced**2) ** (4.0 / 3.0) / hertz
    lines = np.sqrt(power) * np.exp(2j * np.pi * rng.random(power.shape))
    series = np.fft.irfft(np.concatenate([np.zeros((shape[0], 1)), lines], axis=1), shape[1], axis=1)
    return np.asarray(series / np.maximum(series.std(axis=1, keepdims=True), 1e-9))


@hidden(
    "station_gusts",
    name="headwind",
    forms="fourth",
    source="Davenport, The Spectrum of Horizontal Gustiness near the Ground in High Winds, Q. J. R. Met. Soc."
    " 87 (1961), brought from a station's 10 m to a truck's height by the logarithmic law and met faster by"
    " a moving observer (Cooper, J. Wind Eng. Ind. Aerodyn. 17, 1984); drag over yaw as tunnel tables of"
    " tractor-trailers show it, rising to 15 degrees and then falling; sizes chosen here",
    ranges={
        "station_mps": (10.0, 17.0),
        "roughness_m": (0.02, 0.12),
        "yaw": (0.7, 1.4),  # of the table's rise
        "veers_deg": (20.0, 60.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class StationGusts(Hidden):
    """Every drive has another hour of one windy day; a road keeps to its corridor."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(301), self.setting.batch
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

    def newtons(self, view: View, dt: float) -> Array:
        at = min(int(view.time / 0.2), self.gust.shape[1] - 1)
        wind = self.mean * np.maximum(self.gust[:, at], 0.0)
        angle = self.angle + self.swing[:, at]
        along, across = view.speed + wind * np.cos(angle), wind * np.sin(angle)
        yaw = np.rad2deg(np.abs(np.arctan2(across, np.maximum(np.abs(along), 3.0))))
        rise = 1.0 + self.p.yaw * np.interp(yaw, YAW_DEG, YAW_RISE)
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * rise * along * np.hypot(along, across)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "valley_wind",
    name="headwind",
    forms="fourth",
    source="Whiteman, Mountain Meteorology (2000), on along-valley winds: up the valley by day, weaker and"
    " down it by night, whatever the synoptic wind; faster where the valley narrows; sizes chosen here",
    ranges={"noon_mps": (8.0, 14.0), "night": (0.4, 0.7), "narrows": (0.3, 0.7), "each_m": (500.0, 1600.0)},
    needs=("hills", "highway"),
    accepts=("drag_area",),
)
class ValleyWind(Hidden):
    """Follows the road: a head wind one way is a tail wind the other."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(302), self.setting.batch
        hour = rng.uniform(0.0, 2.0 * np.pi, batch)
        day = np.sin(hour)
        self.wind = self.p.noon_mps * np.where(day > 0.0, np.sqrt(np.abs(day)), self.p.night * day)
        routes = int(self.setting.route.max()) + 1
        self.wide = self.p.narrows * ou_series(rng, (routes, 1200), 50.0, self.p.each_m)
        samples = int(self.setting.duration_s / 0.5) + 4
        self.puff = 0.14 * ou_series(rng, (batch, samples), 0.5, 6.0)

    def newtons(self, view: View, dt: float) -> Array:
        cell = place(self.setting, view) / 50.0
        low, rows = cell.astype(int) % 1199, self.setting.route
        share = cell - np.floor(cell)
        wide = (1.0 - share) * self.wide[rows, low] + share * self.wide[rows, low + 1]
        channel = np.exp(np.clip(wide, -1.0, 0.7)) + self.puff[:, int(view.time / 0.5)]
        met = view.speed + self.setting.direction * self.wind * channel
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * met * np.abs(met)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "out_of_the_slot",
    name="drafting",
    forms="fourth",
    source="Track tests of platoons (Lammert, Duran, Diez, Burton and Nicholson, SAE 2014-01-2438; McAuliffe"
    " and others, NRC LTR-AL-2017-0008): saving level at short gaps, then exponential in gap, less with"
    " lateral offset and in a cross wind; offsets of human steering and sizes are chosen here",
    ranges={
        "saving": (0.50, 0.75),
        "level_m": (9.0, 16.0),
        "fades_m": (35.0, 70.0),
        "half_width_m": (0.9, 1.9),
        "steers_s": (8.0, 25.0),
    },
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class OutOfTheSlot(Hidden):
    """Whoever drifts half a lane to see past the leader is out of the slot."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(303), self.setting.batch
        samples = int(self.setting.duration_s / 0.5) + 4
        wander = 0.45 * ou_series(rng, (batch, samples), 0.5, self.p.steers_s)
        offset = np.abs(wander + rng.normal(0.0, 0.3, (batch, 1)))
        self.hits = np.exp(-((offset / self.p.half_width_m) ** 2)) * rng.uniform(0.85, 1.0, (batch, 1))

    def newtons(self, view: View, dt: float) -> Array:
        at = min(int(view.time / self.setting.dt), self.setting.leader_m.shape[1] - 1)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e4)
        fades = np.exp(-np.maximum(gap - self.p.level_m, 0.0) / self.p.fades_m)
        return self.p.saving * fades * self.hits[:, int(view.time / 0.5)] * view.drag_force


@hidden(
    "self_deploying_fairings",
    name="drag_area",
    forms="fourth",
    source="Boat tails and gap seals that unfold by themselves above a road speed and stow below another"
    " (supplier manuals of automatic trailer tails; EU Regulation 2019/1892 on rear devices); the simulator"
    " knows the truck with all of them out; worn actuators and sizes are chosen here",
    ranges={
        "gain": (0.5, 0.95),
        "out_mps": (20.0, 22.5),
        "below_mps": (3.0, 5.5),
        "after_s": (4.0, 15.0),
        "fails": (0.1, 0.4),
    },
    needs=("highway", "hills"),
    accepts=("headwind", "rolling_resistance_speed"),
)
class SelfDeployingFairings(Hidden):
    """The drag of one speed depends on the speeds before."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(304), self.setting.batch
        self.works = rng.random(batch) > self.p.fails
        self.first = rng.random(batch) < 0.5

    def start(self, batch: int) -> dict[str, Array]:
        out = (self.first & self.works).astype(float)
        return {"wanted": out, "out": out.copy(), "fast": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.fast = np.where(view.speed > p.out_mps, s.fast + dt, 0.0)
        unfold = (s.fast > p.after_s) & self.works
        stow = view.speed < p.out_mps - p.below_mps
        s.wanted = np.where(unfold, 1.0, np.where(stow, 0.0, s.wanted))
        s.out = s.out + np.clip(s.wanted - s.out, -dt / 3.0, dt / 3.0)
        return -p.gain * (1.0 - s.out) * view.drag_force
