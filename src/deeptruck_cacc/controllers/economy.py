"""Fuel-saving following on a known road, by dynamic programming over the next 2 km.

The stages are segments of road. The state is the truck's speed and its lag: how many seconds after its leader
it passes a position. A stage therefore has one grade, and no further state is needed for a leader of constant
speed. An EnergyMap gives the effect of the pedals. docs/cacc.md has the equations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.controllers.energy_map import PEDALS, EnergyMap, at
from deeptruck_cacc.controllers.law import Seen
from deeptruck_cacc.controllers.policy import TYPICAL, Observation
from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M
from deeptruck_cacc.controllers.signed_pedal import SignedPedal
from deeptruck_core.arrays import Array
from deeptruck_core.imports.compiler import numba

compiled: Any = numba.njit(cache=True, fastmath={"reassoc", "contract", "arcp", "nsz"}, error_model="numpy")

# Columns of a situation: m/s, m/s, s, s, s, s, cm^3/s, m/s^2, cm^3 for a m/s, 1 behind a leader and 0 without
SPEED, LEADER, LAG, LOW, HIGH, WANTED, PRICE, LACK, MOMENTUM, LED, COLUMNS = range(11)

# What has no source was chosen on validation roads (seed 50), none on those of the page.
BAND_S = (1.2, 3.0)  # time gaps between which the truck may coast and close in, s
CRUISE = 2.0  # m/s to either side of the set speed, the band where there is no leader
CRUISE_S = 3.0  # s, for which it may be early or late against the set speed; what is lost beyond stays lost
STAGE_M = 2 * AHEAD_M
REACH, SPEED_STEPS = 4.0, 25  # the grid of speeds: so far (m/s) to either side of the leader's
LAG_MARGIN_S, LAG_STEPS = 0.4, 17  # the grid of lags: the band and so much to either side
REPLAN_S = 1.0  # for so long a value function is used; the pedal is chosen anew at every step
FINE = np.interp(np.linspace(0, 1, 97), np.linspace(0, 1, len(PEDALS)), PEDALS)  # tried at every step
# Costs, in cm^3/s, of an acceleration (m/s^2) squared, of a second or m/s outside of the band squared and of
# a second off the wanted time gap squared.
ACCELERATION, OUTSIDE, HOME = 5.0, 100.0, 0.1
CHANGE = 4.0  # cm^3, of a pedal changed by its whole reach from one step to the next, squared
LACK_S, RATE_S = 4.0, 0.5  # time constants: of the acceleration beyond the map, and of measuring one
LASTING_M = 150.0  # way over which the profile's error at the truck is expected to die away
LEADER_S = 3.0  # s, over which the leader's speed is taken for the plan: the followers know it at once
SLOW = (6.0, 10.0)  # m/s; below the wanted gap is held, above the whole band is used
RATE, FOLLOW_S = 1.0, 1.0  # of the followers at both ends of the band: m/s^2 and s
COMFORT = (-3.5, 1.0)  # m/s^2; the shield, not the follower, brakes harder


class Economy(SignedPedal):
    """Plans one signed pedal (1 full engine, -1 full brake) within a range of time gaps.

    The observation's `grade_ahead` (batch, n) is the known road, every AHEAD_M metres from the truck; beyond
    it, and where it is absent or NaN, the road is assumed flat. `least_gap` (batch,), m, bounds the gap from
    below. If `set_speed` (batch,), m/s, is given and the gap is NaN, there is no leader: the truck cruises
    within a range of speeds. Raises InputError for a simulator without fuel.
    """

    _past: _Past | None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.map = EnergyMap.measure(self.simulator)

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,); NaN if a required
        observation is NaN."""
        alone = np.isnan(observation["gap"]) & np.isfinite(observation.get("set_speed", np.nan))
        if np.any(alone):  # as behind a leader of the set speed
            late = 0.0 if self._past is None else self._past.late
            set_speed = np.asarray(observation["set_speed"])
            gap = set_speed * (observation["target_time_gap"] + late)
            seen = {"leader_speed": set_speed, "gap": gap}
            seen = {name: np.where(alone, x, observation[name]) for name, x in seen.items()}
            observation = {**observation, **seen}
        return super().act({**observation, "led": ~np.atleast_1d(alone)})

    def _pedal(self, observation: Observation, seen: Seen, grade: Array, known: NDArray[np.bool_]) -> Array:
        ahead = self._ahead(observation, grade)
        pull, fuel = self.map.rows(np.nan_to_num(seen.speed, nan=TYPICAL["speed"]), ahead[:, 0])
        past = self._felt(seen, pull)
        now = self._situation(seen, observation, past)
        if past.age_s >= REPLAN_S - 1e-9:
            values = _values(self.map.acceleration, self.map.fuel, ahead[:, :: round(STAGE_M / AHEAD_M)], now)
            past = past._replace(values=values, age_s=0.0, way=np.zeros(len(grade)))
        pull = pull + past.lack[:, None]
        wished = _best(_fine(pull), _fine(fuel), past.way, past.pedal, past.values, now)
        least, most = (_inverse(_follow(seen, now, edge), pull) for edge in (HIGH, LOW))
        pedal = np.clip(np.minimum(np.maximum(wished, least), most), self._least, 1.0)
        pedal = np.where(known, pedal, 0.0)
        way = past.way + np.nan_to_num(seen.speed) * self.dt
        late = past.late + self.dt * (1.0 - np.nan_to_num(seen.speed) / now[:, LEADER])
        late = np.where(observation["led"], 0.0, np.clip(late, -CRUISE_S, CRUISE_S))
        self._past = past._replace(pedal=pedal, way=way, age_s=past.age_s + self.dt, late=late)
        return pedal

    def _ahead(self, observation: Observation, grade: Array) -> Array:
        """Grades (batch, n), beginning at the truck: the profile and, if the truck measures its grade, the
        profile's error at the truck, which decays with distance."""
        profile = observation.get("grade_ahead")
        if profile is None:
            profile = np.full((len(grade), AHEAD), np.nan)
        profile = np.nan_to_num(np.atleast_2d(np.asarray(profile, float)))
        if not self.interface.grade:
            return profile
        lasting = np.exp(-AHEAD_M / LASTING_M * np.arange(profile.shape[1]))
        return np.asarray(profile + (grade - profile[:, 0])[:, None] * lasting)

    def _felt(self, seen: Seen, pull: Array) -> _Past:
        """The past updated by the present observation: the leader's slow speed, and the difference of the
        acceleration from the map's, which is `pull` (batch, pedals)."""
        past, speed = self._past, seen.speed
        leader = np.nan_to_num(seen.leader_speed, nan=TYPICAL["leader_speed"])
        if past is None or len(past.pedal) != len(speed):
            nothing = np.zeros(len(speed))
            values = np.zeros((0, 0, 0, 0))
            return _Past(nothing, speed, leader, nothing, nothing, nothing, nothing, np.inf, values)
        beyond = (speed - past.speed) / self.dt - _at(past.pedal, pull)
        beyond = np.where(np.isfinite(beyond), beyond, past.lack)
        slow = past.beyond + self.dt / RATE_S * (beyond - past.beyond)
        lack = np.clip(past.lack + self.dt / LACK_S * (slow - past.lack), -0.5, 0.5)
        leader = past.leader + self.dt / LEADER_S * (leader - past.leader)
        return past._replace(speed=speed, leader=leader, beyond=slow, lack=lack)

    def _situation(self, seen: Seen, observation: Observation, past: _Past) -> Array:
        """The quantities that both parts of the programme need, (batch, COLUMNS)."""
        leader, speed = past.leader, np.nan_to_num(seen.speed, nan=TYPICAL["speed"])
        wanted = np.clip(np.nan_to_num(seen.time_gap, nan=TYPICAL["target_time_gap"]), 0.5, 10.0)
        share = np.clip((np.minimum(leader, speed) - SLOW[0]) / (SLOW[1] - SLOW[0]), 0.0, 1.0)
        low = wanted + share * np.minimum(BAND_S[0] - wanted, 0.0)
        low = np.maximum(low, np.asarray(observation.get("least_gap", 0.0)) / np.maximum(leader, 1.0))
        high = np.maximum(wanted + share * np.maximum(BAND_S[1] - wanted, 0.0), low)
        led = np.asarray(observation["led"])
        low, high = np.where(led, low, wanted - CRUISE_S), np.where(led, high, wanted + CRUISE_S)
        cruise = np.maximum(leader, SLOW[0])
        now = np.empty((len(leader), COLUMNS))
        now[:, SPEED], now[:, LEADER] = speed, cruise
        now[:, LAG] = np.nan_to_num(seen.gap, nan=TYPICAL["gap"]) / cruise
        now[:, LOW], now[:, HIGH] = low, high
        now[:, WANTED] = np.clip(wanted, low, high)
        now[:, PRICE], now[:, MOMENTUM], now[:, LACK] = *self.map.prices(cruise), past.lack
        now[:, LED] = led
        return now


