"""What works without the libraries of the extras, and what says which extra it needs."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest

from deeptruck_model import recordings, trucks
from deeptruck_model.trucks import driving_cycles

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
