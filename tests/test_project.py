"""What a package owes its users: bounds, public names that exist, and one set of checks wherever they run."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PUBLIC = (ROOT / "docs" / "public.md").read_text()
PACKAGES = ("deeptruck_model", "deeptruck_cacc", "truck_bridge")
ROOMS = re.findall(r"`((?:deeptruck_model|deeptruck_cacc|truck_bridge)\.[a-z_0-9]+)`", PUBLIC)
WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
TARGET = re.compile(r"make ([\w-]+)")


def requirements() -> list[Requirement]:
    listed = [*PROJECT["dependencies"], *(r for of in PROJECT["optional-dependencies"].values() for r in of)]
    return [one for one in map(Requirement, listed) if one.name not in ("deeptruck", "deeptruck-exam")]


@pytest.mark.parametrize("requirement", requirements(), ids=str)
def test_every_dependency_has_a_lower_bound_and_a_pin_above_it(requirement: Requirement) -> None:
    assert ">=" in {bound.operator for bound in requirement.specifier}
    name = re.sub(r"[-_.]+", "-", requirement.name.lower())
    lines = [line.lower() for line in (ROOT / "constraints.txt").read_text().splitlines()]
    pinned = [v for n, _, v in (line.partition("==") for line in lines) if re.sub(r"[-_.]+", "-", n) == name]
    assert len(pinned) == 1
    assert requirement.specifier.contains(pinned[0].partition(" ")[0].partition(";")[0])


@pytest.mark.parametrize("package", [*PACKAGES, *ROOMS])
def test_public_names_exist(package: str) -> None:
    module = importlib.import_module(package)
    for name in module.__all__:
        assert getattr(module, name) is not None
    assert not hasattr(module, "no_such_name")


def test_the_public_page_names_the_programs_and_the_entry_points() -> None:
    programs, groups = PROJECT["scripts"], PROJECT["entry-points"]
    assert not {name for name in programs if f"`{name}`" not in PUBLIC}
    named = set(re.findall(r"`(deeptruck\.\w+)`", PUBLIC))
    assert named and named <= set(groups)


def test_the_workflow_calls_the_targets_of_the_checks_before_a_merge() -> None:
    jobs = WORKFLOW["jobs"]
    called = {job: TARGET.findall(" ".join(s.get("run", "") for s in jobs[job]["steps"])) for job in jobs}
    assert all(len(targets) == 1 for targets in called.values())
    known = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))
    targets = {target for of_job in called.values() for target in of_job}
    before = set(TARGET.findall(re.sub(r"^#.*", "", (ROOT / ".ci" / "run").read_text(), flags=re.M)))
    assert before <= targets <= known
    versions = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if ":: Python :: " in c]
    assert jobs["tests"]["strategy"]["matrix"]["python"] == versions


# The Dockerfile as far as its text goes: what it copies and installs exists. Nothing is built here


TEXT = (ROOT / "Dockerfile").read_text().replace("\\\n", " ")
STEPS = [line.partition(" ")[::2] for line in TEXT.splitlines() if line and line[0] != "#"]


def of(kind: str) -> list[str]:
    return [rest for step, rest in STEPS if step == kind]


def test_it_stands_on_ros_jazzy() -> None:
    assert STEPS[0] == ("FROM", "ros:jazzy")
    assert {step for step, _ in STEPS} <= {"FROM", "RUN", "ENV", "WORKDIR", "COPY", "ARG", "CMD"}


def test_what_it_copies_is_there_and_all_that_a_build_reads() -> None:
    copied = {source: rest.split()[-1] for rest in of("COPY") for source in rest.split()[:-1]}
    assert all((ROOT / source).exists() for source in copied)
    assert all(target in ("./", source) for source, target in copied.items())  # pyproject names the folders
    needed = {"pyproject.toml", "constraints.txt", PROJECT["readme"], PROJECT["license-files"][0]}
    assert needed | {"src", "exam", "ros2_ws/src"} == set(copied)


def test_what_it_installs_has_these_extras_and_no_second_ros() -> None:
    (extras,) = re.findall(r'"\.\[([\w,]+)\]"', " ".join(of("RUN")))
    named = set(extras.split(","))
    assert "all" in named and named <= set(PROJECT["optional-dependencies"])
    assert "ros" not in named  # its wheels would stand beside the image's own


def test_what_it_starts_is_a_program_of_ours() -> None:
    (words,) = map(json.loads, of("CMD"))
    comment = next(line for line in TEXT.splitlines() if "docker run" in line)
    shown = shlex.split(comment.partition(" deeptruck ")[2])
    assert {words[0], shown[0]} <= set(PROJECT["scripts"])


# The set-up of `make`, with a pip that installs nothing


MISSING = "WARNING: Location 'file:///packages/torch/' is ignored: it is neither a file nor a directory."
OTHER = "WARNING: Retrying after connection broken"
TOLD = """Collecting torch==2.4
  Downloading https://host/whl/torch-2.4-cp312-cp312-linux_x86_64.whl (797.1 MB)
