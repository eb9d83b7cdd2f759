from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.deep import DeepTruck, io, resume
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.network import TruckNetwork


@pytest.fixture
def saved(truck, tmp_path):
    truck.save(tmp_path / "sim")
    return tmp_path / "sim"


def edit(folder, **changes):
    manifest = json.loads((folder / "simulator.json").read_text())
    (folder / "simulator.json").write_text(json.dumps({**manifest, **changes}))


def test_a_simulator_of_schema_1_loads(truck, tmp_path):
    """It has other names for the auxiliary targets, their number and weight, and inputs that never vary."""
    before = truck.network
    scales = Scales(*(np.append(x.numpy(), np.float32(2)) for x in (before.mean, before.scale)), 30.0)
    network = TruckNetwork(replace(before.shape, auxiliary=1), scales, truck.dt, (0, 1))
    details = {
        **truck.details,
        "auxiliary": ["gear"],
        "config": {**truck.details["config"], "auxiliary": 0.2},
        "training": {**truck.details["training"], "unexcited": ["grade never varies"]},
    }
    older, newer = tmp_path / "older", tmp_path / "newer"
    for folder in (older, newer):
        DeepTruck(network, truck.interface, details=details).save(folder)
    manifest = json.loads((older / "simulator.json").read_text())
    manifest["schema"] = 1
    manifest["taught"] = manifest.pop("auxiliary")
    manifest["shape"]["taught"] = manifest["shape"].pop("auxiliary")
    manifest["config"]["teach"] = manifest["config"].pop("auxiliary")
    manifest["training"]["untaught"] = manifest["training"].pop("unexcited")
    (older / "simulator.json").write_text(json.dumps(manifest))
    loaded = simulators.load(older)
    assert loaded.details == details and loaded.network.shape == network.shape
    drive = np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.ones((1, 5, 3))
    (given,) = loaded.auxiliary_outputs(*drive)
    assert given == "gear"
    assert resume.identity_in(older) == resume.identity_in(newer)  # --resume knows a finished run again


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda d: edit(d, schema=3), "schema 3"),
        (lambda d: edit(d, interface={"name": "x", "grade": False}), "does not fit"),
        (lambda d: edit(d, interface={"name": "x", "colour": "red"}), "not understood|damaged"),
        (lambda d: edit(d, scales={"mean": ["a"], "scale": [1]}), "damaged"),
        (
            lambda d: edit(d, shape={"controls": 2, "conditions": 1, "responses": 3, "hidden": 8}),
            "no 'input'",
        ),
        (lambda d: (d / "model.safetensors").unlink(), "missing or damaged"),
        (lambda d: (d / "model.safetensors").write_bytes(b"\0" * 40), "missing or damaged"),
        (
            lambda d: (d / "model.safetensors").write_bytes((d / "model.safetensors").read_bytes()[:-100]),
            "missing or damaged",
        ),
        (lambda d: (d / "coverage.json").write_text("{"), "coverage.json is damaged"),
        (lambda d: (d / "coverage.json").unlink(), "has lost coverage.json"),
        (lambda d: (d / "driven.safetensors").unlink(), "has lost driven.safetensors"),
        (lambda d: (d / "reference.safetensors").unlink(), "has lost reference.safetensors"),
    ],
)
def test_damage_is_one_clear_line(saved, damage, says):
    damage(saved)
    with pytest.raises(InputError, match=says) as error:
        simulators.load(saved)
    assert "\n" not in str(error.value)


def test_what_an_older_simulator_never_had_is_not_missed(saved):
    manifest = json.loads((saved / "simulator.json").read_text())
    del manifest["files"]
    (saved / "simulator.json").write_text(json.dumps(manifest))
    for name in ("driven.safetensors", "reference.safetensors", "metrics.json"):
        (saved / name).unlink(missing_ok=True)
    older = simulators.load(saved)
    assert older.driven is None and older.reference == ()
    (saved / "coverage.json").unlink()  # whatever was trained had that one
    with pytest.raises(InputError, match=r"has lost coverage\.json"):
        simulators.load(saved)


@pytest.mark.parametrize("name", ["model.safetensors", "driven.safetensors", "reference.safetensors"])
def test_a_changed_number_is_no_other_number(saved, name):
    content = bytearray((saved / name).read_bytes())
    content[-2] ^= 1
    (saved / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name} is damaged .* another SHA-256; train or save"):
        simulators.load(saved)
    manifest = json.loads((saved / "simulator.json").read_text())
    del manifest["sha256"]  # as an earlier version saved it
    (saved / "simulator.json").write_text(json.dumps(manifest))
    assert simulators.load(saved)


def test_recordings_come_back(drive, tmp_path):
    kept = drive(60)
    io.save_reference([kept], tmp_path)
    (again,) = io.load_reference(tmp_path)
    assert (again.name, again.dt, again.interface) == (kept.name, kept.dt, kept.interface)
    assert set(again.channels) == set(kept.channels)
    np.testing.assert_allclose(again.channels["speed"], kept.channels["speed"], atol=1e-4)


def test_no_more_than_an_hour_is_kept(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(io, "MOST_S", 30.0)
    io.save_reference([drive(20), drive(20), drive(20)], tmp_path)
    assert sum(len(r) * r.dt for r in io.load_reference(tmp_path)) == pytest.approx(30.0, abs=0.2)


def test_channels_of_a_users_own_are_not_kept(drive, tmp_path):
    kept = drive(60)
    own = replace(kept, channels=kept.channels | {"oil_temperature": np.full(len(kept), 90.0)})
    io.save_reference([own], tmp_path)
    (again,) = io.load_reference(tmp_path)
    assert set(again.channels) == set(kept.channels)
