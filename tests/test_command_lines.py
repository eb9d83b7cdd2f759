"""Command lines that are empty, wrong or half: exit code 2, one line or the help, never a traceback."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import deeptruck_cacc.cli
import truck_bridge.cli
from deeptruck_core.terminal import console
from deeptruck_model import cli, recordings, trucks
from deeptruck_model.trucks import driving_cycles
from deeptruck_nodes import replay_recording, start_simulation, start_vehicle


def _alone(command: Any) -> typer.Typer:
    app = typer.Typer(add_completion=False)
    app.command()(command)
    return app


APPS = {
    "deeptruck-model": cli.whole(),
    "deeptruck-cacc": deeptruck_cacc.cli.app,
    "truck-bridge": truck_bridge.cli.app,
    "deeptruck-simulation": _alone(start_simulation.main),
    "deeptruck-vehicle": _alone(start_vehicle.main),
    "deeptruck-replay": _alone(replay_recording.main),
}
WRONG = [
    "none",
    "none.yaml",
    ".",
    "/dev/null",
    "-1",
    "nan",
    "1e999",
    "a=b",
    "truck:",
    "python:none:none",
    "☃",
]
NO_INPUT = {"deeptruck-model prove"}  # all that it needs is where to write


def commands() -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """Each program's commands: program, words that name the command, what typer parses by."""
    for program, app in APPS.items():
        top: Any = console._command(app)
        inside = getattr(top, "commands", None)
        inside = inside and {name: one for name, one in inside.items() if not one.hidden}
        yield from ((program, (name,), one) for name, one in (inside or {}).items())
        if inside is None:
            yield program, (), top


COMMANDS = {" ".join((program, *words)): (program, words, one) for program, words, one in commands()}


