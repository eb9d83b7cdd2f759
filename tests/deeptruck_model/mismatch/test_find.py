"""The whole tool on small drives whose truth is known: named, sized, silent, or refused."""

from __future__ import annotations

import importlib.resources
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from deeptruck_model import mismatch, simulators, trucks
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
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


def sensed(r: Recording, seed: int, *, bias: float = 0.0) -> Recording:
    """What sensors at the truck would have recorded: an accelerometer of its own, J1939 steps of speed."""
    rng = np.random.default_rng(seed)
    channels = dict(r.channels)
    channels["speed"] = np.round(channels["speed"] * 3.6 * 256.0) / 256.0 / 3.6
    channels["acceleration"] = channels["acceleration"] + bias + rng.normal(0.0, 0.03, len(r))
    return replace(r, channels=channels)


def drives(
    truck: trucks.PhysicsTruck, count: int = 3, seconds: float = 240.0, seed: int = 0, **sensor: float
):
    return [
        sensed(driving_cycles.drive(truck, seconds=seconds, seed=seed + k), seed + k, **sensor)
        for k in range(count)
    ]


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
    recorded = drives(TRUCK.with_parameters({"mass": 1.2 * MASS}))
    said = run(recorded[:-1], recorded[-1:])
    assert said["verdict"] == "parameter_error" and effects(said) == ["mass"]
    mass = said["findings"][0]["parameters"]["mass"]
    assert mass["unit"] == "kg" and mass["value"] == pytest.approx(1.2 * MASS, rel=0.03)
    assert mass["ci95"][0] < mass["value"] < mass["ci95"][1] and np.diff(mass["ci95"]) < 0.1 * MASS
    assert said["fit"]["validated"] and said["fit"]["improvement_ci95"][0] > 0.5


@pytest.mark.long
def test_a_load_that_runs_out_on_the_way_is_named() -> None:
    said = run(drives(TRUCK.with_forces([Sprayed()]), 4), [])
    assert said["findings"][0]["effect"] == "payload_change"


@pytest.mark.long
def test_a_drag_area_that_changed_on_the_way_is_named() -> None:
    before, after = drives(TRUCK, 3), drives(TRUCK.with_forces([LargerDragArea()]), 4, seed=30)
    said = run([*before, *after[:3]], [after[3]])  # two drives of each gain 14 nats, too few for a name
    assert said["verdict"] == "missing_physics"
    (first, *_) = said["findings"]
    assert "drag_area" in (first["effect"], *first["credible_set"])
    where = {True: 0.0, False: 0.0}
    for s in said["segments"]:
        where[s["recording"] in {r.name for r in after}] += s["end_s"] - s["start_s"]
    assert where[True] > 4.0 * where[False]
    assert said["fit"]["after"]["speed_rmse"] < said["fit"]["before"]["speed_rmse"]


def test_a_biased_accelerometer_is_a_measurement_fault_and_nothing_else() -> None:
    recorded = drives(TRUCK, bias=0.15)
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


def still(r: Recording) -> Recording:
    """A drive of one speed, without an engine speed that would contradict it."""
    n = len(r)
    same = {"speed": np.full(n, 20.0), "acceleration": np.zeros(n), "brake_command": np.zeros(n)}
    others = {name: x for name, x in r.channels.items() if name != "engine_speed"}
    return replace(r, channels=others | same)


def test_a_constant_speed_is_undetermined_with_the_manoeuvre_to_drive() -> None:
    said = run([still(r) for r in drives(TRUCK, 2)])
    assert said["verdict"] == "undetermined" and said["findings"] == [] and said["fit"] == {}
    assert any("accelerate, brake and coast" in c for c in said["caveats"])


def test_too_little_driving_is_undetermined() -> None:
    said = run([r.piece(0, 300) for r in drives(TRUCK, 1)])
    assert said["verdict"] == "undetermined"
    assert any("s of usable driving" in c for c in said["caveats"])


def test_what_does_not_belong_together_is_refused_in_one_line() -> None:
    (r,) = drives(TRUCK, 1, 60.0)
    without = replace(r, channels={k: v for k, v in r.channels.items() if k != "engine_command"})
    other = replace(r, interface=TruckInterface("volvo", "N m", "m/s^2"))
    slow = replace(r, dt=1.0)
    for bad, says in (
        (without, "has no valid engine_command"),
        (other, "brake_command in m/s"),
        (slow, "1 Hz"),
    ):
        with pytest.raises(InputError, match=says) as caught:
            mismatch.find_mismatch(TRUCK, [bad])
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no recording"):
        mismatch.find_mismatch(TRUCK, [])


