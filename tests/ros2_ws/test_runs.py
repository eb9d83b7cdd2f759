"""What the start scripts refuse before anything is started or written."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_nodes import bag_place, leaders, page_server, runs, start_simulation
from deeptruck_nodes.supervisor import Program

SCRIPTS = Path(__file__).parents[2] / "ros2_ws"


def script(name: str) -> Callable[..., None]:
    """The function behind a start script."""
    main: Callable[..., None] = importlib.import_module(f"deeptruck_nodes.{name}").main
    return main


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """The one line a script says about bad input; it must have written nothing."""

    def _refused(name: str, **options: Any) -> str:
        with pytest.raises(InputError) as caught:
            script(name)(record=tmp_path / "bag", run_folders=tmp_path / "runs", **options)
        out, errors = capsys.readouterr()
        assert "\n" not in str(caught.value) and not out and not errors
        assert not (tmp_path / "bag").exists() and not (tmp_path / "runs").exists()
        return str(caught.value)

    return _refused


def test_a_missing_option_is_one_line_and_2(start: Callable[..., Any]) -> None:
    code, out, errors = start("start_simulation.py", "--policy", "baseline:acc").finish()
    assert code == 2 and not out and errors.count("\n") == 1
    assert errors.startswith("start_simulation: Missing option '--simulator'")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"simulator": "truck:no_such"}, "no_such"),
        ({"simulator": "nowhere"}, "nowhere does not exist; give a simulator directory"),
        ({"policy": "nowhere"}, "is not a policy directory"),
        ({"policy": "baseline:best"}, "there is no baseline 'best'"),
        ({"leader": "sine:perod=3"}, "'perod=3' is not one of"),
        ({"leader": "sumo:motorway"}, "use recorded:path=FILE"),
        ({"policy": "planner:truck:trucksim?economy"}, "use planner:truck:trucksim"),
        ({"policy": "mine.onnx"}, "use the policy directory"),
        ({"road": "steep"}, "there is no 'steep'"),
        ({"rate": 33.0}, "whole multiple"),
        ({"rate": 1e6}, "rate_hz = 1000000.0 is outside"),
        ({"time_gap": 0.0}, "target_time_gap = 0.0 is outside"),
        ({"initial_speed": float("nan")}, "initial_speed = nan is outside"),
        ({"parameters": Path("none.yaml")}, "cannot read parameters none.yaml"),
    ],
)
def test_bad_simulations(refused: Callable[..., str], options: dict[str, Any], says: str) -> None:
    assert says in refused(
        "start_simulation", **{"simulator": "truck:trucksim", "policy": "baseline:acc", **options}
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"vehicle": "tank"}, "no vehicle 'tank'"),
        ({"policy": "nowhere"}, "is not a policy directory"),
        ({"emulator": True, "leader": "fast"}, "there is no 'fast'"),
        (
            {"emulator": True, "grade": "hill.csv"},
            "hill.csv cannot be read: it does not exist; give a number or a table",
        ),
        ({"emulator": True, "grade": "2"}, "--grade 2 must be a number from -0.5 to 0.5"),
        ({"emulator": True, "driver": "5:brake_pedal=400"}, "values 0 to 100"),
        ({"driver": "5:brake_pedal=40"}, "--driver is of the emulated truck: add --emulator"),
        ({"emulator": True, "actuators": "5:brake.gone=1"}, "keys are engine.gain"),
        ({"actuators": "5:brake.gain=0"}, "--actuators is of the emulated truck: add --emulator"),
        ({"radar_lost_at": 20.0}, "--radar-lost-at is of a simulated radar: add --leader or --emulator"),
        ({"interface": "smoke"}, "cannot open CAN interface 'smoke'"),
        ({"interface": "socketcan", "channel": "can9"}, "cannot open CAN interface 'socketcan'"),
    ],
)
def test_bad_vehicles(refused: Callable[..., str], options: dict[str, Any], says: str) -> None:
    assert says in refused("start_vehicle", **{"vehicle": "trucksim", "policy": "baseline:acc", **options})


def test_bad_bags_to_replay(refused: Callable[..., str], tmp_path: Path) -> None:
    assert "does not exist" in refused("replay_recording", bag=tmp_path / "none")
    (tmp_path / "other").mkdir()
    assert "is empty, it holds no bag" in refused("replay_recording", bag=tmp_path / "other")
    CrashSafeWriter(tmp_path / "empty").close()
    assert "it holds no message; record while" in refused("replay_recording", bag=tmp_path / "empty")


def test_a_bag_is_not_recorded_over_while_it_is_played(tmp_path: Path) -> None:
    with CrashSafeWriter(tmp_path / "bag") as writer, bag_place.claimed(tmp_path / "bag"):
        writer.write("/x", "std_msgs/msg/String", bytes.fromhex("00010000010000000000"), 1)
    with pytest.raises(InputError, match="is the bag that is played"):
        script("replay_recording")(bag=tmp_path / "bag", record=tmp_path / "bag", overwrite=True)
    assert (tmp_path / "bag" / "metadata.yaml").exists()


def test_a_drive_is_not_recorded_over_while_the_leader_follows_it(tmp_path: Path) -> None:
    given = {"simulator": "truck:trucksim", "policy": "baseline:acc", "overwrite": True}
    with pytest.raises(InputError, match="is the drive of the leader; choose another --record"):
        script("start_simulation")(
            leader=f"recorded:path={tmp_path / 'drive'}", record=tmp_path / "drive", **given
        )


def test_own_parameters_win_over_the_options_and_name_only_nodes_of_the_run(
    refused: Callable[..., str], tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    truck = {"simulator": "truck:trucksim", "policy": "baseline:acc", "parameters": own}
    own.write_text("truck_sim: {ros__parameters: {rate_hz: 33.0}}")
    assert "rate_hz = 33" in refused("start_simulation", **truck, rate=100.0)
    own.write_text("replay: {ros__parameters: {speed: 2.0}}")
    assert "this run has no node 'replay'" in refused("start_simulation", **truck)


@pytest.mark.parametrize(
    ("node", "given", "says"),
    [
        ("recorder", "bag: elsewhere", "--record says where to record; leave out the recorder's bag"),
        (
            "truck_sim",
            "lockstep: true",
            "truck_sim's lockstep is what this run makes it, False",
        ),
        ("leader", "peers: [radar]", "leader's peers is what this run makes it"),
    ],
)
def test_own_parameters_that_would_not_be_used_are_refused(
    refused: Callable[..., str], tmp_path: Path, node: str, given: str, says: str
) -> None:
    own = tmp_path / "own.yaml"
    truck = {"simulator": "truck:trucksim", "policy": "baseline:acc", "parameters": own}
    own.write_text(f"{node}: {{ros__parameters: {{{given}}}}}")
    assert says in refused("start_simulation", **truck)


def test_parameters_of_a_recorder_where_nothing_is_recorded_are_refused(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("recorder: {ros__parameters: {topics: [/road]}}")
    with pytest.raises(InputError, match="nothing is recorded without --record BAG; add it"):
        script("start_simulation")(
            simulator="truck:trucksim", policy="baseline:acc", parameters=own, run_folders=tmp_path / "runs"
        )
    assert list(tmp_path.iterdir()) == [own]


def test_all_misfits_are_in_one_line(refused: Callable[..., str], tmp_path: Path) -> None:
    said = refused(
        "start_simulation", simulator="nowhere", policy="nobody", leader="fast", road="steep", time_gap=0.0
    )
    assert said.startswith("5 things do not fit: (1) nowhere does not exist")
    for part in ("nobody", "'fast'", "'steep'", "target_time_gap = 0.0 is outside"):
        assert part in said
    said = refused("start_vehicle", vehicle="tank", policy="nobody", interface="smoke", grade="hill.csv")
    assert said.startswith("4 things do not fit: (1) no vehicle 'tank'"), said


HEAVY = ("rclpy", "torch", "numba", "scipy", "matplotlib", "rosbags")
MISFITS = {
    "start_simulation": ("--simulator", "nowhere", "--policy", "nobody"),
    "start_vehicle": ("--vehicle", "tank", "--policy", "nobody"),
    "replay_recording": ("nowhere",),
}


@pytest.mark.parametrize("name", MISFITS)
def test_misfits_are_said_before_anything_heavy_is_imported(name: str) -> None:
    """How long an error takes is what was imported for it. It is one line, and the exit code 2."""
    imports = [sys.executable, "-X", "importtime", SCRIPTS / f"{name}.py", *MISFITS[name]]
    done = subprocess.run(imports, capture_output=True, text=True, timeout=240, check=False)
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    said = [line for line in done.stderr.splitlines() if not line.startswith("import time:")]
    assert len(said) == 1 and said[0].startswith(f"{name}: ") and not done.stdout
    assert done.returncode == 2 and "deeptruck_nodes.runs" in imported
    assert not imported & {*HEAVY}


def test_a_port_of_the_page_that_is_taken(refused: Callable[..., str], tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    truck = {"simulator": "truck:trucksim", "policy": "baseline:acc", "parameters": own}
    with page_server.opened()[0] as held:
        number = held.getsockname()[1]
        own.write_text(f"live_page: {{ros__parameters: {{port: {number}}}}}")
        assert "this run has no node 'live_page'" in refused("start_simulation", **truck)
        with pytest.raises(InputError, match=f"cannot have port {number}"):
            script("start_simulation")(**truck, page=True, run_folders=tmp_path / "runs")
        assert list(tmp_path.iterdir()) == [own]


def test_a_domain_out_of_range(refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "230")
    assert "ROS_DOMAIN_ID=230" in refused(
        "start_simulation", simulator="truck:trucksim", policy="baseline:acc"
    )


def test_the_last_line_of_a_run_says_why_and_where(tmp_path: Path) -> None:
    bag, newer = tmp_path / "bag", tmp_path / ".bag.1.new"
    assert "nothing was to be recorded" in runs.recorded(None, None)
    assert runs.recorded(bag, bag) == f"there is no bag {bag}"
    CrashSafeWriter(bag).close()
    assert runs.recorded(bag, bag) == f"recorded in {bag}"
    assert runs.recorded(bag, newer) == f"nothing was recorded, {bag} is the older bag"
    newer.mkdir()
    assert f"{newer} is not the recorder's" in runs.recorded(bag, newer)  # of a user, who put it there
    (newer / "bag_0.mcap").touch()
    assert f"the bag {newer} is not finished" in runs.recorded(bag, newer)


def test_the_field_radar_jumps_when_the_paper_says() -> None:
    assert runs.RADARS["field"]["lane_change_at_s"] == 63.0


def test_the_leaders_of_the_help_text_exist() -> None:
    """What is shown and what can be parsed are the same kinds, in both directions."""
    section = start_simulation.EXAMPLES.partition("Leaders:")[2].partition("Roads:")[0]
    assert set(re.findall(r"(\w+):\w", section)) == set(leaders.KINDS)


@pytest.mark.parametrize(
    ("name", "bridge", "priority"),
    [
        ("leader", {}, 10), ("emulator", {"priority": 3}, 3), ("controller", {"priority": 0}, 0),
        ("recorder", {}, 0), ("controller", None, 0),
    ],
)  # fmt: skip
def test_what_control_depends_on_has_the_priority_of_the_bridge(
    name: str, bridge: dict[str, int] | None, priority: int
) -> None:
    sections = {} if bridge is None else {"can_bridge": bridge}
    assert runs._hurried(Program(name, ()), sections).priority == priority
