"""What a package owes its users: bounds, public names that exist, and one set of checks wherever they run."""

from __future__ import annotations

import importlib
import re
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


# The set-up of `make`, with a pip that installs nothing


MISSING = "WARNING: Location 'file:///packages/torch/' is ignored: it is neither a file nor a directory."
OTHER = "WARNING: Retrying after connection broken"
PYTHON = """#!/bin/sh
[ "$1" = -c ] && exit 0
mkdir -p "$3/bin"
printf '#!/bin/sh\\ncat {said} >&2\\nprintf "%%s " "$@" > {asked}\\nexit {code}\\n' > "$3/bin/pip"
chmod +x "$3/bin/pip"
"""


@pytest.mark.parametrize("code", [0, 1])
def test_only_what_does_not_matter_is_hidden(tmp_path: Path, code: int) -> None:
    (tmp_path / "said").write_text(f"{MISSING}\n{OTHER}\nERROR: No matching distribution\n")
    python = tmp_path / "python"
    python.write_text(PYTHON.format(said=tmp_path / "said", asked=tmp_path / "asked", code=code))
    python.chmod(0o755)
    command = ["make", "-s", "setup", f"PYTHON={python}", f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=240)
    assert (done.returncode == 0) == (code == 0)
    assert OTHER in done.stderr and "ERROR: No matching distribution" in done.stderr
    assert MISSING not in done.stderr
    assert (tmp_path / "venv" / ".installed").exists() == (code == 0)
    assert "-c constraints.txt -e .[ros,dev]" in (tmp_path / "asked").read_text()
