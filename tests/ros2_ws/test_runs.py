"""What the start scripts refuse before anything is started or written."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.files import MARKER
from deeptruck_model.recordings import CrashSafeWriter
from deeptruck_nodes import page_server, parameters, runs
from deeptruck_nodes.bag_place import BAG, claimed, is_whole
from deeptruck_nodes.supervisor import Program


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


SIMULATION = {"simulator": "truck:trucksim", "policy": "baseline:acc"}
VEHICLE = {"vehicle": "trucksim", "policy": "baseline:acc"}
OWN = {  # files of parameters
    "slow.yaml": "truck_sim: {ros__parameters: {rate_hz: 0.5}}",
    "other.yaml": "replay: {ros__parameters: {speed: 2.0}}",
    "page.yaml": "live_page: {ros__parameters: {port: 5000}}",
    "bag.yaml": "recorder: {ros__parameters: {bag: elsewhere}}",
    "lock.yaml": "truck_sim: {ros__parameters: {lockstep: true}}",
}


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("start_simulation", {"simulator": "truck:no_such"}, "no_such"),
        ("start_simulation", {"simulator": "nowhere"}, "nowhere does not exist; give a simulator directory"),
        ("start_simulation", {"leader": "sine:perod=3"}, "'perod=3' is not one of"),
        ("start_simulation", {"leader": "sumo:motorway"}, "use recorded:path=FILE"),
        ("start_simulation", {"road": "steep"}, "there is no 'steep'"),
        ("start_simulation", {"rate": 1e6}, "rate_hz = 1000000.0 is outside"),
        ("start_simulation", {"parameters": "none.yaml"}, "cannot read parameters none.yaml"),
        ("start_simulation", {"parameters": "slow.yaml", "rate": 100.0}, "rate_hz = 0.5 is outside"),
        ("start_simulation", {"parameters": "other.yaml"}, "this run has no node 'replay'"),
        ("start_simulation", {"parameters": "page.yaml"}, "this run has no node 'live_page'"),
        ("start_simulation", {"parameters": "bag.yaml"}, "recorder's bag follows from the command line"),
        ("start_simulation", {"parameters": "lock.yaml"}, "truck_sim's lockstep follows from the command"),
        ("start_simulation", {"policy": "baseline:best"}, "there is no baseline 'best'"),
        ("start_simulation", {"policy": "planner:nowhere"}, "nowhere does not exist"),
        ("start_vehicle", {"policy": "other"}, "other is not a policy directory"),
        ("start_vehicle", {"vehicle": "tank"}, "no vehicle 'tank'"),
        ("start_vehicle", {"emulator": True, "leader": "fast"}, "there is no 'fast'"),
        ("start_vehicle", {"driver": "5:brake_pedal=40"}, "--driver is of the emulated truck"),
        ("start_vehicle", {"actuators": "5:brake.gain=0"}, "--actuators is of the emulated truck"),
        ("start_vehicle", {"radar_lost_at": 20.0}, "--radar-lost-at is of a simulated radar"),
        ("replay_recording", {"bag": "none"}, "does not exist"),
        ("replay_recording", {"bag": "other"}, "holds no MCAP file; give the folder that the recorder wrote"),
        ("replay_recording", {"bag": "empty"}, "it holds no message; record while"),
    ],
)
def test_what_is_refused_before_anything_starts(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    name: str, options: dict[str, Any], says: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for file, text in OWN.items():
        Path(file).write_text(text)
    Path("other").mkdir()
    CrashSafeWriter(Path("empty")).close()
    paths = {key: Path(options[key]) for key in ("bag", "parameters") if key in options}
    given = {"start_simulation": SIMULATION, "start_vehicle": VEHICLE}.get(name, {})
    assert says in refused(name, **{**given, **options, **paths})


@pytest.mark.parametrize(
    ("words", "who", "says"),
    [
        (("start_vehicle.py", "--vehicle", "trucksim", "--policy", "baseline:acc", "--interface", "socketcan",
          "--channel", "can9"), "can_bridge", "cannot open CAN interface 'socketcan'"),
    ],
)  # fmt: skip
def test_what_a_node_refuses_ends_the_run_with_its_line(
    start: Callable[..., Any], tmp_path: Path, words: tuple[object, ...], who: str, says: str
) -> None:
    code, said, errors = start(*words, "--record", tmp_path / "bag").finish()
    assert code == 2 and errors.count("\n") == 1 and says not in said
    assert errors.startswith(f"{who} ended (exit code 2): ") and says in errors
    assert not (tmp_path / "bag").exists()


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


def test_a_port_of_the_page_that_is_taken(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    with page_server.opened()[0] as held:
        number = held.getsockname()[1]
        own.write_text(f"live_page: {{ros__parameters: {{port: {number}}}}}")
        with pytest.raises(InputError, match=f"cannot have port {number}.*choose another"):
            script("start_simulation")(**SIMULATION, parameters=own, page=True, run_folders=tmp_path / "runs")
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


# Where a run records: an older bag is kept until the new one is whole


def recorded(bag: Path, says: str = "old") -> None:
    """What the recorder does."""
    writer = CrashSafeWriter(bag, custom_data={"says": f'"{says}"'})
    with claimed(bag):
        writer.close()


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_bag_of_ours_is_replaced_once_the_new_one_is_whole(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    recorded(bag)
    old = content(bag)
    with pytest.raises(InputError, match="--record, or add --overwrite"):
        BAG.check(bag)
    with BAG.recording(bag, overwrite=True, whole=is_whole):
        assert content(tmp_path / "bag.old") == old
        recorded(bag, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["bag"] and content(bag) != old
    assert content(bag).keys() == {"bag_0.mcap", "metadata.yaml", MARKER}


# Parameters: one schema, one line for whatever does not fit it


NODES = [name for name in parameters.schema() if name != "common"]


@pytest.mark.parametrize("node", NODES)
def test_defaults_fit_their_own_schema(node: str) -> None:
    values = parameters.checked(node, {})
    assert set(values) == set(parameters.described(node))
    assert all(entry["says"] for entry in parameters.described(node).values())


def test_a_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    given = {"leader": {"seed": 3, "profile": "sine"}, "truck_sim": {"rate_hz": 50.0}}
    parameters.write_file(tmp_path / "p.yaml", given)
    back = parameters.read_file(tmp_path / "p.yaml")
    assert {k: back["leader"][k] for k in ("seed", "profile")} == given["leader"]
    assert parameters.checked("truck_sim", back["truck_sim"]) == parameters.checked(
        "truck_sim", given["truck_sim"]
    )


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (None, "cannot read parameters"),
        ("a: [", "is not YAML"),
        ("", "expected 'NODE: {ros__parameters: {name: value}}'"),
        ("pilot: {ros__parameters: {x: 1}}", "not 'pilot'; nodes are truck_sim"),
        ("leader: {seed: 1}", "expected 'NODE: {ros__parameters:"),
        ("leader: {ros__parameters: {speeed: 1}}", "has no parameter 'speeed'"),
        ("/leader: {ros__parameters: {seed: -1}}", "outside 0..2147483647"),
        ("truck_sim: {ros__parameters: {rate_hz: .nan}}", "is outside 1..1000"),
        ("truck_sim: {ros__parameters: {rate_hz: fast}}", "rate_hz = 'fast' is not a number"),
        ("truck_sim: {ros__parameters: {rate_hz: true}}", "is not a number"),
        ("truck_sim: {ros__parameters: {simulator: 3}}", "is not a text"),
        ("truck_sim: {ros__parameters: {lockstep: 1}}", "is not a switch"),
        ("truck_sim: {ros__parameters: {peers: leader}}", "is not a texts"),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str | None, names: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        parameters.read_file(tmp_path / "p.yaml")
    assert names in str(caught.value) and "\n" not in str(caught.value)
