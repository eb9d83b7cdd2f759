"""Traffic of SUMO as the leader: who is ahead, when it repeats itself, how it ends, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import recordings
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes import leaders, run_checks
from deeptruck_nodes.traffic import SCENARIOS, STEP, Sumo, Traffic, TrafficEnded

needs_sumo = pytest.mark.skipif(
    find_spec("libsumo") is None, reason="libsumo is not installed; pip install 'deeptruck[sumo]'"
)
TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc", "--radar", "clean")
EXACT = 'speedDev="0" sigma="0" decel="2.5" emergencyDecel="3"'
TYPES = f"""
  <vType id="lorry" vClass="truck" length="16" accel="1" maxSpeed="25" lcSpeedGain="0" {EXACT}/>
  <vType id="car" accel="1.8" maxSpeed="23" minGap="1" lcKeepRight="100" {EXACT}/>"""
ROUTE = "m1 w1 m2 w2 m3"


def vehicle(
    name: str, at: float, lane: int = 0, kind: str = "lorry", route: str = ROUTE, stop: str = ""
) -> str:
    """A vehicle at 20 m/s with its front bumper at a position of its route's first edge."""
    departs = f'depart="0" departSpeed="20" departLane="{lane}" departPos="{at}"'
    return f'<vehicle id="{name}" type="{kind}" {departs}><route edges="{route}"/>{stop}</vehicle>'


LEAD = vehicle("lead", 156)
OURS = vehicle("truck", 100)
BRAKING = vehicle("lead", 156, stop='<stop lane="m1_0" endPos="700" duration="4"/>')


@pytest.fixture
def scenario(tmp_path: Path) -> Callable[..., Path]:
    """A .sumocfg of these vehicles and ours on the shipped road."""

    def _scenario(*vehicles: str, ours: str = OURS, net: str = "motorway", more: str = "") -> Path:
        listed = "".join((*vehicles, ours))
        (tmp_path / "r.rou.xml").write_text(f"<routes>{TYPES}{listed}</routes>")
        files = f'<net-file value="{SCENARIOS / net}.net.xml"/><route-files value="r.rou.xml"/>'
        config = tmp_path / "own.sumocfg"
        config.write_text(f"<configuration><input>{files}</input>{more}</configuration>")
        return config

    return _scenario


@contextmanager
def traffic(config: Path | str, **more: Any) -> Iterator[Traffic]:
    opened = Traffic(Sumo(str(config), **more))
    try:
        yield opened
    finally:
        opened.close()


def drive(
    around: Traffic, seconds: float, speed: float = 20.0, dt: float = STEP
) -> list[tuple[float, float, str]]:
    """Gap, leader's speed and name at every sample of a truck at constant speed."""
    rows = []
    for k in range(round(seconds / dt) + 1):
        around.update(k * dt, speed)
        rows.append((around.gap, around.leader_speed, around.vehicle))
    return rows


@needs_sumo
def test_the_gap_is_that_between_the_bumpers_and_grows_with_the_speed_difference(
    scenario: Callable[..., Path],
) -> None:
    with traffic(scenario(LEAD)) as around:
        rows = drive(around, 5.0, speed=18.0)
    gap, speed, names = zip(*rows, strict=True)
    assert set(names) == {"lead"} and gap[0] == pytest.approx(156 - 16 - 100)
    closing = np.array(speed) - np.array([20.0, *[18.0] * 50])  # ours departs at 20 m/s, and is told 18 then
    opened = np.cumsum((closing[1:] + closing[:-1]) / 2) * STEP
    assert np.diff(gap)[1:] == pytest.approx(np.diff(opened), abs=1e-9)


@needs_sumo
def test_between_the_steps_of_sumo_the_gap_goes_on(scenario: Callable[..., Path]) -> None:
    config = scenario(BRAKING)
    with traffic(config) as around:
        coarse = np.array([row[0] for row in drive(around, 25.0, speed=15.0)])
    with traffic(config) as around:
        fine = np.array([row[0] for row in drive(around, 25.0, speed=15.0, dt=0.02)])
    assert fine[::5] == pytest.approx(coarse, abs=1e-6)
    assert np.abs(np.diff(fine)).max() < 20 * 0.02 + 0.02  # at most the closing speed, and what braking adds


