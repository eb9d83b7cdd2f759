"""The whole tool on small drives whose truth is known: named, sized, silent, or refused."""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from small_drives import TRUCK, drives, sensed

from deeptruck_core.errors import InputError
from deeptruck_model import mismatch, trucks
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

MASS = TRUCK.parameters()["mass"]
SCHEMA = json.loads(importlib.resources.files(mismatch).joinpath("verdict.schema.json").read_text())


class LargerDragArea:
    """A body with 2.5 m^2 more drag area."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return -0.5 * 1.225 * 2.5 * view.speed**2


class Sprayed:
    """A third of the mass runs out while the truck drives; every drive begins full."""

    def reset(self, batch: int) -> None:
        self.left = np.full(batch, 0.15)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        self.left = np.maximum(self.left - dt * (view.speed > 1.0) * 0.3 / 200.0, -0.15)
        return -self.left * view.mass * (view.acceleration + 9.81 * (view.grade + 0.006)) * (view.speed > 0.3)


def verdict(found: mismatch.Mismatch) -> dict[str, Any]:
    """The verdict as a program reads it; every one of them must keep to the schema."""
    plain: dict[str, Any] = json.loads(json.dumps(found.verdict, allow_nan=False))
    jsonschema.validate(plain, SCHEMA)
    return plain


def effects(said: dict[str, Any]) -> list[str]:
    return [f["effect"] for f in said["findings"]]


def run(recordings: Sequence[Recording], held_out: Sequence[Recording] = ()) -> dict[str, Any]:
    return verdict(mismatch.find_mismatch(TRUCK, recordings, held_out))


@pytest.mark.long  # test_cli.py has such a mass, from bags to the corrected truck
def test_a_wrong_mass_is_a_parameter_error_of_the_right_size() -> None:
    recorded = drives(TRUCK.with_parameters({"mass": 1.2 * MASS}), 3, 240.0)
    said = run(recorded[:-1], recorded[-1:])
    assert said["verdict"] == "parameter_error" and effects(said) == ["mass"]
    mass = said["findings"][0]["parameters"]["mass"]
    assert mass["unit"] == "kg" and mass["value"] == pytest.approx(1.2 * MASS, rel=0.03)
    assert mass["ci95"][0] < mass["value"] < mass["ci95"][1] and np.diff(mass["ci95"]) < 0.1 * MASS
    assert said["fit"]["validated"] and said["fit"]["improvement_ci95"][0] > 0.5


@pytest.mark.long
def test_loads_that_differ_between_drives_are_given_as_masses_to_set() -> None:
    recorded = []
    for k, share in enumerate((0.8, 1.0, 1.3, 1.15)):
        drive = driving_cycles.drive(TRUCK.with_parameters({"mass": share * MASS}), seconds=180.0, seed=k)
        recorded.append(replace(sensed(drive, k), name="abcd"[k]))
    first = run(recorded[:-1], recorded[-1:])["findings"][0]
    assert first["effect"] == "payload_change"
    masses = {"a": 0.8 * MASS, "b": MASS, "c": 1.3 * MASS}
    assert first["mass_by_drive"] == pytest.approx(masses, rel=0.03)


@pytest.mark.long
def test_a_load_that_runs_out_on_the_way_is_named() -> None:
    said = run(drives(TRUCK.with_forces([Sprayed()]), 4, 240.0), [])
    assert said["findings"][0]["effect"] == "payload_change"


@pytest.mark.long
def test_a_drag_area_that_changed_on_the_way_is_named() -> None:
    before = drives(TRUCK, 3, 240.0)
    after = drives(TRUCK.with_forces([LargerDragArea()]), 4, 240.0, seed=30)
    said = run([*before, *after[:3]], [after[3]])  # two drives of each gain 14 nats, too few for a name
    assert said["verdict"] == "missing_physics"
    (first, *_) = said["findings"]
    assert "drag_area" in (first["effect"], *first["credible_set"])
    where = {True: 0.0, False: 0.0}
    for s in said["segments"]:
        where[s["recording"] in {r.name for r in after}] += s["end_s"] - s["start_s"]
    assert where[True] > 4.0 * where[False]
    assert said["fit"]["after"]["speed_rmse"] < said["fit"]["before"]["speed_rmse"]


@pytest.mark.long  # a fault and no name, as for the late sensor below; test_data_checks.py finds each fault
def test_a_biased_accelerometer_is_a_measurement_fault_and_nothing_else() -> None:
    recorded = drives(TRUCK, 3, 240.0, bias=0.15)
    said = run(recorded[:-1], recorded[-1:])
    assert said["verdict"] == "measurement_fault" and effects(said) == ["acceleration_bias"]
    assert said["findings"][0]["parameters"]["value"]["value"] == pytest.approx(0.15, abs=0.02)


def test_one_recording_with_holes_says_what_it_cannot_claim() -> None:
    (recorded,) = drives(TRUCK.with_parameters({"mass": 1.2 * MASS}), 1, 600.0, seed=70)
    rng = np.random.default_rng(0)
    for name in ("speed", "acceleration", "engine_command", "grade"):
        for at in rng.integers(0, len(recorded) - 60, 6):
            recorded.channels[name][at : at + rng.integers(5, 60)] = np.nan
    said = run([recorded])
    assert "mass" in effects(said)
    assert any("one of each was set aside" in c or "set aside" in c for c in said["caveats"])
    rejected = {r["rule"]: r["samples"] for r in said["data"]["rejected"]}
    assert rejected["grade missing or invalid"] > 20


@pytest.mark.parametrize(
    ("mass_kg", "says"),
    [(-1.0, "no vehicle's"), (float("nan"), "must be a number in kg"), (900.0, "own mass is")],
)
def test_a_mass_that_cannot_be_is_refused(mass_kg: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mismatch.find_mismatch(TRUCK, [], mass_kg=mass_kg)


def test_what_was_compared_before_a_failure_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError("of a simulator of somebody else")

    monkeypatch.setattr("deeptruck_model.mismatch.find.correct", fails)
    said = run(drives(TRUCK.with_parameters({"mass": 1.2 * MASS}), 3))
    assert said["budget"]["parts"] and said["fit"]["offered"] == "as_given"
    assert any("nothing was corrected: ZeroDivisionError" in c for c in said["caveats"])


def still(r: Recording) -> Recording:
    """A drive of one speed, without an engine speed that would contradict it."""
    n = len(r)
    same = {"speed": np.full(n, 20.0), "acceleration": np.zeros(n), "brake_command": np.zeros(n)}
    others = {name: x for name, x in r.channels.items() if name != "engine_speed"}
    return replace(r, channels=others | same)


def test_a_constant_speed_is_undetermined_with_the_manoeuvre_to_drive() -> None:
    said = run([still(r) for r in drives(TRUCK, 2, 240.0)])
    assert said["verdict"] == "undetermined" and said["findings"] == [] and said["fit"] == {}
    assert any("accelerate, brake and coast" in c for c in said["caveats"])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "holds no readable verdict.json"),
        ("{", "holds no readable verdict.json"),
        ("{}", "verdict.json is damaged; run 'deeptruck-model mismatch"),
        ("[1]", "verdict.json is damaged; run 'deeptruck-model mismatch"),
        ('{"fit": {}}', "has no passed validation"),
        ('{"fit": {"validated": false}}', "has no passed validation"),
    ],
)
def test_apply_refuses_without_a_passed_validation(tmp_path: Path, content: str | None, says: str) -> None:
    found = tmp_path / "found"
    found.mkdir()
    if content is not None:
        (found / "verdict.json").write_text(content)
    with pytest.raises(InputError, match=says):
        mismatch.apply(found, tmp_path / "sim")
    assert not (tmp_path / "sim").exists()


@pytest.mark.parametrize("manifest", [None, ""])
def test_a_corrected_simulator_that_lost_a_file_is_found_anew(tmp_path: Path, manifest: str | None) -> None:
    """Training, which a simulator directory states to come from elsewhere, would not repair it."""
    (tmp_path / "simulator").mkdir()
    (tmp_path / "verdict.json").write_text('{"fit": {"validated": true}}')
    if manifest is not None:
        (tmp_path / "simulator" / "simulator.json").write_text(manifest)
    with pytest.raises(InputError, match=r"; run 'deeptruck-model mismatch' again$") as said:
        mismatch.apply(tmp_path, tmp_path / "sim")
    assert "train" not in str(said.value) and str(tmp_path / "simulator") in str(said.value)


def later(r: Recording, channel: str, by_s: float) -> Recording:
    """A recording of which one channel is stamped later."""
    x = r.channels[channel]
    n = round(by_s / r.dt)
    return replace(r, channels=r.channels | {channel: np.concatenate([np.full(n, x[0]), x[:-n]])})


def test_a_late_sensor_is_a_measurement_fault_and_corrects_no_truck() -> None:
    recorded = [later(r, "acceleration", 0.6) for r in drives(TRUCK, 3, 240.0)]
    said = run(recorded[:-1], recorded[-1:])
    assert said["verdict"] == "measurement_fault" and effects(said) == ["clock_offset"]
    (late,) = said["findings"]
    assert late["says"].startswith("acceleration is stamped") and "later" in late["says"]
    assert abs(late["parameters"]["value"]["value"]) == pytest.approx(0.6, abs=0.06)
    assert said["advice"]["apply"]["answer"] == "no"


TRUCK = trucks.load("trucksim")


class Broken:
    """What a wrong unit inside a model makes of it: it stops from any speed within a second."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.asarray(-30.0 * view.mass * (view.speed > 3.0))


def test_a_simulator_that_answers_what_no_vehicle_does_is_refused() -> None:
    broken = TRUCK.with_forces([Broken()])
    with pytest.raises(InputError, match=r"more than 12 m/s\^2 in \d+ % of samples"):
        find_mismatch(broken, [driving_cycles.drive(TRUCK, seconds=120.0, seed=k) for k in range(2)])
