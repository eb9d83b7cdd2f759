"""Wrong calls of the public functions: each is one line that says what to give."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import calls, evaluate, find_mismatch, load, mismatch, read, recordings, train, trucks
from deeptruck_model.mismatch import Span
from deeptruck_model.mismatch.find import called
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.trucks import driving_cycles

TRUCK: Any = trucks.load("trucksim")
Call = Callable[[Any], Any]  # of recordings


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the bags `one` and `two`."""
    folder = tmp_path_factory.mktemp("drives")
    for seed, name in enumerate(("one", "two")):
        drive = driving_cycles.drive(TRUCK, seconds=70.0, seed=seed, name=name)
        recordings.write_bag(folder / name, [drive], interface=drive.interface)
    return folder


DID_YOU_MEAN = "there is no effect 'heawind' to leave out; did you mean headwind?"
WRONG: dict[str, tuple[Call, str]] = {
    "load: None": (lambda r: load(None), "a simulator must be a path"),
    "load: number": (lambda r: load(3), "a simulator must be a path"),
    "read: None": (lambda r: read(None), "a bag must be a path"),
    "read: list": (lambda r: read(["one"]), "a bag must be a path"),
    "read: rate as text": (lambda r: read("one", rate_hz="10"), "rate_hz must be a number in Hz"),
    "read: interface as text": (lambda r: read("one", interface="N m"), "interface must be"),
    "read: clock": (lambda r: read("one", clock="sun"), "clock must be 'stamp' or 'log'"),
    "read: topic map": (lambda r: read("one", topic_map=3), "topic_map must be"),
    "find: no such bag": (lambda r: find_mismatch(TRUCK, "nowhere"), "nowhere does not exist"),
    "find: nothing": (lambda r: find_mismatch(TRUCK, []), "there is no recording"),
    "find: None": (lambda r: find_mismatch(TRUCK, None), "recordings must be"),
    "find: number": (lambda r: find_mismatch(TRUCK, 3), "recordings must be"),
    "find: array": (lambda r: find_mismatch(TRUCK, np.zeros((3, 2))), "recordings must be"),
    "find: numbers": (lambda r: find_mismatch(TRUCK, [1, 2]), "recordings must be"),
    "find: class": (lambda r: find_mismatch(trucks.PhysicsTruck, r), "is a class"),
    "find: an uncalled factory": (
        lambda r: find_mismatch(lambda: TRUCK, r),
        "is a function; give the simulator that it returns",
    ),
    "find: swapped": (lambda r: find_mismatch(r, TRUCK), "is no simulator"),
    "find: no truck": (lambda r: find_mismatch("truck:foo", r), "there is no truck 'foo'"),
    "find: seed as text": (lambda r: find_mismatch(TRUCK, r, seed="a"), "seed must be"),
    "find: negative seed": (lambda r: find_mismatch(TRUCK, r, seed=-1), "seed must be"),
    "find: exclude": (lambda r: find_mismatch(TRUCK, r, exclude="brake_fade"), "exclude must be a list"),
    "find: no effect": (lambda r: find_mismatch(TRUCK, r, exclude=["heawind"]), DID_YOU_MEAN),
    "find: tuple": (lambda r: find_mismatch(TRUCK, r, without=[("one", 1, 2)]), "without must be"),
    "find: no rows": (lambda r: find_mismatch(TRUCK, r, without=[Span("x", 1, 2)]), "no recording 'x'"),
    "find: mass": (lambda r: find_mismatch(TRUCK, r, mass_kg="28 t"), "mass_kg must be"),
    "find: rules": (lambda r: find_mismatch(TRUCK, r, rules={}), "rules must be"),
    "find: say": (lambda r: find_mismatch(TRUCK, r, say="x"), "say must be"),
    "find: held out": (lambda r: find_mismatch(TRUCK, r, "nowhere"), "nowhere does not exist"),
    "find: judges itself": (lambda r: find_mismatch(TRUCK, r, r), "'one' is to be fitted and held out"),
    "find: one bag twice": (
        lambda r: find_mismatch(TRUCK, "one", ["./one"]),
        "among the recordings and held",
    ),
    "import: number": (lambda r: recordings.import_table(3, {}, "out"), "a table must be a path"),
    "import: columns": (lambda r: recordings.import_table("one", 3, "out"), "columns must be a mapping"),
    "suggest: number": (lambda r: recordings.suggest(3), "a bag must be a path"),
    "train: number": (lambda r: train(3, "out"), "recordings must be"),
    "train: no bag": (lambda r: train(["nowhere"], "out"), "nowhere does not exist"),
    "train: out": (lambda r: train(r, None), "out must be a path"),
    "train: arguments": (lambda r: train(r, "out", {"hidden": 3}), "arguments must be"),
    "evaluate: numbers": (lambda r: evaluate(TRUCK, [1], "out"), "recordings must be"),
    "evaluate: None": (lambda r: evaluate(None, r, "out"), "is no simulator"),
    "evaluate: out": (lambda r: evaluate(TRUCK, r, None), "out must be a path"),
    "evaluate: no run": (lambda r: evaluate(TRUCK, r, "out", count=0), "count must be"),
    "evaluate: count": (lambda r: evaluate(TRUCK, r, "out", count="many"), "count must be"),
    "evaluate: seed": (lambda r: evaluate(TRUCK, r, "out", seed=-1), "seed must be"),
    "mismatch.read": (lambda r: mismatch.read(None), "the folder must be a path"),
    "mismatch.apply": (lambda r: mismatch.apply(None, "out"), "the folder must be a path"),
    "mismatch.summary": (lambda r: mismatch.summary(None), "find_mismatch or mismatch.read returns"),
    "trucks.load": (lambda r: trucks.load(None), "a truck must be a path"),
    "with_parameters": (lambda r: TRUCK.with_parameters(["mass"]), "given by name"),
    "with_dt": (lambda r: TRUCK.with_dt("a"), "dt must be a number in s"),
    "drive: text": (lambda r: driving_cycles.drive("trucksim", seconds=9.0, seed=1), "truck must be"),
    "drive: seconds": (lambda r: driving_cycles.drive(TRUCK, seconds="9", seed=1), "seconds must be"),
    "write_bag: one": (lambda r: recordings.write_bag("out", r[0], interface=r[0].interface), "a list of"),
    "write_bag: interface": (lambda r: recordings.write_bag("out", r, interface=None), "interface must be"),
    "split": (lambda r: recordings.split(r, 3.0), "split fractions must be"),
    "coverage": (lambda r: recordings.coverage(3), "recordings must be"),
    "read_all": (lambda r: recordings.read_all("one"), "bags must be a list"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_call_is_one_line(name: str, drives: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(drives)
    call, says = WRONG[name]
    begun = time.process_time()
    with pytest.raises(InputError) as error:
        call(read("one"))
    assert says in str(error.value) and "\n" not in str(error.value)
    assert time.process_time() - begun < 5.0  # no computation came before
    assert {path.name for path in drives.iterdir()} == {"one", "two"}  # nothing was written


def test_a_drive_that_judges_itself_is_found_under_another_name(drives: Path) -> None:
    (one,) = read(drives / "one")
    with pytest.raises(InputError, match="'copy' is the drive 'one', which is to be fitted and held out"):
        find_mismatch(TRUCK, [one], [replace(one, name="copy")])


def test_bags_and_simulators_may_be_named(drives: Path) -> None:
    """What find_mismatch makes of them, before it computes anything."""
    rest = {"seed": 0, "exclude": (), "without": (), "say": print, "rules": Rules(), "mass_kg": None}
    by_name = called("truck:trucksim", drives / "one", [drives / "two"], **rest)
    given = called(TRUCK, read(drives / "one"), read(drives / "two"), **rest)
    assert by_name[0].parameters() == given[0].parameters()
    for named, known in zip(by_name[1:], given[1:], strict=True):
        assert len(named) == 1 and recordings.data_hash(named) == recordings.data_hash(known)
    assert {r.name for r in recordings.read_all([drives / "one"])} == {"one"}


@pytest.mark.parametrize("mass_kg", [-1.0, 0.0, float("nan"), float("inf")])
def test_a_mass_that_cannot_be_is_refused_at_once(mass_kg: float) -> None:
    calls.mass(None)
    calls.mass(900.0)
    with pytest.raises(InputError, match="state what the truck weighs"):
        calls.mass(mass_kg)
    with pytest.raises(InputError, match="if 28 t were meant, give 28000"):
        calls.mass(28.0)