@needs_sumo
def test_a_vehicle_that_changes_into_our_lane_becomes_the_leader(scenario: Callable[..., Path]) -> None:
    with traffic(scenario(vehicle("lead", 260), vehicle("cutter", 150, 1, "car"))) as around:
        rows = drive(around, 30.0)
    names = [row[2] for row in rows]
    at = names.index("cutter")
    assert names[0] == "lead" and rows[at - 1][0] - rows[at][0] > 50 and 5 < rows[at][0] < 100


@needs_sumo
def test_with_nobody_ahead_the_radar_sees_nothing(scenario: Callable[..., Path]) -> None:
    with traffic(scenario(vehicle("behind", 50), vehicle("beside", 150, 1))) as around:
        assert drive(around, 1.0)[-1][0] == math.inf and math.isnan(around.leader_speed)


@needs_sumo
def test_a_speed_that_is_missing_is_the_last_one(scenario: Callable[..., Path]) -> None:
    config, gaps = scenario(LEAD), []
    for told in (18.0, math.nan):
        with traffic(config) as around:
            for k, speed in enumerate((18.0, 18.0, told, told, 18.0)):
                around.update(k * STEP, speed)
            gaps.append(around.gap)
    assert gaps[0] == gaps[1]


@needs_sumo
def test_seeds_make_other_traffic_and_it_stays_within_what_its_drivers_do() -> None:
    speeds = []
    for seed in (0, 0, 3):
        with traffic("motorway", seed=seed) as around:
            speeds.append(np.array([row[:2] for row in drive(around, 40.0, speed=21.0)]))
    same, other = (np.array_equal(speeds[0], found, equal_nan=True) for found in speeds[1:])
    assert same and not other
    for gap, speed in (found.T for found in speeds):
        steady = np.abs(np.diff(gap)) < 2.0  # the same vehicle
        assert np.nanmax(np.abs(np.diff(speed))[steady]) / STEP < 3.0  # m/s2
        assert np.nanmin(speed) > 10 and np.nanmax(speed) < 40 and np.nanmin(gap) > 2


@needs_sumo
def test_sumo_opens_no_socket(scenario: Callable[..., Path]) -> None:
    waits = '<traci_server><remote-port value="8873"/></traci_server>'

    def sockets() -> set[str]:
        links = [path for path in Path("/proc/self/fd").iterdir() if path.is_symlink()]
        return {found for path in links if (found := str(path.readlink())).startswith("socket:")}

    before = sockets()
    with traffic(scenario(LEAD, more=waits)) as around:
        drive(around, 1.0)
        assert sockets() == before


@needs_sumo
@pytest.mark.parametrize(
    ("ours", "vehicle", "speed", "says"),
    [
        (vehicle("truck", 1300, route="m1"), LEAD, 25.0, "is at the end of its road"),
        (OURS, BRAKING, 20.0, "truck has hit lead"),
        (vehicle("truck", 100, route="r1 w1 m2"), LEAD, 20.0, "lane w1_0 ends"),
        (OURS, vehicle("lead", 50), 0.0, "lead has hit truck"),
    ],
)
def test_what_ends_the_traffic_is_said_in_one_line(
    ours: str, vehicle: str, speed: float, says: str, scenario: Callable[..., Path]
) -> None:
    with traffic(scenario(vehicle, ours=ours)) as around, pytest.raises(TrafficEnded) as caught:
        drive(around, 100.0, speed)
    assert (
        says in str(caught.value) and str(caught.value).startswith("after ") and "\n" not in str(caught.value)
    )