Using cached numpy-2.1.0-cp312.whl (16.4 MB)
  Downloading idna-3.10-py3-none-any.whl (70 kB)
Installing collected packages: idna, numpy, torch
Successfully installed idna-3.10
"""
PYTHON = """#!/bin/sh
[ "$1" = -c ] && exit 0
mkdir -p "$3/bin"
printf '#!/bin/sh\\ncat {said} >&2; cat {told}\\nprintf "%%s " "$@" > {asked}\\nexit {code}\\n' > "$3/bin/pip"
chmod +x "$3/bin/pip"
"""


def setup(folder: Path, code: int, *said: str) -> subprocess.CompletedProcess[str]:
    (folder / "said").write_text("".join(f"{line}\n" for line in said))
    python = folder / "python"
    (folder / "told").write_text(TOLD)
    python.write_text(
        PYTHON.format(said=folder / "said", told=folder / "told", asked=folder / "asked", code=code)
    )
    python.chmod(0o755)
    command = ["make", "-s", "setup", f"PYTHON={python}", f"VENV={folder / 'venv'}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=240)


@pytest.mark.parametrize("code", [0, 1])
def test_only_what_does_not_matter_is_hidden(tmp_path: Path, code: int) -> None:
    done = setup(tmp_path, code, MISSING, OTHER, "ERROR: No matching distribution")
    assert (done.returncode == 0) == (code == 0)
    assert OTHER in done.stderr and "ERROR: No matching distribution" in done.stderr
    assert MISSING not in done.stderr
    assert (tmp_path / "venv" / ".installed").exists() == (code == 0)
    assert "-c constraints.txt -e .[ros,dev]" in (tmp_path / "asked").read_text()


def test_a_quiet_pip_is_no_failure(tmp_path: Path) -> None:
    assert setup(tmp_path, 0).returncode == 0


def test_what_takes_long_is_told_while_it_does(tmp_path: Path) -> None:
    told = setup(tmp_path, 0).stdout.splitlines()
    assert told[0].startswith("setting up")
    assert told[1:3] == ["  torch, 797.1 MB", "  numpy, 16.4 MB"]
    assert "unpacking" in told[3] and len(told) == 4


def test_the_site_is_built_with_warnings_as_errors(tmp_path: Path) -> None:
    setup(tmp_path, 0)
    python = tmp_path / "venv" / "bin" / "python"
    python.write_text('#!/bin/sh\necho "$@"\n')
    python.chmod(0o755)
    command = ["make", "-s", "docs", f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=240)
    assert done.stdout.splitlines()[-1] == "-m sphinx -q -W --keep-going -b html docs build/docs"
    assert "-c constraints.txt -e .[docs]" in (tmp_path / "asked").read_text()
