"""The Dockerfile as far as its text goes: what it copies and installs exists. Nothing is built here."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
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