class _Past(NamedTuple):
    """State kept between calls, each (batch,): the pedal given and the speed then, the leader's slow speed,
    the difference of acceleration from the map as measured (`beyond`) and its slow part (`lack`), and the
    distance driven since the value function `values` was computed `age_s` ago. `late`: without a leader, the
    delay in s behind a leader of the set speed."""

    pedal: Array
    speed: Array
    leader: Array
    beyond: Array
    lack: Array
    way: Array
    late: Array
    age_s: float
    values: Array


def _fine(table: Array) -> Array:
    """Interpolate values (batch, pedals) from PEDALS to FINE."""
    return np.stack([np.interp(FINE, PEDALS, row) for row in table])


def _at(pedal: Array, table: Array) -> Array:
    """Interpolate values (batch, pedals) from PEDALS to pedals (batch,)."""
    return np.array([np.interp(x, PEDALS, row) for x, row in zip(pedal, table, strict=True)])


def _inverse(acceleration: Array, pull: Array) -> Array:
    """Pedals (batch,) for accelerations (batch,), given the acceleration pull (batch, pedals) of PEDALS."""
    return np.array([np.interp(x, row, PEDALS) for x, row in zip(acceleration, pull, strict=True)])


def _follow(seen: Seen, now: Array, edge: int) -> Array:
    """Acceleration (batch,) of the ideal follower at one end of the time-gap range: LOW is the fast one, HIGH
    the slow one."""
    time_gap = now[:, edge]
    above, slope = approach(seen.gap - time_gap * seen.leader_speed, time_gap, RATE)
    behind = seen.leader_speed - seen.speed
    wanted = seen.leader_acceleration + slope * behind + (behind + above) / FOLLOW_S
    edge_speed = now[:, LEADER] + (CRUISE if edge == LOW else -CRUISE)
    wanted = np.where(now[:, LED] > 0, wanted, (edge_speed - seen.speed) / FOLLOW_S)
    return np.clip(np.nan_to_num(wanted), *COMFORT)


