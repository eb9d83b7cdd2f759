from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc import CaccEnv, baseline, load_policy
from deeptruck_cacc.controllers import economy
from deeptruck_cacc.controllers.baselines import Baseline
from deeptruck_cacc.controllers.economy import BAND_S, CRUISE, STAGE_M, Economy
from deeptruck_cacc.controllers.energy_map import GRADES, PEDALS, SPEEDS, EnergyMap
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M, Road
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.safety.guard import guard
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators, trucks

LEADER = 20.0  # m/s


@pytest.fixture(scope="module")
def truck():
    return trucks.load("trucksim")


@pytest.fixture(scope="module")
def thrifty(truck):
    return Economy(truck)


def hills(batch: int, limit: float = 0.03) -> Road:
    """Sine hills of 1.2 km, between 500 m of flat road at either end, of 4 km."""
    x, phase = np.arange(0.0, 6000.0, 25.0), np.linspace(0.0, 5.0, batch)[:, None]
    fade = np.clip(np.minimum(x - 500.0, 3500.0 - x) / 200.0, 0.0, 1.0)
    return Road(limit * fade * np.sin(2 * np.pi * x / 1200.0 + phase))


def behind_a_leader(road: Road, known: Road | None, seconds: float = 200.0, **other: object) -> Scene:
    batch, steps = len(road.grade), round(10 * seconds)
    ones, still = np.ones(batch), np.zeros((batch, steps))
    values: dict[str, object] = {"leader_acceleration": still, "grade": still, "road": road} | other
    return Scene(LEADER * ones, LEADER * ones, 2 * LEADER * ones, 2 * ones, known_road=known, **values)


def fuel_at_equal_time(trace, thrifty: Economy) -> np.ndarray:
    """Fuel (batch,), cm^3, with what time and speed at the end are worth."""
    time, momentum = thrifty.map.prices(np.array([LEADER]))
    late = (LEADER * trace.time[-1] - trace.dt * trace["speed"].sum(axis=0)) / LEADER
    return trace.dt * trace["fuel"].sum(axis=0) + time * late + momentum * (LEADER - trace["speed"][-1])


def test_the_map_is_what_the_truck_does_at_a_steady_speed(toy):
    """a = engine / 1000 - 0.06 brake - 0.05 - 9.81 grade, fuel = engine / 100."""
    found = EnergyMap.measure(toy)
    engine = ActionScale.of(toy).engine_high * np.maximum(PEDALS, 0.0)
    brake = 100.0 * np.maximum(-PEDALS, 0.0)
    flat = engine / 1000 - 0.06 * brake - 0.05
    expected = flat - 9.81 * GRADES[:, None, None] + 0.0 * SPEEDS[:, None]
    moving = SPEEDS[:, None] + 0.1 * expected > 0.5  # what stops it in a step is no steady speed
    np.testing.assert_allclose(found.acceleration[moving], expected[moving], atol=1e-3)
    np.testing.assert_allclose(found.fuel, np.broadcast_to(engine / 100, found.fuel.shape), atol=1e-9)


def test_a_truck_without_a_grade_sensor_is_measured_on_the_flat():
    found = EnergyMap.measure(trucks.load("freightliner"))
    slope = found.acceleration[:, 15, 8] - found.acceleration[4, 15, 8]
    np.testing.assert_allclose(slope, -9.81 * GRADES, atol=1e-6)


def test_fuel_never_falls_and_is_convex_in_acceleration(thrifty):
    """So that no programme jumps to and fro between two gears."""
    rate = np.diff(thrifty.map.fuel, axis=2) / np.diff(thrifty.map.acceleration, axis=2)
    assert rate.min() >= -1e-9
    assert (np.diff(rate, axis=2) > -1e-6 * rate.max()).all()


def test_fuel_that_a_learned_truck_burns_while_it_brakes_makes_coasting_no_dearer(make_toy):
    class Learned(make_toy):
        def step(self, state, u, w):
            state, y = super().step(state, u, w)
            y[:, 2] += 0.03 * u[:, 1]
            return state, y

    np.testing.assert_allclose(
        EnergyMap.measure(Learned()).fuel, EnergyMap.measure(make_toy()).fuel, atol=1e-9
    )


def test_a_simulator_without_fuel_is_refused(make_toy):
    with pytest.raises(InputError, match=r"has no fuel.*leave out \?economy"):
        Economy(make_toy(interface=TruckInterface("toy", fuel=False)))