def refused(program: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is said of a command line, which is refused."""
    with pytest.raises(SystemExit) as end:
        console.run(APPS[program], program, cli.spread(words) if program == "deeptruck-model" else words)
    says = capsys.readouterr().err
    assert end.value.code == 2, (words, says)
    assert "Traceback" not in says
    return says


@pytest.mark.parametrize("program", APPS)
def test_every_program_has_a_version(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        console.run(APPS[program], program, ["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"{program} {version('deeptruck')}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_no_arguments_and_an_unknown_option_are_one_line(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    program, words, _ = COMMANDS[name]
    for more in ([], ["--no-such-option"], ["--no-such-option", "none"]):
        says = refused(program, [*words, *more], capsys)
        assert says.startswith(f"{program}: ") and says.count("\n") == 1


@pytest.mark.parametrize("name", COMMANDS)
@settings(
    max_examples=30,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_wrong_and_half_arguments_are_refused(
    name: str,
    data: st.DataObject,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    program, words, command = COMMANDS[name]
    value = st.sampled_from(WRONG) | st.text(
        st.characters(codec="utf-8", exclude_characters="\0"), max_size=8
    )
    line = [*words]
    needed = [p for p in command.params if p.required]
    left_out = data.draw(st.sets(st.sampled_from(needed), min_size=int(name in NO_INPUT)), "left out")
    for p in command.params:
        if (
            p in left_out
            or getattr(p, "is_eager", False)
            or (not p.required and data.draw(st.booleans(), "not given"))
        ):
            continue
        option = [p.opts[0]] if p.opts[0].startswith("-") else []
        if getattr(p, "is_flag", False):
            line += option
        else:
            line += [*option, *(data.draw(value, p.name) for _ in range(abs(p.nargs)))]
    refused(program, line, capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("program", "name", "to"),
    [
        ("deeptruck-model", "adapt", "'mismatch' on the bag of the drive"),
        ("deeptruck-model", "road", "'import', which derives a grade"),
        ("deeptruck-model", "compare", "'Where it is off' in the report of 'mismatch'"),
        ("deeptruck-model", "experiment", "python benchmarks/paper/run.py"),
        ("deeptruck-model", "sweep", "'deeptruck-model fleet train TRUCK --seeds N'"),
        ("deeptruck-cacc", "sweep", "'deeptruck-cacc train --seeds N'"),
    ],
)
def test_a_command_that_moved_names_its_new_place_whatever_it_is_given(
    program: str, name: str, to: str, capsys: pytest.CaptureFixture[str]
) -> None:
    says = refused(program, [name, "minutes", "--seeds", "3", "--no-such-option"], capsys)
    assert f"{program}: '{name}' moved to {to}" in says and says.count("\n") == 1


LIGHT = """
import importlib, sys
module, heavy = sys.argv[1:]
sys.argv = [module, "--help"]
try:
    importlib.import_module(module).main()
except SystemExit as ended:
    assert not ended.code
loaded = set(heavy.split()) & set(sys.modules)
assert not loaded, loaded
"""
HEAVY = {  # what asking for help must not load
    "deeptruck_model.cli": "torch numba matplotlib",
    "deeptruck_cacc.cli": "torch numba stable_baselines3 scipy matplotlib onnx rosbags",
    "truck_bridge.cli": "torch numba scipy",
}


@pytest.mark.parametrize("module", HEAVY)
def test_help_comes_before_anything_heavy(module: str) -> None:
    command = [sys.executable, "-c", LIGHT, module, HEAVY[module]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr


# What works without the libraries of the extras


ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = {
    "deep": ("torch", "safetensors", "onnx", "onnxscript", "tensorboard"),
    "cacc": ("gymnasium", "stable_baselines3"),
    "can": ("can", "cantools"),
    "ros": ("rclpy",),
}
MODULES = [module for modules in EXTRAS.values() for module in modules]
SLIM = """
import importlib, importlib.util, sys
HIDDEN = sys.argv.pop(1).split(",")
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
real = importlib.util.find_spec
importlib.util.find_spec = lambda name, *more: None if name in HIDDEN else real(name, *more)
module, function = sys.argv.pop(1).split(":")
main = getattr(importlib.import_module(module), function)
lines = [line.split("\\t") for line in sys.argv[1:]]
for sys.argv in lines:
    try:
        main()
    except SystemExit as ended:
        if ended.code or sys.argv is lines[-1]:
            raise
"""


def slim(
    *words: str | Path, without: Sequence[str] = MODULES, then: Sequence[Sequence[str | Path]] = ()
) -> subprocess.CompletedProcess[str]:
    """A command without the extras, or without these modules; others `then`, where it succeeds."""
    target = PROJECT["scripts"][words[0]]
    lines = ["\t".join(map(str, line)) for line in (words, *then)]
    command = [sys.executable, "-c", SLIM, ",".join(without), target, *lines]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    drive = driving_cycles.drive(trucks.load("trucksim"), seconds=60.0, seed=1)
    path = tmp_path_factory.mktemp("slim") / "bag"
    recordings.write_bag(path, [drive], interface=drive.interface)
    return path


def test_bags_physics_trucks_and_the_mismatch_tool_need_no_extra(bag: Path, tmp_path: Path) -> None:
    commands = (
        ("coverage", bag, "--out", tmp_path / "coverage"),
        ("evaluate", "truck:trucksim", bag, "--out", tmp_path / "evaluation", "--trials", "3"),
        ("check-simulator", "truck:trucksim"),
        ("mismatch", "--simulator", "truck:trucksim", "--recordings", bag, "--out", tmp_path / "found"),
    )
    first, *others = [("deeptruck-model", *words) for words in commands]
    done = slim(*first, then=others)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"coverage", "evaluation", "found"}


@pytest.mark.parametrize(
    ("words", "library", "extra"),
    [
        (("deeptruck-model", "train", "{bag}", "--out", "{out}"), "torch", "deep"),
        (("deeptruck-cacc", "train", "--simulator", "truck:trucksim", "--out", "{out}"), "", "cacc"),
        (("truck-bridge", "decode", "{log}", "--vehicle", "trucksim", "--out", "{out}.csv"), "", "can"),
    ],
)
def test_what_needs_an_extra_names_it(
    words: tuple[str, ...], library: str, extra: str, bag: Path, tmp_path: Path
) -> None:
    log = tmp_path / "drive.log"
    log.write_text("(1.000000) can0 18FEF100#FFFF00FFFFFFFFFF\n")
    done = slim(*(w.format(bag=bag, out=tmp_path / "out", log=log) for w in words))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.endswith(f"is not installed; pip install 'deeptruck[{extra}]'") and library in line
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize(
    "words",
    [
        ("deeptruck-simulation", "--simulator", "truck:trucksim", "--policy", "baseline:acc"),
        ("deeptruck-replay", "{bag}"),
    ],
)
def test_a_run_without_ros_names_its_extra(words: tuple[str, ...], bag: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    called = [word.format(bag=bag) for word in words]
    done = slim(*called, "--record", tmp_path / "drive", "--runs", runs, without=EXTRAS["ros"])
    assert done.returncode == 2
    says = "rclpy is not installed; pip install 'deeptruck[ros]', or source a ROS 2 Jazzy"
    assert done.stderr == f"{words[0]}: {says}\n"
    assert not list(tmp_path.iterdir())


def test_every_extra_is_in_all() -> None:
    extras = PROJECT["optional-dependencies"]
    assert set(EXTRAS) <= set(extras)
    (every,) = extras["all"]
    assert every == "deeptruck[deep,cacc,can]" and "deeptruck[all]" in extras["dev"]
