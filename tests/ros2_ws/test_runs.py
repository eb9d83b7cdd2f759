"""What the start scripts refuse before anything is started or written."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_nodes import leaders, page_server, runs, start_simulation
from deeptruck_nodes.bag_place import claimed
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
        ({"leader": "sine:perod=3"}, "'perod=3' is not one of"),
        ({"leader": "sumo:motorway"}, "use recorded:path=FILE"),
        ({"road": "steep"}, "there is no 'steep'"),
        ({"rate": 1e6}, "rate_hz = 1000000.0 is outside"),
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
        ({"emulator": True, "leader": "fast"}, "there is no 'fast'"),
        ({"driver": "5:brake_pedal=40"}, "--driver is of the emulated truck: add --emulator"),
        ({"actuators": "5:brake.gain=0"}, "--actuators is of the emulated truck: add --emulator"),
        ({"radar_lost_at": 20.0}, "--radar-lost-at is of a simulated radar: add --leader or --emulator"),
    ],
)
def test_bad_vehicles(refused: Callable[..., str], options: dict[str, Any], says: str) -> None:
    assert says in refused("start_vehicle", **{"vehicle": "trucksim", "policy": "baseline:acc", **options})


@pytest.mark.parametrize(
    ("words", "who", "says"),
    [
        (("start_simulation.py", "--simulator", "truck:trucksim", "--policy",
          "planner:truck:trucksim?economy"), "controller", "use planner:truck:trucksim"),
        (("start_simulation.py", "--simulator", "truck:trucksim", "--policy", "mine.onnx"),
         "controller", "use the policy directory"),
        (("start_simulation.py", "--simulator", "truck:trucksim", "--policy", "baseline:best"),
         "controller", "there is no baseline 'best'"),
        (("start_simulation.py", "--simulator", "truck:trucksim", "--policy", "baseline:acc", "--rate", 33),
         "truck_sim", "whole multiple"),
        (("start_vehicle.py", "--vehicle", "trucksim", "--policy", "baseline:acc", "--emulator", "--driver",
          "5:brake_pedal=400"), "emulator", "values 0 to 100"),
        (("start_vehicle.py", "--vehicle", "trucksim", "--policy", "baseline:acc", "--interface", "socketcan",
          "--channel", "can9"), "can_bridge", "cannot open CAN interface 'socketcan'"),
    ],
)  # fmt: skip
def test_what_a_node_refuses_ends_the_run_with_its_line(
    start: Callable[..., Any], tmp_path: Path, words: tuple[object, ...], who: str, says: str
) -> None:
    code, _, errors = start(*words, "--record", tmp_path / "bag").finish()
    assert code == 2 and errors.count("\n") == 1
    assert errors.startswith(f"{who} ended (exit code 2): ") and says in errors
    assert not (tmp_path / "bag").exists()


def test_bad_bags_to_replay(refused: Callable[..., str], tmp_path: Path) -> None:
    assert "does not exist" in refused("replay_recording", bag=tmp_path / "none")
    (tmp_path / "other").mkdir()
    assert "holds no MCAP file; give the folder that the recorder wrote" in refused(
        "replay_recording", bag=tmp_path / "other"
    )
    CrashSafeWriter(tmp_path / "empty").close()
    assert "it holds no message; record while" in refused("replay_recording", bag=tmp_path / "empty")


def test_a_bag_is_not_recorded_over_while_it_is_played(tmp_path: Path) -> None:
    with CrashSafeWriter(tmp_path / "bag") as writer, claimed(tmp_path / "bag"):
        writer.write("/x", "std_msgs/msg/String", bytes.fromhex("00010000010000000000"), 1)
    with pytest.raises(
        InputError, match=r"is .*bag or inside it, which is read here; choose another --record"
    ):
        script("replay_recording")(bag=tmp_path / "bag", record=tmp_path / "bag", overwrite=True)
    assert (tmp_path / "bag" / "metadata.yaml").exists()


def test_a_drive_is_not_recorded_over_while_the_leader_follows_it(tmp_path: Path) -> None:
    given = {"simulator": "truck:trucksim", "policy": "baseline:acc", "overwrite": True}
    (tmp_path / "drive").write_text("time,speed\n0,20\n10,21\n")
    with pytest.raises(InputError, match="which is read here; choose another --record"):
        script("start_simulation")(
            leader=f"recorded:path={tmp_path / 'drive'}", record=tmp_path / "drive", **given
        )


def test_own_parameters_win_over_the_options_and_name_only_nodes_of_the_run(
    refused: Callable[..., str], tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    truck = {"simulator": "truck:trucksim", "policy": "baseline:acc", "parameters": own}
    own.write_text("truck_sim: {ros__parameters: {rate_hz: 0.5}}")
    assert "rate_hz = 0.5 is outside" in refused("start_simulation", **truck, rate=100.0)
    own.write_text("replay: {ros__parameters: {speed: 2.0}}")
    assert "this run has no node 'replay'" in refused("start_simulation", **truck)


@pytest.mark.parametrize(
    ("node", "given", "says"),
    [
        ("recorder", "bag: elsewhere", "recorder's bag follows from the command line; leave it out"),
        ("truck_sim", "lockstep: true", "truck_sim's lockstep follows from the command line"),
    ],
)
def test_own_parameters_that_would_not_be_used_are_refused(
    refused: Callable[..., str], tmp_path: Path, node: str, given: str, says: str
) -> None:
    own = tmp_path / "own.yaml"
    truck = {"simulator": "truck:trucksim", "policy": "baseline:acc", "parameters": own}
    own.write_text(f"{node}: {{ros__parameters: {{{given}}}}}")
    assert says in refused("start_simulation", **truck)


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


def test_the_last_line_of_a_run_says_where_it_is_recorded(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    assert "nothing was to be recorded" in runs.recorded(None)
    assert runs.recorded(bag) == "nothing was recorded"
    CrashSafeWriter(bag).close()
    assert runs.recorded(bag) == f"recorded in {bag}"
    (bag / "metadata.yaml").unlink()
    assert f"the bag {bag} is not finished" in runs.recorded(bag)


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
    sections = {} if bridge is None else {"can_bridge": {"priority": 10, **bridge}}
    assert runs._hurried(Program(name, ()), sections).priority == priority
