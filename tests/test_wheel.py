"""The wheel holds all that the source has, and its commands run where the source is not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from collections.abc import Callable, Collection
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NODES = Path("ros2_ws/src/deeptruck_nodes")
PACKAGES = {"deeptruck_core", "deeptruck_model", "deeptruck_cacc", "truck_bridge", "deeptruck_nodes"}
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
LEFTOVERS = ("__pycache__", "*.egg-info", "build")

Call = Callable[..., subprocess.CompletedProcess[str]]


def call(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command in a folder, by which no package of ours is found."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = list(map(str, words))
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=250
    )


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what builds read: setuptools leaves folders beside what it builds."""
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for folder in ("src", "exam", NODES):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns(*LEFTOVERS))
    return source


def wheel_of(source: Path, out: Path) -> Path:
    """The wheel of a folder, built by pip, offline."""
    build = (sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index")
    done = call(*build, "-w", out, source, cwd=out)
    assert done.returncode == 0, done.stderr
    (found,) = out.iterdir()
    return found


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return wheel_of(source, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the programs of a fresh environment are: it has the wheel, and the libraries of this one."""
    place = tmp_path_factory.mktemp("environment")
    made = call(sys.executable, "-m", "venv", "--without-pip", place, cwd=place)
    assert made.returncode == 0, made.stderr
    libraries = sysconfig.get_path("purelib")
    inside = sysconfig.get_path("purelib", vars={"base": str(place)})
    Path(inside, "libraries.pth").write_text(f"{libraries}\n")  # its own .pth files, as of `-e`, do not count
    install = (sys.executable, "-m", "pip", "--python", place / "bin" / "python", "install")
    options = ("-q", "--no-deps", "--no-index", "--no-compile", "--ignore-installed")
    installed = call(*install, *options, wheel, cwd=place)
    assert installed.returncode == 0, installed.stderr
    return place / "bin"


@pytest.fixture
def run(programs: Path, tmp_path: Path) -> Call:
    """A program of the fresh environment, in an empty folder."""
    return lambda program, *words: call(programs / program, *words, cwd=tmp_path)


def files(source: Path, packages: Collection[str] = PACKAGES) -> set[str]:
    """Paths of all files of our packages below a source folder, but for byte code."""
    found = [path for name in packages for path in (source / name).rglob("*") if path.is_file()]
    return {path.relative_to(source).as_posix() for path in found if "__pycache__" not in path.parts}


def packed(wheel: Path) -> set[str]:
    """Paths of all files in a wheel, but for what describes it."""
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def test_the_wheel_holds_every_file_and_no_other(wheel: Path) -> None:
    inside = zipfile.ZipFile(wheel)
    assert packed(wheel) == files(ROOT / "src") | files(ROOT / NODES)
    for kind in (".yaml", ".dbc", ".xml", ".jinja", ".css", ".js", ".json", "py.typed"):
        assert any(name.endswith(kind) for name in packed(wheel)), kind
    (listed,) = [name for name in inside.namelist() if name.endswith(".dist-info/top_level.txt")]
    assert set(inside.read(listed).decode().split()) == PACKAGES


def test_the_exam_is_a_wheel_of_its_own_which_prove_asks_for(
    source: Path, run: Call, tmp_path_factory: pytest.TempPathFactory
) -> None:
    exam = wheel_of(source / "exam", tmp_path_factory.mktemp("exam"))
    assert packed(exam) == files(ROOT / "exam" / "src", ["deeptruck_exam"])
    done = run("deeptruck-model", "prove", "--out", "proof")
    assert done.returncode == 2 and "pip install 'deeptruck[exam]'" in done.stderr


def test_every_package_comes_from_the_wheel(run: Call, programs: Path) -> None:
    says = "".join(f"import {name}; print({name}.__file__)\n" for name in sorted(PACKAGES))
    done = run("python", "-c", says)
    assert done.returncode == 0, done.stderr
    places = [Path(line) for line in done.stdout.splitlines()]
    assert len(places) == len(PACKAGES)
    assert all(place.is_relative_to(programs.parent) for place in places)


@pytest.mark.parametrize("program", ["deeptruck", "deeptruck-cacc", "truck-bridge", "deeptruck-vehicle"])
def test_every_program_has_help(program: str, run: Call) -> None:
    done = run(program, "--help")
    assert done.returncode == 0 and not done.stderr
    assert done.stdout.startswith(f"Usage: {program} ")