@compiled
def _stage(
    now: Array, speed: float, lag: float, pull: float, fuel: float, way: float
) -> tuple[float, float, float]:
    """Speed and lag after `way` metres at an acceleration, and their cost, cm^3."""
    later = np.sqrt(max(speed * speed + 2.0 * pull * way, 1.0))
    seconds = 2.0 * way / (speed + later)
    lag += seconds - way / now[LEADER]
    time_gap = lag * now[LEADER] / later
    out = max(now[LOW] - time_gap, 0.0) + max(time_gap - now[HIGH], 0.0)
    off = time_gap - now[WANTED]
    if now[LED] == 0.0:
        out += max(abs(later - now[LEADER]) - CRUISE, 0.0)
    rate = fuel + now[PRICE] + ACCELERATION * pull * pull + OUTSIDE * out * out + HOME * off * off
    return later, lag, rate * seconds


@compiled
def _between(values: Array, now: Array, speed: float, lag: float) -> float:
    """The value (speeds, lags) at a speed and a lag, by bilinear interpolation and extrapolation."""
    i, j, a, b = 0, 0, 0.0, 0.0
    a = (speed - now[LEADER] + REACH) / (2.0 * REACH) * (SPEED_STEPS - 1)
    b = (lag - now[LOW] + LAG_MARGIN_S) / (now[HIGH] - now[LOW] + 2.0 * LAG_MARGIN_S) * (LAG_STEPS - 1)
    a, b = min(max(a, 0.0), SPEED_STEPS - 1.0), min(max(b, 0.0), LAG_STEPS - 1.0)
    i, j = min(int(a), SPEED_STEPS - 2), min(int(b), LAG_STEPS - 2)
    a, b = a - i, b - j
    near = (1.0 - b) * values[i, j] + b * values[i, j + 1]
    return (1.0 - a) * near + a * ((1.0 - b) * values[i + 1, j] + b * values[i + 1, j + 1])