@needs_sumo
@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"net": "nowhere"}, "nowhere.net.xml' is not accessible"),
        ({"ours": ""}, "no vehicle 'truck'; name one so, or say which is ours: truck=ID"),
        (
            {"ours": vehicle("truck", 100, route="m1 m3")},
            "No connection between edge 'm1' and",
        ),
        ({"more": "<processing><speed value='1'/></processing>"}, "No option with the name 'speed' exists"),
        ({"vehicles": ()}, "there is no traffic, only 'truck'; add vehicles or flows"),
        ({"ours": OURS.replace('depart="0"', 'depart="2000"')}, "found no place on its road within 900 s"),
    ],
)
def test_what_sumo_refuses_is_said_in_one_line(
    given: dict[str, Any], says: str, scenario: Callable[..., Path]
) -> None:
    config = scenario(*given.pop("vehicles", (LEAD,)), **given)
    with pytest.raises(InputError) as caught:
        run_checks.leader_is_known(f"sumo:{config}", 0.0)
    assert says in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("profile", "says"),
    [
        ("sumo", "needs scenario="),
        ("sumo:nowhere", "no scenario 'nowhere'; give a .sumocfg, or a scenario that is shipped: motorway"),
        ("sumo:{tmp}/nowhere.sumocfg", "cannot be read: it does not exist; give a .sumocfg"),
        ("sumo:{tmp}", "is a folder, not a file"),
        ("sumo:{tmp}/text.sumocfg", "is not XML"),
        ("sumo:{tmp}/other.sumocfg", "holds <routes>, not a configuration of SUMO"),
        ("sumo:motorway,seed=-1", "seed=-1 is outside"),
        ("sumo:motorway,sed=1", "'sed=1' is not one of scenario=, seed=, truck="),
    ],
)
def test_what_is_no_scenario_is_refused_before_sumo_sees_it(profile: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "text.sumocfg").write_text("motorway")
    (tmp_path / "other.sumocfg").write_text("<routes/>")
    with pytest.raises(InputError) as caught:
        leaders.parse(profile.format(tmp=tmp_path))
    assert says in str(caught.value) and "\n" not in str(caught.value)


@needs_sumo
def test_a_gap_of_ones_own_is_refused_for_the_scenario_has_it() -> None:
    with pytest.raises(InputError, match="leave the initial gap out"):
        run_checks.leader_is_known("sumo:motorway", 30.0)


def content(bag: Path) -> list[tuple[str, int, bytes]]:
    with BagSource(bag) as source:
        return sorted(source.messages(set(source.topics)))


@needs_sumo
def test_the_same_seed_gives_the_same_bag(start: Callable[..., Any], tmp_path: Path) -> None:
    bags = []
    for name in ("one", "two"):
        words = ("--leader", "sumo:motorway,seed=3", "--lockstep", "--duration", 10)
        run = start("start_simulation.py", *TRUCK, *words, "--record", tmp_path / name, runs=f"runs-{name}")
        code, _, errors = run.finish()
        assert (code, errors) == (0, "")
        bags.append(content(tmp_path / name))
    assert bags[0] == bags[1]
    (recording,) = recordings.read(tmp_path / "one")
    assert len(recording) == 101 and np.isfinite(recording.channels["gap"]).all()


@needs_sumo
def test_the_truck_slows_behind_braking_traffic(
    start: Callable[..., Any], scenario: Callable[..., Path], tmp_path: Path
) -> None:
    words = ("--leader", f"sumo:{scenario(BRAKING)}", "--lockstep", "--duration", 36)
    run = start("start_simulation.py", *TRUCK, *words, "--record", tmp_path / "bag")
    assert run.finish()[0] == 0
    (recording,) = recordings.read(tmp_path / "bag")
    gap, speed = recording.channels["gap"], recording.channels["speed"]
    assert recording.channels["leader_speed"].min() == 0
    assert 2 < gap.min() < 0.5 * gap[0] and speed.min() < 5


@needs_sumo
def test_at_the_end_of_the_road_the_run_ends_in_order(
    start: Callable[..., Any], scenario: Callable[..., Path], tmp_path: Path
) -> None:
    config = scenario(vehicle("lead", 1400, route="m1"), ours=vehicle("truck", 1300, route="m1"))
    words = ("--leader", f"sumo:{config}", "--lockstep", "--duration", 60)
    run = start("start_simulation.py", *TRUCK, *words, "--record", tmp_path / "bag")
    code, out, errors = run.finish()
    assert code == 1 and errors.count("\n") == 1
    assert "the truck is at the end of its road; the traffic ends here" in errors
    assert out.splitlines()[-1] == f"ended: leader failed; recorded in {tmp_path / 'bag'}"
    (recording,) = recordings.read(tmp_path / "bag")
    assert 50 < len(recording) < 150


@needs_sumo
def test_a_scenario_that_sumo_refuses_starts_nothing(
    start: Callable[..., Any], scenario: Callable[..., Path], tmp_path: Path
) -> None:
    run = start("start_simulation.py", *TRUCK, "--leader", f"sumo:{scenario()}", "--record", tmp_path / "bag")
    code, out, errors = run.finish()
    assert (code, out) == (2, "") and errors.count("\n") == 1 and "there is no traffic" in errors
    assert not (tmp_path / "bag").exists() and not run.runs.exists()
