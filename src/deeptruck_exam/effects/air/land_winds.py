"""Wind that the land makes: along valleys, over crests, down slopes, beside woods; and behind mills."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index
from deeptruck_exam.effects.places import CELL_M, CELLS, MAP_CELL_M, MAP_CELLS, OnRoad, sections, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, arrivals, ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="headwind", accepts="drag_area")
WHIRLS = 400  # over all the road
FARMS, MILLS = 28, 14  # along all the road, and in each farm


@law("valley_wind", "fourth", "hills highway")
@sizes(noon_mps=(8.0, 14.0), night=(0.4, 0.7), narrows=(0.3, 0.7), each_m=(500.0, 1600.0))
class ValleyWind(Hidden):
    """Follows the road: a head wind one way is a tail wind the other.
    Source: Whiteman, Mountain Meteorology (2000), on along-valley winds: up the valley by day, weaker and
    down it by night, whatever the synoptic wind; faster where the valley narrows; sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(302), self.setting.batch
        hour = rng.uniform(0.0, 2.0 * np.pi, batch)
        day = np.sin(hour)
        self.wind = self.p.noon_mps * np.where(day > 0.0, np.sqrt(np.abs(day)), self.p.night * day)
        routes = int(self.setting.route.max()) + 1
        self.wide = self.p.narrows * ou_series(rng, (routes, 1200), 50.0, self.p.each_m)
        samples = int(self.setting.duration_s / 0.5) + 4
        self.puff = 0.14 * ou_series(rng, (batch, samples), 0.5, 6.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cell = self.place(view) / 50.0
        low, rows = cell.astype(int) % 1199, self.setting.route
        share = cell - np.floor(cell)
        wide = (1.0 - share) * self.wide[rows, low] + share * self.wide[rows, low + 1]
        channel = np.exp(np.clip(wide, -1.0, 0.7)) + self.puff[:, int(view.time / 0.5)]
        met = view.speed + self.setting.direction * self.wind * channel
        wanted = 0.5 * self.truck.air_density * self.truck.drag_area * met * np.abs(met)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("wind_over_the_crests", "fifth", "highway hills")
@sizes(mean_mps=(6.0, 11.0), per_20m=(0.25, 0.6), gusts=(0.25, 0.5), decay_s=(4.0, 14.0), yaw_drag=(0.6, 1.3))
class WindOverTheCrests(Hidden):
    """The surroundings are the heights of the last kilometre or so. per_20m: speed-up for each 20 m above the
    surroundings; gusts: of the mean wind.
    Source: Jackson and Hunt, Turbulent Wind Flow over a Low Hill, Q. J. R. Met. Soc. 101 (1975): wind grows
    on a crest and is weak in a hollow; gusts with a sharp front and a long tail (Gao, Shaw and Paw U,
    Boundary-Layer Met. 47, 1989) as shot noise; drag over yaw as a power 1.4, sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(401), self.setting.batch
        slots = int(self.setting.duration_s / SAMPLE_S) + 20
        self.gust = arrivals(rng, (batch, slots), 7.0, self.p.decay_s)
        bearing = rng.uniform(0.0, 2.0 * np.pi, int(self.setting.route.max()) + 1)
        day = rng.uniform(0.0, 2.0 * np.pi) + 0.35 * rng.standard_normal(batch)
        self.angle = day - bearing[self.setting.route] - np.pi * (self.setting.direction < 0)
        self.mean = self.p.mean_mps * rng.uniform(0.75, 1.2, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"around": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        climbs = np.maximum(view.speed, 0.0) * view.grade * dt
        above = np.where(np.isnan(s.around), 0.0, s.around) + climbs
        s.around = above * (1.0 - dt * np.maximum(view.speed, 0.0) / 1200.0)
        at = index(view, self.gust, SAMPLE_S)
        blows = (1.0 - p.gusts + p.gusts * np.minimum(self.gust[:, at], 4.0)) * np.exp(
            np.clip(p.per_20m * s.around / 20.0, -1.2, 0.8)
        )
        along = view.speed + self.mean * blows * np.cos(self.angle)
        across = self.mean * blows * np.sin(self.angle)
        yaw = np.arctan2(np.abs(across), np.maximum(np.abs(along), 3.0))
        area = self.truck.drag_area * (1.0 + p.yaw_drag * np.minimum(yaw, 0.7) ** 1.4)
        wanted = 0.5 * self.truck.air_density * area * along * np.abs(along)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("t_slope_wind_pulses", "tenth", "hills highway")
@sizes(wind_mps=(7.5, 12.0), land_m=(200.0, 600.0), valley=(0.3, 0.6), pulse_s=(40.0, 110.0))
@sizes(depth=(0.3, 0.7))
class SlopeWindPulses(Hidden):
    """Cold air drains down whatever slope there is, so that it blows against who climbs, and pulses as it
    does. `land`: slope of the land, smoothed over land_m; valley: share of wind along each valley.
    Source: McNider, A Note on Velocity Fluctuations in Drainage Flows, J. Atmos. Sci. 39 (1982), and Prandtl,
    Essentials of Fluid Dynamics (1952), on mountain winds; strengths and periods are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(951)
        falls = rng.choice([-1.0, 1.0], int(self.setting.route.max()) + 1)
        self.valley = self.p.valley * falls[self.setting.route] * self.setting.direction
        self.phase = rng.uniform(0.0, 2.0 * np.pi, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"land": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.land = np.where(np.isnan(s.land), view.grade, s.land)
        s.land = s.land + dt * np.maximum(view.speed, 0.0) * (view.grade - s.land) / p.land_m
        pulse = 1.0 + p.depth * np.sin(2.0 * np.pi * view.time / p.pulse_s + self.phase)
        wind = p.wind_mps * pulse * (np.tanh(s.land / 0.012) + self.valley)
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("e_fields_and_woods", "eleventh", "hills highway")
@sizes(aloft_mps=(12.0, 19.0), rough_m=(0.5, 1.2), smooth_m=(0.003, 0.03), fetch_m=(60.0, 250.0))
@sizes(gusts=(1.6, 2.6))
class FieldsAndWoods(OnRoad):
    """`rough`: logarithm of the roughness length that the wind at the truck's height has come to; it follows
    the land over a fetch, into the woods sooner than out of them. The rougher the land, the weaker the wind
    and the gustier. aloft_mps: at 60 m; gusts: standard deviation over the friction velocity.
    Source: Garratt, The Internal Boundary Layer - A Review, Boundary-Layer Meteorology 50 (1990), on changes
    of roughness; gusts of 2.4 friction velocities (Panofsky and Dutton, Atmospheric Turbulence, 1984); woods,
    headings and the least wind in them are chosen here."""

    high_m, aloft_m = 3.0, 60.0

    def prepare(self) -> None:
        rng, p, batch = self.rng(1001), self.p, self.setting.batch
        self.land = np.full((self.rows(), CELLS), np.log(p.smooth_m))
        self.heading = np.empty((self.rows(), CELLS))
        for land, heading in zip(self.land, self.heading, strict=True):
            for first, last in stretches(rng, (250.0, 1500.0), (200.0, 900.0)):
                land[first:last] = np.log(p.rough_m)
            heading[:] = rng.uniform(-1.0, 1.0) + 0.35 * ou_series(rng, (1, CELLS), CELL_M, 900.0)[0]
        self.side = rng.choice([-1.0, 1.0])
        self.turbulence = ou_series(rng, (batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 4.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"rough": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        land, speed = self.read(self.land, view), np.maximum(view.speed, 0.0)
        s.rough = np.where(np.isnan(s.rough), land, s.rough)
        fetch = p.fetch_m * np.where(land > s.rough, 0.6, 1.4)
        s.rough = s.rough + dt * (speed + 3.0) * (land - s.rough) / fetch
        friction = 0.4 * p.aloft_mps / (np.log(self.aloft_m) - s.rough)
        mean = 2.5 * friction * np.maximum(np.log(self.high_m) - s.rough, 0.6)
        gust = p.gusts * friction * self.turbulence[:, index(view, self.turbulence, 0.1)]
        heading = self.read(self.heading, view)
        along = self.side * self.setting.direction * np.cos(heading) * (mean + gust)
        relative = np.clip(1.0 + along / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("x_valley_turns_the_wind", "thirteenth", "highway hills")
@sizes(aloft_mps=(12.0, 18.0), veers_s=(90.0, 260.0), veers=(0.6, 1.1), flows_s=(4.0, 14.0), bends=(0.3, 0.7))
@sizes(mean_m=(900.0, 2500.0))
class ValleyTurnsTheWind(OnRoad, flow=0.0):
    """`flow` of the air along a valley, over the wind aloft. It follows the axis towards the side that the
    wind aloft leans to, so that it turns right about when that wind veers a little across the axis. veers:
    rad, of the wind aloft; bends: rad, of the axis from one reach to the next.
    Source: Whiteman and Doran, The Relationship between Overlying Synoptic-Scale Flows and Winds within a
    Valley, J. Applied Meteorology 32 (1993): forced channelling; quicker winds, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1301), self.setting.batch
        number = sections(rng, self.rows(), self.p.mean_m)
        turns = self.p.bends * rng.standard_normal((self.rows(), int(number.max()) + 1))
        self.axis = np.take_along_axis(turns, number, axis=1)
        shape = (batch, int(self.setting.duration_s) + 5)
        self.aloft = 0.5 * np.pi + self.p.veers * ou_series(rng, shape, 1.0, self.p.veers_s)
        self.gusts = 1.0 + 0.15 * ou_series(rng, shape, 1.0, 3.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        k = index(view, self.aloft)
        leans = np.cos(self.aloft[:, k] - self.read(self.axis, view))
        wants = np.sign(leans) * np.sqrt(np.abs(leans))
        s.flow = s.flow + dt * (wants - s.flow) / p.flows_s
        wind = self.setting.direction * p.aloft_mps * s.flow * self.gusts[:, k]
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("k_waves_behind_the_ridge", "fourteenth", "highway hills")
@sizes(mean_mps=(6.0, 10.0), swings=(0.9, 1.5), long_m=(1300.0, 3000.0), dies_m=(3000.0, 8000.0))
@sizes(breathes_s=(60.0, 180.0))
class WavesBehindTheRidge(OnRoad):
    """Air that has crossed a ridge swings up and down behind it, and stands in waves over the land: at the
    ground it blows by turns hard, hardly, and back towards the ridge. Waves die away until the next ridge.
    mean_mps: of the wind along the road; swings: over half of that, in the first wave.
    Source: Scorer, Theory of Waves in the Lee of Mountains, Q. J. R. Met. Soc. 75 (1949), and Doyle and
    Durran, The Dynamics of Mountain-Wave-Induced Rotors, J. Atmospheric Sciences 59 (2002); shorter waves,
    sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1401), self.p
        metres = (np.arange(MAP_CELLS) + 0.5) * MAP_CELL_M
        self.road = np.zeros((self.rows(), MAP_CELLS))
        self.looks = rng.choice([-1.0, 1.0], self.rows())
        for row in self.road:
            ridge, long = -rng.uniform(0.0, 6000.0), p.long_m * rng.uniform(0.85, 1.15)
            while ridge < metres[-1]:
                behind = np.maximum(metres - ridge, 0.0)
                row += np.exp(-behind / p.dies_m) * np.sin(2.0 * np.pi * behind / long) * (behind > 0.0)
                ridge += rng.uniform(5000.0, 12000.0)
        self.road = np.where(self.looks[:, None] > 0.0, self.road, self.road[:, ::-1])
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.breath = 1.0 + 0.25 * ou_series(rng, shape, 1.0, p.breathes_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        blows = 0.5 + p.swings * np.clip(self.between(self.road, view), -1.5, 1.5)
        breath = np.clip(self.breath[:, index(view, self.breath)], 0.3, 1.7)
        wind = p.mean_mps * blows * breath * self.looks[self.setting.route] * self.setting.direction
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("v_street_of_eddies", "sixteenth", "highway hills")
@sizes(
    mean_mps=(3.0, 5.5),
    swings_mps=(5.0, 8.5),
    long_m=(250.0, 700.0),
    drifts=(0.75, 0.9),
    fades_s=(60.0, 200.0),
)
class StreetOfEddies(Hidden):
    """A lone hill sheds eddies by turns to either side, and they drift over the land along the road. Who
    drives against them meets many in a minute, who drives along with them few. mean_mps: of the wind along
    the road; swings_mps: by eddies; long_m: from one to the next of a side; drifts: of the wind at height,
    which is twice that at the ground.
    Source: Chopra and Hubert, Mesoscale Eddies in Wake of Islands, J. Atmospheric Sciences 22 (1965), on
    streets behind heights; a small hill, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1601)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.strong = 1.0 + 0.3 * ou_series(rng, shape, 1.0, self.p.fades_s)
        self.first = rng.uniform(0.0, 2.0 * np.pi, self.setting.batch)
        self.blows = rng.choice([-1.0, 1.0])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        strong = np.clip(self.strong[:, index(view, self.strong)], 0.2, 1.8)
        drift = self.blows * p.drifts * 2.0 * p.mean_mps * view.time
        phase = self.first + 2.0 * np.pi * (self.place(view) - drift) / p.long_m
        along = self.blows * p.mean_mps + p.swings_mps * strong * np.tanh(1.6 * np.sin(phase)) / np.tanh(1.6)
        against = np.clip(1.0 - self.setting.direction * along / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("z_whirls_of_hot_air", "seventeenth", "highway hills")
@sizes(
    mean_mps=(3.0, 5.0),
    spins_mps=(12.0, 18.0),
    core_m=(60.0, 140.0),
    aside_m=(40.0, 160.0),
    lives_s=(60.0, 200.0),
)
class WhirlsOfHotAir(OnRoad):
    """Whirls of hot air stand beside the road, each for some minutes. One blows along the road as long as a
    truck is near, one way or the other by its side and its sense of turning. mean_mps: of the wind besides;
    spins_mps: at the edge of a core; aside_m: of their middle from the road, usually.
    Source: Sinclair, The Lower Structure of Dust Devils, J. Atmospheric Sciences 30 (1973), and Burgers, A
    Mathematical Model Illustrating the Theory of Turbulence (1948), on whirls with a core; large ones, sizes
    are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1701), self.p
        at = rng.uniform(0.0, 60000.0, (self.rows(), WHIRLS))
        aside = rng.choice([-1.0, 1.0], at.shape) * p.aside_m * rng.uniform(0.4, 1.6, at.shape)
        turns, phase = rng.uniform(0.5, 1.0, at.shape), rng.uniform(0.0, 1.0, at.shape)
        self.at, self.aside, self.turns, self.phase = (
            rows[self.setting.route] for rows in (at, aside, turns, phase)
        )
        self.blows = rng.choice([-1.0, 1.0]) * p.mean_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        radius = np.sqrt((self.place(view)[:, None] - self.at) ** 2 + self.aside**2)
        round_ = p.spins_mps * 1.4 * p.core_m / radius * (1.0 - np.exp(-((radius / p.core_m) ** 2)))
        lives = np.sin(np.pi * (view.time / (3.0 * p.lives_s) + self.phase)) ** 2
        along = (round_ * self.turns * lives * self.aside / radius).sum(axis=1) + self.blows
        against = np.clip(1.0 - self.setting.direction * along / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("y_wakes_of_wind_mills", "eighteenth", "highway hills")
@sizes(
    wind_mps=(6.5, 10.0), takes=(0.6, 0.85), widens=(0.05, 0.09), far_m=(120.0, 420.0), turns_s=(30.0, 90.0)
)
@sizes(swings=(0.3, 0.6))
class WakesOfWindMills(OnRoad):
    """A steady wind blows along the road, and farms of mills beside the road take some of it. Each mill's
    wake lies where the wind carries it. As the wind swings, all wakes move along the road. takes: of the
    wind, right behind a mill; widens: of a wake, by the way; far_m: of the mills from the road; swings: rad
    of the wind.
    Source: Jensen, A Note on Wind Generator Interaction, Risø-M-2411 (1983), on wakes that widen evenly;
    mills and the swinging wind are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1801), self.p
        farms = np.repeat(rng.uniform(0.0, 60000.0, (self.rows(), FARMS)), MILLS, axis=1)
        at = farms + 300.0 * rng.standard_normal(farms.shape)
        far = rng.choice([-1.0, 1.0], at.shape) * p.far_m * rng.uniform(0.5, 1.8, at.shape)
        self.at, self.far = at[self.setting.route], far[self.setting.route]
        seconds = int(self.setting.duration_s) + 3
        self.angle = p.swings * ou_series(rng, (self.setting.batch, seconds), 1.0, p.turns_s)
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        second = index(view, self.angle)
        last = min(second + 1, self.angle.shape[1] - 1)
        share = view.time - np.floor(view.time)
        angle = (1.0 - share) * self.angle[:, second] + share * self.angle[:, last]
        wide = 45.0 + p.widens * np.abs(self.far)
        away = self.place(view)[:, None] - self.at - np.sin(angle)[:, None] * self.far
        lulls = p.takes * (45.0 / wide) ** 2 * np.exp(-0.5 * (away / wide) ** 2)
        wind = self.blows * np.cos(angle) * (1.0 - np.minimum(lulls.sum(axis=1), 0.9))
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