@compiled
def _values(pulls: Array, fuels: Array, grades: Array, situations: Array) -> Array:
    """Cost to go, cm^3, (batch, stages + 1, speeds, lags), from an energy map (grade, speed, pedal), the
    grades of the stages (batch, stages) and situations."""
    batch, stages = grades.shape
    values = np.empty((batch, stages + 1, SPEED_STEPS, LAG_STEPS))
    for row in range(batch):
        now = situations[row]
        for i in range(SPEED_STEPS):
            speed = now[LEADER] + REACH * (2.0 * i / (SPEED_STEPS - 1) - 1.0)
            values[row, stages, i] = now[MOMENTUM] * (now[LEADER] - speed)
        for k in range(stages - 1, -1, -1):
            after = values[row, k + 1]
            for i in range(SPEED_STEPS):
                speed = max(now[LEADER] + REACH * (2.0 * i / (SPEED_STEPS - 1) - 1.0), 1.0)
                best = np.full(LAG_STEPS, np.inf)
                for m in range(len(PEDALS)):
                    pull = at(pulls, grades[row, k], speed, m) + now[LACK]
                    fuel = at(fuels, grades[row, k], speed, m)
                    for j in range(LAG_STEPS):
                        lag = (now[HIGH] - now[LOW] + 2.0 * LAG_MARGIN_S) * j / (LAG_STEPS - 1)
                        lag += now[LOW] - LAG_MARGIN_S
                        later, lag, cost = _stage(now, speed, lag, pull, fuel, STAGE_M)
                        best[j] = min(best[j], cost + _between(after, now, later, lag))
                values[row, k, i] = best
    return values


@compiled
def _best(pulls: Array, fuels: Array, way: Array, pedal: Array, values: Array, situations: Array) -> Array:
    """The best pedal of FINE for each truck (batch,), from their effects (batch, FINE)."""
    best = np.zeros(len(way))
    for row in range(len(way)):
        now, least = situations[row], np.inf
        k = min(int(way[row] / STAGE_M + 0.5) + 1, values.shape[1] - 1)  # half a stage ahead, or more
        left = max(k * STAGE_M - way[row], 1.0)
        for m in range(len(FINE)):
            later, lag, cost = _stage(now, now[SPEED], now[LAG], pulls[row, m], fuels[row, m], left)
            cost += _between(values[row, k], now, later, lag) + CHANGE * (FINE[m] - pedal[row]) ** 2
            if cost < least:
                least, best[row] = cost, FINE[m]
    return best
