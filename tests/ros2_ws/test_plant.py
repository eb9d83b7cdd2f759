"""The simulated truck between its steps."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from deeptruck_cacc.environments.hard_scenes import long_following
from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles
from deeptruck_nodes import leaders, roads
from deeptruck_nodes.plant import Plant
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from deeptruck_nodes.runs import RADARS
from deeptruck_nodes.truck_sim import ticks_a_step


@pytest.fixture(scope="module")
def truck() -> simulators.Simulator:
    return simulators.load("truck:trucksim")


def test_speed_between_two_steps_is_a_straight_line(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("flat"), 15.0)
    plant.step(1200.0, 0.0)
    assert plant.speed_at(0.5) == pytest.approx((15.0 + plant.speed) / 2, abs=1e-9)


def test_distance_and_road_follow_the_speed(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("constant:grade=0.01"), 20.0)
    for _ in range(50):
        plant.step(800.0, 0.0)
    assert plant.distance == pytest.approx(100, rel=0.1)
    assert plant.elevation == pytest.approx(0.01 * plant.distance)
    uphill = plant.speed
    flat = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(50):
        flat.step(800.0, 0.0)
    assert uphill < flat.speed - 0.3


def test_a_command_that_is_lost_fades_without_a_jerk_and_the_next_one_counts_at_once(
    truck: simulators.Simulator,
) -> None:
    plant, coasting = (Plant(truck, roads.parse("flat"), 20.0) for _ in range(2))
    for _ in range(30):
        plant.step(1800.0, 0.0)
        coasting.step(1800.0, 0.0)
    rates = [plant.acceleration]
    for k in range(1, 31):
        plant.step(math.nan, math.nan)
        coasting.step(max(1800.0 * (1.0 - 0.1 * k), 0.0), 0.0)
        rates.append(plant.acceleration)
    jerks = [(b - a) / plant.dt for a, b in pairwise(rates)]
    assert min(jerks) > -1.0
    assert plant.speed == pytest.approx(coasting.speed)
    plant.step(0.0, 50.0)
    coasting.step(0.0, 50.0)
    assert plant.acceleration == pytest.approx(coasting.acceleration)


def test_status_has_what_the_truck_shows(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(5):
        plant.step(800.0, 0.0)
    status = plant.status()
    assert all(math.isfinite(status[name]) for name in ("fuel_rate", "gear", "engine_speed", "engine_torque"))


def test_publishing_rate_must_fit_the_step() -> None:
    assert (ticks_a_step(10, 0.1), ticks_a_step(100, 0.1)) == (1, 10)
    for rate in (5, 15, 33):
        with pytest.raises(InputError, match="whole multiple"):
            ticks_a_step(rate, 0.1)


def test_braking_for_a_hazard_goes_on_without_a_command_to_a_standstill(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("constant:grade=-0.02"), 20.0)
    for _ in range(10):
        plant.step(0.0, 60.0, 40.0)
    for command in (math.nan, 10.0, 80.0, math.nan):  # a weaker one changes nothing, a stronger one counts
        plant.step(1000.0, command, 40.0)
        assert plant.stopping
    for _ in range(10):
        plant.step(math.nan, math.nan)
    assert plant.acceleration < -4.0
    for _ in range(100):
        plant.step(math.nan, math.nan)
    assert plant.speed == 0.0 and plant.stopping
    plant.step(1000.0, 0.0)  # standing, it obeys the next command
    assert not plant.stopping


@pytest.mark.parametrize(("hazard", "seconds"), [((math.nan, math.inf), 2.0), ((40.0, 1.0), 3.0)])
def test_braking_ends_with_its_command_or_with_the_hazard(
    truck: simulators.Simulator, hazard: tuple[float, float], seconds: float
) -> None:
    plant = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(10):
        plant.step(0.0, 60.0, *hazard)
    for _ in range(round((seconds - 1.1) * 10)):
        plant.step(math.nan, math.nan)
    assert plant.acceleration < -0.4
    for _ in range(15):
        plant.step(math.nan, math.nan)
    assert not plant.stopping
    assert plant.acceleration > -0.4


def test_a_truck_that_is_slow_when_its_hazard_ends_is_braked_to_a_standstill(
    truck: simulators.Simulator,
) -> None:
    """Its idling engine would drive it on."""
    plant = Plant(truck, roads.parse("flat"), 6.0)
    for _ in range(5):
        plant.step(0.0, 60.0, 40.0, 0.2)
    for _ in range(5):
        plant.step(math.nan, math.nan)
    assert 0.0 < plant.speed < 5.0 and plant.stopping
    for _ in range(40):
        plant.step(math.nan, math.nan)
    assert plant.speed == 0.0 and plant.stopping


# The gap that a leader opens, and what the radar makes of it


def readings(errors: RadarErrors, seed: int = 1, seconds: float = 100.0, dt: float = 0.1) -> np.ndarray:
    radar = Radar(errors, seed)
    return np.array([radar.sense(k * dt, 50.0, 20.0) for k in range(round(seconds / dt))])


def test_gap_is_the_integral_of_the_closing_speed() -> None:
    gap = Gap(leaders.parse("constant:speed=20"), 30.0, 2.0)
    for k in range(101):  # the truck brakes from 25 m/s at 1 m/s^2: exact for the trapezoidal rule
        gap.update(0.1 * k, 25 - 0.1 * k)
    assert gap.gap == pytest.approx(30 + (20 - 25) * 10 + 0.5 * 10**2)


def test_noise_has_the_stated_size_and_repeats_by_seed() -> None:
    errors = RadarErrors(range_noise=0.5, speed_noise=0.1)
    seen = readings(errors)
    assert seen.std(axis=0) == pytest.approx([0.5, 0.1], rel=0.1)
    assert np.array_equal(seen, readings(errors)) and not np.array_equal(seen, readings(errors, seed=2))


def test_dropouts_come_as_often_and_last_as_long_as_stated() -> None:
    seen = readings(RadarErrors(dropout_rate=0.1, dropout_s=0.5), seconds=5000)
    lost = np.isinf(seen[:, 0])
    assert np.array_equal(lost, np.isnan(seen[:, 1]))
    begins = np.count_nonzero(lost[1:] & ~lost[:-1])
    assert begins / 5000 == pytest.approx(0.1, rel=0.15)
    assert lost.mean() == pytest.approx(0.1 * 0.5, rel=0.25)


def test_the_lane_change_jumps_to_a_farther_vehicle_and_back() -> None:
    seen = readings(RadarErrors(lane_change_at_s=63.0))
    jumped = seen[:, 0] == 80.0
    assert np.flatnonzero(jumped)[[0, -1]] * 0.1 == pytest.approx([63.0, 64.9])
    assert np.all(seen[jumped, 1] == 21.5) and np.all(seen[~jumped] == [50.0, 20.0])


def test_the_leader_node_and_the_scene_change_lanes_alike() -> None:
    scene = long_following(np.random.default_rng(0), 1, 1200, 0.1)
    offsets = np.array([scene.seen_gap_offset[0], scene.seen_speed_offset[0]]).T
    clean = dict.fromkeys(("range_noise", "speed_noise", "dropout_rate"), 0.0)
    seen = readings(RadarErrors(**RADARS["field"] | clean), seconds=120.0)
    np.testing.assert_allclose(seen - [50.0, 20.0], offsets)


def test_beyond_its_reach_and_behind_a_collision_it_sees_nothing() -> None:
    radar = Radar(RadarErrors(reach=40.0), 0)
    assert radar.sense(0.0, 50.0, 20.0)[0] == math.inf
    assert radar.sense(0.1, -1.0, 20.0)[0] == math.inf
    assert radar.sense(0.2, 39.0, 20.0) == (39.0, 20.0)


# Leaders and roads: what the one-line descriptions mean, and what is refused


def speeds(text: str, times: list[float]) -> list[float]:
    leader = leaders.parse(text)
    return [leader.speed_at(t) for t in times]


@pytest.mark.parametrize(
    ("text", "times", "wanted"),
    [
        ("constant:speed=17.5", [0, 1e5], [17.5, 17.5]),
        ("sine:speed=18,amplitude=2,period=20", [0, 5, 10, 15], [18, 20, 18, 16]),
        ("steps:speeds=20/24/18,every=30,acceleration=2", [30, 31, 32, 59, 60, 62, 63, 200],
         [20, 22, 24, 24, 24, 20, 18, 18]),
        # a step has only until the next one begins; the last is approached until it is reached
        ("steps:speeds=0/30/40,every=10,acceleration=1", [10, 20, 30, 50, 60], [0, 10, 20, 40, 40]),
        ("stop:speed=20,at=30,deceleration=5,wait=10", [30, 31, 34, 44, 49, 134], [20, 15, 0, 0, 4, 20]),
    ],
)  # fmt: skip
def test_the_speed_of_each_kind(text: str, times: list[float], wanted: list[float]) -> None:
    assert speeds(text, times) == pytest.approx(wanted)


def test_random_leader_repeats_by_seed_and_stays_within_its_limits() -> None:
    times = np.arange(0, 600, 0.1).tolist()
    one = speeds("random:low=10,high=22,acceleration=1.5,seed=4", times)
    assert one == speeds("random:low=10,high=22,acceleration=1.5,seed=4", times)
    assert one != speeds("random:low=10,high=22,acceleration=1.5,seed=5", times)
    assert min(one) >= 10 and max(one) <= 22 and np.ptp(one) > 6
    assert np.abs(np.diff(one)).max() <= 1.5 * 0.1 + 1e-6


def test_recorded_leader_from_csv_starts_at_its_first_row(tmp_path: Path) -> None:
    (tmp_path / "lead.csv").write_text("time,speed,v2\n100,10,1\n102,14,2\n")
    assert speeds(f"recorded:path={tmp_path}/lead.csv", [0, 1, 2, 50]) == pytest.approx([10, 12, 14, 14])
    assert speeds(f"recorded:path={tmp_path}/lead.csv,column=v2", [0, 2]) == pytest.approx([1, 2])


def test_roads_rise_as_much_as_their_grade_says() -> None:
    for text in ("constant:grade=0.02", "sine:grade=0.03,length=1000", "random:grade=0.02,seed=3"):
        profile = roads.parse(text)
        distance = np.linspace(0, 3000, 3001)
        grade, elevation = np.array([profile.at(d) for d in distance]).T
        assert np.gradient(elevation, distance)[1:-1] == pytest.approx(grade[1:-1], abs=2e-4)
    assert roads.parse("flat").at(1e4) == (0.0, 0.0)


def test_road_from_a_table(tmp_path: Path) -> None:
    (tmp_path / "road.csv").write_text("distance,grade\n0,0\n100,0.02\n200,0.02\n")
    table = roads.parse(f"table:path={tmp_path}/road.csv")
    assert table.at(50) == pytest.approx((0.01, 0.25))
    assert table.at(200) == pytest.approx((0.02, 1.0 + 2.0))


FILES = {  # further shapes of tables are those of recordings
    "short.csv": "time,v\n0,1\n",
    "words.csv": "time,speed\n0,1\n1,x\n",
    "back.csv": "time,speed\n0,1\n0,2\n",
    "fast.csv": "time,speed\n1,1\n2,99\n",
    "empty.csv": "",
}


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("fast", "there is no 'fast'"),
        ("constant:sped=3", "'sped=3' is not one of speed="),
        ("constant:speed=abc", "speed=abc is not a number"),
        ("constant:speed=99", "outside 0..50"),
        ("sine:period=0", "period must be positive"),
        ("sine:speed=1/2", "not a finite number"),
        ("stop:at=-1", "at and wait must not be negative"),
        ("recorded", "needs path="),
        ("recorded:path=/nowhere.csv", "/nowhere.csv cannot be read: it does not exist"),
        ("recorded:path=short.csv", "has no column 'speed'"),
        ("recorded:path=words.csv", "line 3 needs a number under time and speed"),
        ("recorded:path=back.csv", "time does not grow in line 3"),
        ("recorded:path=fast.csv", "outside -1..60"),
        ("recorded:path=empty.csv", "is empty"),
        ("recorded:path=bag", "a leader needs two speeds or more, not 1"),
        ("road hilly", "there is no 'hilly'"),
        ("road constant:grade=0.5", "grade=0.5"),
        ("road sine:length=1", "length"),
        ("road table:path=/nowhere.csv", "does not exist"),
    ],
)
def test_bad_leaders_and_roads_are_refused_in_one_line(
    text: str, names: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, rows in FILES.items():
        Path(name).write_text(rows)
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=20.0, seed=0)
    once = np.full(len(drive), np.nan)
    once[50] = 20.0
    seen = replace(drive, channels=drive.channels | {"leader_speed": once})
    write_bag(Path("bag"), [seen], interface=drive.interface)
    with pytest.raises(InputError) as caught:
        roads.parse(text.removeprefix("road ")) if text.startswith("road ") else leaders.parse(text)
    assert names in str(caught.value) and "\n" not in str(caught.value)