def test_who_cruises_at_a_speed_pays_the_price_of_time_that_makes_it_the_best(thrifty):
    """Over a kilometre on the flat, fuel and time at other speeds cost more."""
    price = float(thrifty.map.prices(np.array([LEADER]))[0][0])

    def cost(speed: float) -> float:
        acceleration, fuel = thrifty.map.rows(np.array([speed]), np.zeros(1))
        return (float(np.interp(0.0, acceleration[0], fuel[0])) + price) * 1000.0 / speed

    assert cost(LEADER) < min(cost(LEADER - 4.0), cost(LEADER + 4.0))


def test_two_stages_are_as_good_as_the_best_of_all_pairs_of_pedals(thrifty):
    """Against trying every pair on the grid of stages, from where the programme has a node."""
    now = np.zeros((1, economy.COLUMNS))
    now[0, [economy.SPEED, economy.LEADER, economy.LAG, economy.LOW, economy.HIGH]] = 20, 20, 2.1, 1.2, 3.0
    now[0, [economy.WANTED, economy.PRICE, economy.MOMENTUM, economy.LED]] = 2.0, 5.0, 25.0, 1.0
    grades = np.array([[0.02, -0.03]])
    values = economy._values(thrifty.map.acceleration, thrifty.map.fuel, grades, now)

    def stages(speed: float, lag: float, grade: float):
        """By each pedal: speed and lag at the end, and what it costs."""
        acceleration, fuel = thrifty.map.rows(np.array([speed]), np.array([grade]))
        return [
            economy._stage(now[0], speed, lag, a, f, STAGE_M)
            for a, f in zip(acceleration[0], fuel[0], strict=True)
        ]

    best = min(
        first + second + 25.0 * (20.0 - end)
        for speed, lag, first in stages(20.0, 2.1, 0.02)
        for end, _, second in stages(speed, lag, -0.03)
    )
    assert values[0, 0, economy.SPEED_STEPS // 2, economy.LAG_STEPS // 2] == pytest.approx(best, rel=0.01)


def test_on_the_flat_it_holds_the_gap_and_spends_what_a_constant_speed_does(truck, thrifty):
    flat = Road(np.zeros((1, 2)))
    trace = roll_out(truck, thrifty, behind_a_leader(flat, flat, 100.0))
    acc = roll_out(truck, baseline("acc", truck.interface, PedalMap.calibrate(truck)), trace.scene)
    saved = 1 - fuel_at_equal_time(trace, thrifty) / fuel_at_equal_time(acc, thrifty)
    assert abs(saved[0]) < 0.002
    assert np.abs(trace["time_gap_error"]).max() < 0.2
    assert trace["speed"].std() < 0.02


def test_over_hills_that_it_knows_it_saves_fuel_within_its_band(truck, thrifty):
    road = hills(2)
    trace = roll_out(truck, thrifty, behind_a_leader(road, road))
    acc = roll_out(truck, baseline("acc", truck.interface, PedalMap.calibrate(truck)), trace.scene)
    saved = 1 - fuel_at_equal_time(trace, thrifty) / fuel_at_equal_time(acc, thrifty)
    assert saved.min() > 0.02
    time_gap = trace["gap"] / trace["speed"]
    assert BAND_S[0] - 0.1 < time_gap.min() and time_gap.max() < BAND_S[1] + 0.1
    assert (trace["brake_command"] > 0).mean() < 0.5 * (acc["brake_command"] > 0).mean()


class Alone:
    """A policy that sees no leader until `seen_from` steps."""

    def __init__(self, policy, seen_from: int = 100_000) -> None:
        self.policy, self.interface, self.dt, self.seen_from = policy, policy.interface, policy.dt, seen_from

    def reset(self) -> None:
        self.policy.reset()
        self.steps = 0

    def act(self, seen):
        self.steps += 1
        nothing = np.full(len(seen["gap"]), np.nan)
        hidden = {"gap": nothing, "leader_speed": nothing} if self.steps <= self.seen_from else {}
        return self.policy.act({**seen, **hidden, "set_speed": np.full(len(nothing), LEADER)})


def test_without_a_leader_it_saves_fuel_within_its_band_of_speeds(truck, thrifty):
    road = hills(2)
    trace = roll_out(truck, Alone(thrifty), behind_a_leader(road, road))
    constant = Baseline(lambda seen: 0.5 * (LEADER - seen.speed), PedalMap.calibrate(truck), truck.interface)
    steady = roll_out(truck, constant, trace.scene)
    saved = 1 - fuel_at_equal_time(trace, thrifty) / fuel_at_equal_time(steady, thrifty)
    assert saved.min() > 0.01
    assert 0.5 < np.abs(trace["speed"] - LEADER).max() < CRUISE + 0.2
    assert trace["speed"].mean(axis=0) == pytest.approx(np.full(2, LEADER), rel=0.005)


def test_without_a_leader_it_holds_the_set_speed_on_the_flat(truck, thrifty):
    flat = Road(np.zeros((1, 2)))
    trace = roll_out(truck, Alone(thrifty), behind_a_leader(flat, flat, 100.0))
    assert np.abs(trace["speed"] - LEADER).max() < 0.3


def test_it_follows_a_leader_that_it_meets(truck, thrifty):
    """20 m/s to begin with; the radar sees one of 15 m/s, 60 m ahead, after 10 s."""
    flat, pull, jump = Road(np.zeros((1, 2))), np.zeros((1, 600)), np.zeros((1, 600))
    pull[:, 90:100], jump[:, 100] = -5.0, 24.0
    scene = behind_a_leader(flat, flat, 60.0, leader_acceleration=pull, gap_jump=jump)
    trace = roll_out(truck, Alone(thrifty, 100), scene)
    assert trace["gap"].min() > BAND_S[0] * 15.0 - 2.0
    assert abs(trace["speed"][-1, 0] - 15.0) < 0.5


def test_it_does_not_come_closer_than_the_least_gap(truck, thrifty):
    road = hills(2)

    class Wary:
        interface, dt, reset = thrifty.interface, thrifty.dt, staticmethod(thrifty.reset)

        def act(self, seen):
            return thrifty.act({**seen, "least_gap": np.full(2, 36.0)})

    assert roll_out(truck, Wary(), behind_a_leader(road, road, 120.0))["gap"].min() > 35.0


def test_a_radars_noise_hardly_moves_the_pedals(truck, thrifty):
    """That of the leader node, 0.1 m and 0.05 m/s at 10 Hz."""
    road, rng = hills(1), np.random.default_rng(0)
    noise = {
        "seen_gap_offset": 0.1 * rng.normal(size=(1, 1000)),
        "seen_speed_offset": 0.05 * rng.normal(size=(1, 1000)),
    }
    quiet, busy = (roll_out(truck, thrifty, behind_a_leader(road, road, 100.0, **x)) for x in ({}, noise))
    jerk = [np.sqrt(np.square(trace["jerk"]).mean()) for trace in (quiet, busy)]
    assert jerk[1] < 1.2 * jerk[0] < 0.15


def test_it_follows_a_leader_that_slows_down_and_one_that_goes_on(truck, thrifty):
    """By 8 m/s within 10 s, 40 s at that, and back."""
    pull = np.zeros((1, 1500))
    pull[:, 100:200], pull[:, 600:800] = -0.8, 0.4
    flat = Road(np.zeros((1, 2)))
    trace = roll_out(truck, thrifty, behind_a_leader(flat, flat, 150.0, leader_acceleration=pull))
    assert trace["gap"].min() > BAND_S[0] * 12.0 - 2.0
    assert abs(trace["speed"][-1, 0] - LEADER) < 0.5
    assert BAND_S[0] - 0.1 < (trace["gap"] / trace["speed"])[-1, 0] < BAND_S[1] + 0.1


def test_it_stops_behind_a_leader_and_goes_on_when_that_does(truck, thrifty):
    pull = np.zeros((1, 1200))
    pull[:, 100:200], pull[:, 600:800] = -2.0, 0.5
    flat = Road(np.zeros((1, 2)))
    driver = guard(thrifty)
    trace = roll_out(truck, driver, behind_a_leader(flat, flat, 120.0, leader_acceleration=pull))
    assert trace["gap"].min() > 2.0 and trace["speed"][590, 0] < 0.3
    assert trace["speed"][-1, 0] > 9.0


def test_trucks_of_a_batch_drive_as_they_would_alone(truck, thrifty):
    road = hills(3)
    scene = behind_a_leader(road, road, 30.0)
    together = roll_out(truck, thrifty, scene)["speed"]
    for k in range(3):
        one = Road(road.grade[k : k + 1])
        alone = roll_out(truck, thrifty, behind_a_leader(one, one, 30.0))["speed"]
        np.testing.assert_allclose(alone[:, 0], together[:, k], atol=1e-9)


def test_an_unknown_road_is_flat_beyond_the_grade_that_is_felt(truck, thrifty):
    felt, blind = (
        {"grade": np.array([0.02])},
        {"grade": np.array([0.02]), "grade_ahead": np.full((1, 9), np.nan)},
    )
    alone, given = (thrifty._ahead(x, np.array([0.02])) for x in (felt, blind))
    assert alone.shape == (1, AHEAD) and alone[0, 0] == 0.02 and alone[0, -1] < 1e-6
    np.testing.assert_array_equal(given[0], alone[0, :9])


def test_a_nan_gives_a_nan_command_to_that_truck_alone(truck, thrifty):
    thrifty.reset()
    names = ("leader_speed", "speed", "gap", "target_time_gap", "grade")
    seen = {name: np.full(4, value) for name, value in zip(names, (20.0, 20.0, 40.0, 2.0, 0.0), strict=True)}
    for k, name in enumerate(names[:3]):
        seen[name][k] = np.nan
    for _ in range(3):
        commands = np.array(thrifty.act(seen))
        assert np.isnan(commands[:, :3]).all() and np.isfinite(commands[:, 3]).all()
    clear = {name: np.full(4, values[3]) for name, values in seen.items()}
    assert np.isfinite(np.array(thrifty.act(clear))).all()


def test_it_is_loaded_by_name_and_has_run_before(truck, make_toy, monkeypatch):
    made = load_policy("planner:truck:trucksim?economy", truck.interface)
    assert isinstance(made, Economy) and made._past is None
    with pytest.raises(InputError, match="commands engine_command in N m"):
        load_policy("planner:truck:trucksim?economy", TruckInterface("other", engine_unit="percent"))
    asked = []
    monkeypatch.setattr(simulators, "load", lambda path: asked.append(path) or make_toy())
    load_policy("planner:truck:trucksim?gear=recorded?economy")
    assert asked == ["truck:trucksim?gear=recorded"]


def test_behind_a_guard_it_knows_the_road_and_the_shields_gap(truck):
    asked = []

    class Spy(Economy):
        def act(self, observation):
            asked.append(observation)
            return super().act(observation)

    driver = guard(Spy(truck))
    road = hills(1)
    roll_out(truck, driver, behind_a_leader(road, road, 1.0))
    assert asked[-1]["grade_ahead"].shape == (1, AHEAD)
    assert asked[-1]["least_gap"][0] == pytest.approx(
        driver.shield.steady_gap(np.array([LEADER]))[0], rel=0.05
    )


def test_a_grade_is_straight_between_its_points_and_goes_on_at_the_ends():
    road = Road(np.array([[0.0, 0.02, -0.01], [0.01, 0.01, 0.01]]), spacing_m=100.0)
    positions = np.array([[-5.0, 50.0, 150.0, 900.0]] * 2)
    np.testing.assert_allclose(road.at(positions), [[0.0, 0.01, 0.005, -0.01], [0.01] * 4])


def test_what_lies_ahead_begins_where_the_truck_is():
    road = Road(np.linspace(0.0, 0.04, 201)[None])
    ahead = road.ahead(np.array([500.0]))
    assert ahead.shape == (1, AHEAD)
    np.testing.assert_allclose(ahead[0], np.minimum((500.0 + AHEAD_M * np.arange(AHEAD)) * 8e-6, 0.04))


@pytest.mark.parametrize("grade", [np.zeros(5), np.zeros((2, 1)), np.array([[0.0, np.nan]])])
def test_what_is_no_road_is_refused(grade):
    with pytest.raises(InputError, match="finite numbers"):
        Road(grade)
    with pytest.raises(InputError, match="above 0"):
        Road(np.zeros((1, 2)), spacing_m=0.0)


def test_in_the_environment_trucks_feel_the_grade_where_they_are(toy):
    """Two trucks of one scene, of which the second is pushed and soon stands elsewhere on the same hill."""
    hill = Road(np.tile(0.03 * np.sin(np.arange(100) / 5.0), (2, 1)))
    scene = scenes.paper(np.random.default_rng(0), 2, 100, toy.dt)
    env = CaccEnv(toy, 2, 100)
    seen = env.reset(replace(scene, road=hill, known_road=hill))
    position = np.zeros(2)
    state = toy.reset(np.column_stack([np.zeros(2), scene.speed]))
    commands = np.array([[300.0, 0.0], [2000.0, 0.0]])
    speed = scene.speed
    for _ in range(100):
        grade = hill.at(position[:, None])
        np.testing.assert_allclose(seen["grade"], grade[:, 0])
        np.testing.assert_allclose(seen["grade_ahead"][:, 0], grade[:, 0])
        np.testing.assert_allclose(seen["grade_ahead"][:, 4], hill.at(position[:, None] + 100.0)[:, 0])
        state, y = toy.step(state, commands, grade)
        position = position + speed * toy.dt
        speed = y[:, 1]
        seen, _, _ = env.step(commands)
        np.testing.assert_allclose(env.speed, speed)
    assert position[1] > position[0] + 25.0


def test_a_map_may_differ_from_the_road_or_be_missing(toy):
    hill, flat = Road(np.full((1, 50), 0.02)), Road(np.zeros((1, 50)))
    scene = scenes.paper(np.random.default_rng(0), 1, 10, toy.dt)
    seen = CaccEnv(toy).reset(replace(scene, road=hill, known_road=flat))
    assert seen["grade"] == 0.02 and not seen["grade_ahead"].any()
    assert "grade_ahead" not in CaccEnv(toy).reset(replace(scene, road=hill))