def test_a_set_aside_part_is_kept_from_the_fit() -> None:
    found = mismatch.find_mismatch(TRUCK, drives(TRUCK, 5, 60.0))
    assert found.evidence is not None
    held = [s.name for s in found.evidence.stretches if s.held_out]
    assert found.verdict["fit"]["held_out"] == held and len(held) == 2


def test_results_are_written_all_or_nothing(tmp_path: Path) -> None:
    found = mismatch.find_mismatch(TRUCK, [still(r) for r in drives(TRUCK, 2)])
    mismatch.write(found, tmp_path / "out")
    assert {"verdict.json", "report.html"} <= {p.name for p in (tmp_path / "out").iterdir()}
    with pytest.raises(InputError, match="add --overwrite"):
        mismatch.write(found, tmp_path / "out")
    mismatch.write(found, tmp_path / "out", overwrite=True)
    foreign = tmp_path / "thesis"
    foreign.mkdir()
    (foreign / "chapter.tex").write_text("years of work")
    with pytest.raises(InputError, match=r"holds chapter\.tex, which is no part"):
        mismatch.write(found, foreign, overwrite=True)
    assert (foreign / "chapter.tex").read_text() == "years of work"
    assert {p.name for p in tmp_path.iterdir()} == {"out", "thesis"}


KILLED = """
import sys, time
from pathlib import Path
from deeptruck_model.mismatch import output
from deeptruck_model.mismatch.report import page
from deeptruck_model.mismatch.result import Conclusion, Mismatch, Verdict
page.write = lambda *_: (print("writing", flush=True), time.sleep(60))
nothing = Mismatch(Verdict(Conclusion.UNDETERMINED), None, {}, None, ())
output.write(nothing, Path(sys.argv[1]))
"""


def test_a_killed_run_leaves_no_half_written_results(tmp_path: Path) -> None:
    argv = [sys.executable, "-c", KILLED, str(tmp_path / "out")]
    process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "writing\n"
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=240)
    assert not list((tmp_path / "out").iterdir())  # held by the run, and empty


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
    with pytest.raises(InputError, match=r"; run 'deeptruck-model mismatch --out .*' again$") as said:
        mismatch.apply(tmp_path, tmp_path / "sim")
    assert "train" not in str(said.value) and str(tmp_path / "simulator") in str(said.value)


def test_apply_leaves_nothing_behind_where_it_cannot_finish(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = tmp_path / "found"
    mismatch.CorrectedTruck(TRUCK, [], {"mass": 0.1}, None, True).save(found / "simulator")
    (found / "verdict.json").write_text('{"fit": {"validated": true}}')
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is no folder; choose another --out"):
        mismatch.apply(found, tmp_path / "file" / "sim")

    def full(source: Path, to: Path, **_: object) -> None:
        (to / "simulator.json").write_text("")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copytree", full)
    with pytest.raises(InputError, match="No space left on device; make room"):
        mismatch.apply(found, tmp_path / "sim")
    assert not (tmp_path / "sim").exists()


def test_apply_takes_over_what_was_validated_once(tmp_path: Path) -> None:
    found = tmp_path / "found"
    mismatch.CorrectedTruck(TRUCK, [], {"mass": 0.1}, None, True).save(found / "simulator")
    (found / "verdict.json").write_text('{"fit": {"validated": true}}')
    mismatch.apply(found, tmp_path / "sim")
    assert simulators.load(tmp_path / "sim").parameters()["mass"] == pytest.approx(1.1 * MASS)
    with pytest.raises(InputError, match="holds a corrected simulator already"):
        mismatch.apply(found, tmp_path / "sim")


def later(r: Recording, channel: str, by_s: float) -> Recording:
    """A recording of which one channel is stamped later."""
    x = r.channels[channel]
    n = round(by_s / r.dt)
    return replace(r, channels=r.channels | {channel: np.concatenate([np.full(n, x[0]), x[:-n]])})


@pytest.mark.parametrize("channel", ["speed", "acceleration"])
def test_a_late_sensor_is_a_measurement_fault_and_corrects_no_truck(channel: str) -> None:
    recorded = [later(r, channel, 0.6) for r in drives(TRUCK)]
    said = run(recorded[:-1], recorded[-1:])
    assert said["verdict"] == "measurement_fault" and effects(said) == ["clock_offset"]
    (late,) = said["findings"]
    assert late["says"].startswith(f"{channel} is stamped") and "later" in late["says"]
    assert abs(late["parameters"]["value"]["value"]) == pytest.approx(0.6, abs=0.06)
    assert said["advice"]["apply"]["answer"] == "no"
