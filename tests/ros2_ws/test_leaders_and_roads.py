"""Leaders and roads: what the one-line descriptions mean, and what is refused."""

from __future__ import annotations

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
