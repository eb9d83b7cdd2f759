"""Leaders and roads: what the one-line descriptions mean, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles
from deeptruck_nodes import leaders, roads


def speeds(text: str, times: list[float]) -> list[float]:
    leader = leaders.parse(text)
    return [leader.speed_at(t) for t in times]


def test_constant_keeps_its_speed() -> None:
    assert speeds("constant:speed=17.5", [0, 1e5]) == [17.5, 17.5]


def test_sine_has_the_stated_amplitude_and_period() -> None:
    assert speeds("sine:speed=18,amplitude=2,period=20", [0, 5, 10, 15]) == pytest.approx([18, 20, 18, 16])


def test_steps_respect_the_acceleration_and_reach_each_speed() -> None:
    text = "steps:speeds=20/24/18,every=30,acceleration=2"
    assert speeds(text, [0, 30, 31, 32, 59, 60, 62, 63, 200]) == pytest.approx(
        [20, 20, 22, 24, 24, 24, 20, 18, 18]
    )


def test_the_last_step_is_approached_until_it_is_reached() -> None:
    """The one before it has only until the next begins: 10 m/s after 10 s at 1 m/s^2."""
    text = "steps:speeds=0/30/40,every=10,acceleration=1"
    assert speeds(text, [10, 20, 30, 50, 60]) == pytest.approx([0, 10, 20, 40, 40])


def test_stop_brakes_to_zero_waits_and_drives_off() -> None:
    text = "stop:speed=20,at=30,deceleration=6,wait=10"
    standing = 30 + 20 / 6
    at = speeds(text, [30, 31, standing, standing + 10, standing + 15, standing + 100])
    assert at == pytest.approx([20, 14, 0, 0, 4, 20])


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


@pytest.mark.parametrize(
    "text",
    [
        "\ufefftime,speed\n100,10\n102,14.5\n",
        "time;speed\n100;10\n102;14,5\n",
        "time\tspeed\ts\n100\t10\t\n102\t14.5\t\n",
        "time,speed\ns,m/s\n100,10\n102,14.5\n",
        " time , speed \n100, 10,\n102, 14.5,\n",
        "my drive\nof May, 1st\ntime,speed\n100,10\n102,14.5\n",
        "sep=;\ntime;speed\n100;10\n102;14.5\n",
    ],
)
def test_leaders_and_roads_are_read_as_recordings_are(text: str, tmp_path: Path) -> None:
    """Byte order marks, delimiters, decimal commas, units, text above the names."""
    (tmp_path / "lead.csv").write_text(text, encoding="utf-8")
    assert speeds(f"recorded:path={tmp_path}/lead.csv", [0, 2]) == [10, 14.5]
    (tmp_path / "wide.csv").write_text(text, encoding="utf-16")
    assert speeds(f"recorded:path={tmp_path}/wide.csv", [0, 2]) == [10, 14.5]
    slope = text.replace("time", "distance").replace("speed", "grade")
    slope = slope.replace("14,5", "0,02").replace("14.5", "0.02").replace("10,", "0,").replace("10\n", "0\n")
    (tmp_path / "road.csv").write_text(slope.replace("10\t", "0\t").replace(" 10", "0"), encoding="utf-8")
    assert roads.parse(f"table:path={tmp_path}/road.csv").at(102)[0] == 0.02


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


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("fast", "there is no 'fast'"),
        ("constant:sped=3", "'sped=3' is not one of speed="),
        ("constant:speed=abc", "speed=abc is not a number"),
        ("constant:speed=nan", "not a finite number"),
        ("constant:speed=99", "outside 0..50"),
        ("sine:period=0", "period must be positive"),
        ("sine:speed=1/2", "not a finite number"),
        ("stop:at=-1", "at and wait must not be negative"),
        ("stop:wait=-5", "at and wait must not be negative"),
        ("random:seed=1.5", "seed=1.5 is not a number"),
        ("recorded", "needs path="),
        ("recorded:path=/nowhere.csv", "/nowhere.csv cannot be read: it does not exist"),
    ],
)
def test_bad_leaders_are_refused_in_one_line(text: str, names: str) -> None:
    with pytest.raises(InputError) as caught:
        leaders.parse(text)
    assert names in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        ("time,v\n0,1\n", "has no column 'speed'"),
        ("time,speed\n0,x\n", "line 2 needs a number under time and speed"),
        ("time,speed\n0,1\n1,x\n", "line 3 needs a number under time and speed"),
        ("time,speed\n0,1\n0,2\n", "time does not grow in line 3"),
        ("time,speed\n1,1\n2,99\n", "outside -1..60"),
        ("time,speed\n1,1\n2,nan\n", "line 3 needs a number"),
        ("", "is empty"),
        ("time;speed\n0;1,5\n1;2.5\n", "line 2 needs a number under time and speed"),
        ("time,speed\n0,1,5\n1,2,5\n", "none of the 2 rows below has as many"),
    ],
)
def test_bad_leader_files_are_refused_in_one_line(rows: str, names: str, tmp_path: Path) -> None:
    (tmp_path / "lead.csv").write_text(rows)
    with pytest.raises(InputError, match=names):
        leaders.parse(f"recorded:path={tmp_path}/lead.csv")


def test_a_bag_that_saw_its_leader_once_is_refused_as_that(tmp_path: Path) -> None:
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=20.0, seed=0)
    once = np.full(len(drive), np.nan)
    once[50] = 20.0
    seen = replace(drive, channels=drive.channels | {"leader_speed": once})
    write_bag(tmp_path / "bag", [seen], interface=drive.interface)
    with pytest.raises(InputError, match="a leader needs two speeds or more, not 1"):
        leaders.parse(f"recorded:path={tmp_path}/bag")


@pytest.mark.parametrize(
    "text", ["hilly", "constant:grade=0.5", "sine:length=1", "table:path=/nowhere.csv", "table"]
)
def test_bad_roads_are_refused(text: str) -> None:
    with pytest.raises(InputError):
        roads.parse(text)


def test_every_description_has_a_finite_speed_everywhere() -> None:
    for kind in ("constant", "sine", "steps", "stop", "random"):
        assert all(math.isfinite(v) and v >= 0 for v in speeds(kind, np.arange(0, 300, 0.7).tolist()))
