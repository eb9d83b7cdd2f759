"""The console script on real bags: files, exit codes, one clear line for bad input."""

from __future__ import annotations

import html
import importlib.resources
import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from deeptruck_model import cli, mismatch, simulators, trucks
from deeptruck_model.mismatch.report.lines import lines as summary_of
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

SCRIPT = Path(sys.executable).with_name("deeptruck-model")
TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]
SCHEMA = json.loads(importlib.resources.files(mismatch).joinpath("verdict.schema.json").read_text())


def call(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(SCRIPT), *map(str, arguments)], capture_output=True, text=True, timeout=250, check=False
    )


def bag(folder: Path, name: str, seed: int, seconds: float = 180.0) -> Path:
    """A bag of a heavier truck without a fuel rate."""
    heavy = TRUCK.with_parameters({"mass": 1.25 * MASS})
    recording = driving_cycles.drive(heavy, seconds=seconds, seed=seed)
    channels = {name: x for name, x in recording.channels.items() if name != "fuel_rate"}
    recording = replace(recording, channels=channels, interface=replace(recording.interface, fuel=False))
    rng = np.random.default_rng(seed)
    recording.channels["speed"] += rng.normal(0.0, 0.002, len(recording))
    return write_bag(folder / name, [recording], interface=recording.interface)


def test_from_bags_to_a_corrected_simulator(tmp_path: Path) -> None:
    bags = [bag(tmp_path, name, seed) for seed, name in enumerate("abcd")]
    out = tmp_path / "found"
    given = ("--simulator", "truck:trucksim", "--recordings", *bags[:3], "--held-out", bags[3])
    done = call("mismatch", *given, "--out", out)
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert " s: correcting the simulator and driving it free\n" in done.stderr  # a log shows how far it is
    said = json.loads((out / "verdict.json").read_text())
    jsonschema.validate(said, SCHEMA)
    assert said["fit"]["held_out"] == ["d"] and said["fit"]["validated"]
    assert {"verdict.json", "report.html", "profiles.csv", "simulator"} <= {p.name for p in out.iterdir()}
    page = html.unescape((out / "report.html").read_text())
    sentences = summary_of(mismatch.read(out))
    assert done.stdout.splitlines()[: 1 + len(sentences)] == [*sentences, f"report: {out / 'report.html'}"]
    text = re.sub(r"<[^>]+>", "", page)
    assert [s for s in sentences if s.rstrip(".") not in text] == []
    command = f"deeptruck-model apply {out} --out {out}_corrected"
    assert command in page and command in done.stdout
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]
    applied = call("apply", out, "--out", tmp_path / "better")
    assert applied.returncode == 0
    corrected = simulators.load(tmp_path / "better")
    assert corrected.parameters()["mass"] == pytest.approx(1.25 * MASS, rel=0.03)
    again = call("apply", out, "--out", tmp_path / "better")
    assert again.returncode == 2 and "holds a corrected simulator already" in again.stderr


def test_too_little_is_a_verdict_and_nothing_to_apply(
    script: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    short, out = bag(tmp_path, "short", 9, 20.0), tmp_path / "found"
    code, said, _ = script("mismatch", "--simulator", "truck:trucksim", "--recordings", short, "--out", out)
    assert code == 0 and said.startswith("Undetermined")
    verdict = json.loads((out / "verdict.json").read_text())
    jsonschema.validate(verdict, SCHEMA)
    assert verdict["verdict"] == "undetermined" and "s of usable driving" in verdict["caveats"][-1]
    code, _, errors = script("apply", out, "--out", tmp_path / "sim")
    assert code == 2 and "no passed validation" in errors and not (tmp_path / "sim").exists()
    again = ("mismatch", "--simulator", "truck:trucksim", "--recordings", short, "--out", out)
    assert script(*again)[0] == 2 and script(*again, "--overwrite")[0] == 0


@pytest.mark.parametrize("inside", ["", "sub"])
def test_a_file_is_no_folder_and_is_said_to_be_none_before_long_computing(
    script: Callable[..., tuple[int, str, str]], tmp_path: Path, inside: str
) -> None:
    file = tmp_path / "file"
    file.write_text("notes")
    (tmp_path / "no_bag").mkdir()
    recordings = ("--recordings", tmp_path / "no_bag", "--out", file / inside)
    code, said, errors = script("mismatch", "--simulator", "truck:trucksim", *recordings)
    assert code == 2 and str(file) in errors and "choose another --out" in errors and not said
    assert file.read_text() == "notes" and "Traceback" not in errors


@pytest.mark.parametrize("command", ["mismatch", "apply", "prove"])
def test_every_command_has_an_example(script: Callable[..., tuple[int, str, str]], command: str) -> None:
    code, said, _ = script(command, "--help")
    assert code == 0 and f"Example: deeptruck-model {command} " in said


@pytest.mark.parametrize(("option", "value"), [("jobs", 0), ("seed", -4), ("cases", 0), ("cases", -3)])
def test_an_examination_of_nothing_is_refused(
    script: Callable[..., tuple[int, str, str]], tmp_path: Path, option: str, value: int
) -> None:
    code, said, errors = script("prove", "--out", tmp_path / "proof", f"--{option}", value)
    assert code == 2 and f"'--{option}': Input should be greater than or equal to" in errors
    assert errors.count("\n") == 1 and not said and not (tmp_path / "proof").exists()


@pytest.mark.parametrize(
    ("simulator", "words", "says"),
    [
        ("truck:no_such", "--recordings short --out found", "no_such"),
        ("nowhere", "--recordings short --out found", "nowhere does not exist; give a simulator directory"),
        ("truck:volvo", "--recordings short --out found", "engine_command in N m, the simulator in percent"),
        ("truck:trucksim", "--recordings nowhere --out found", "nowhere"),
        ("truck:trucksim", "--recordings=short nowhere --out found", "nowhere does not exist"),
        ("truck:trucksim", "--recordings short --out found nowhere", "extra argument(s) (nowhere)"),
        ("truck:trucksim", "--recordings short --held-out --out found", "--held-out is empty"),
        ("truck:trucksim", "--recordings --out found", "--recordings is empty"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_exit_code_2(
    script: Callable[..., tuple[int, str, str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    simulator: str,
    words: str,
    says: str,
) -> None:
    bag(tmp_path, "short", 9, 20.0)
    monkeypatch.chdir(tmp_path)
    code, said, errors = script("mismatch", "--simulator", simulator, *words.split())
    assert code == 2 and says in errors and errors.strip().count("\n") == 0
    assert not said and not (tmp_path / "found").exists()


def test_a_list_is_spread_however_it_is_written() -> None:
    both = ["--recordings=a", "--recordings=b", "--out", "x"]
    assert cli.spread(["--recordings", "a", "b", "--out", "x"]) == both
    assert cli.spread(["--recordings=a", "b", "--out", "x"]) == both
    assert cli.spread(["--recordings", "a", "--recordings", "b", "--out", "x"]) == both
