"""The exact force of every effect, pinned: along a made-up drive its rms and a weighted mean are those of
forces.csv, which was computed from the laws as each family had them, in other code than today's."""

import csv
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.effects.law import Setting
from deeptruck_exam.effects.planting import SEALED
from deeptruck_exam.worlds import trucks

STEP_S, STEPS, BATCH = 0.05, 900, 3
PHASE = np.array([0.0, 2.1, 4.4])
HEAR_A_CHANGE = ("w_hears_the_leader",)  # laws that do nothing behind a leader who keeps his pace
OTHER_SEEDS = {"x_heats_its_catalyst": 1}  # laws that do nothing from where seed 7 lets them begin
REV_QUICKLY = ("v_loses_its_teeth",)  # laws that do nothing while the engine's speed changes slowly


def wave(k, seconds):
    """(batch,) from -1 to 1."""
    return np.sin(2.0 * np.pi * STEP_S * k / seconds + PHASE)


def moment(k, truck):
    """Speeds from rest to 26 m/s, hills, pulls, brakes and shifts: everything a law may look at."""
    speed = np.maximum(12.0 + 14.0 * wave(k, 31.0), 0.0)
    torque = truck.peak_torque * np.clip(0.35 + 0.75 * wave(k, 13.0), -0.12, 1.0)
    gear = np.clip(1.0 + np.floor(speed / 2.2), 1.0, 12.0)
    braking = np.maximum(wave(k, 19.0) - 0.1, 0.0)
    mass, grade = np.full(BATCH, truck.mass), 0.05 * wave(k, 27.0)
    distance = (
        3000.0
        + STEP_S * k * 12.0
        + 14.0 * 31.0 / 2.0 / np.pi * (np.cos(PHASE) - np.cos(2 * np.pi * STEP_S * k / 31.0 + PHASE))
    )
    pedal = np.stack(
        [np.maximum(torque, 0.0) / truck.peak_torque * truck.full_command, braking * 40.0], axis=1
    )
    return SimpleNamespace(
        speed=speed,
        acceleration=14.0
        * 2.0
        * np.pi
        / 31.0
        * np.cos(2.0 * np.pi * STEP_S * k / 31.0 + PHASE)
        * (speed > 0.0),
        distance=distance,
        gear=gear,
        ratio=38.0 / gear,
        shifting=(wave(k, 7.0) > 0.96).astype(float),
        engine_speed=70.0 + 60.0 * (1.0 + wave(k, 11.0)),
        engine_torque=torque,
        traction_force=0.92 * torque * 38.0 / gear / truck.wheel_radius,
        brake_force=7e4 * braking,
        brake_temperature=90.0 + 200.0 * braking,
        drag_force=0.6 * truck.drag_area * speed**2,
        rolling_force=0.006 * mass * 9.81,
        grade_force=mass * 9.81 * grade,
        mass=mass,
        effective_mass=1.04 * mass,
        elevation=np.zeros(BATCH),
        u=pedal,
        grade=grade,
        time=STEP_S * k,
    )


def channels():
    time = np.arange(STEPS) * 0.1
    out = {"speed": 12.0 + 10.0 * np.sin(time / 5.0), "acceleration": 2.0 * np.cos(time / 5.0)}
    out |= {"grade": 0.03 * np.sin(time / 9.0), "elevation": time, "engine_torque": 900.0 * np.sin(time)}
    names = ("fuel_rate", "gear", "engine_speed", "engine_command", "brake_command")
    return out | {name: np.abs(np.sin(time / (2.0 + k))) for k, name in enumerate(names)}


@cache
def truck_of(name):
    return trucks.namespace(trucks.make(name, {}))


@cache
def moments(name, quick=False):
    seen = [moment(k, truck_of(name)) for k in range(STEPS)]
    for k, view in enumerate(seen if quick else ()):
        view.engine_speed = 70.0 + 60.0 * (1.0 + wave(k, 4.0))
    return seen


def what_it_does(effect, setting):
    """Everything an effect does, in one row: N, interface units, or channels as spoilt."""
    sizes = {n: 0.3 * low + 0.7 * high for n, (low, high) in effect.ranges.items()}
    planted = effect.build(setting, SimpleNamespace(**sizes))
    rows = [[value] for value in planted.parameters.values()]
    for part in (*planted.forces, *planted.filters):
        part.reset(BATCH)
        act = part.force if part in planted.forces else lambda v, dt, part=part: part.filter(v.u, v.time, dt)
        seen = moments(effect.trucks[-1], effect.key in REV_QUICKLY)
        rows += [np.ravel(act(view, STEP_S)).copy() for view in seen]
    for fault in planted.faults:
        spoilt = channels()
        fault(spoilt, 0.1, np.random.default_rng(4))
        rows += [spoilt[name] - values for name, values in channels().items()]
    return np.concatenate(rows) if rows else np.zeros(1)


def setting_for(name, key=""):
    leader = np.linspace(20.0, 20.0 + 13.0 * 60.0, 600)[None] + np.array([[0.0], [6.0], [12.0]])
    if key in HEAR_A_CHANGE:
        leader = leader + 15.0 * np.sin(0.3 * np.arange(0.0, 60.0, 0.1) + PHASE[:, None])
    places = np.array([9000.0, 9500.0, 12000.0]), np.array([1.0, -1.0, 1.0]), np.array([0, 1, 1])
    return Setting(truck_of(name), BATCH, 60.0, 0.1, OTHER_SEEDS.get(key, 7), *places, leader)


def figures(values):
    """rms, and a mean with weights that tell samples apart."""
    weights = np.cos(0.7 * np.arange(len(values)))
    return float(np.sqrt(np.mean(values**2))), float(np.mean(values * weights))


with (Path(__file__).parent / "forces.csv").open() as file:
    KNOWN = {row["key"]: (float(row["rms"]), float(row["weighted"])) for row in csv.DictReader(file)}


def test_every_effect_is_pinned():
    assert set(KNOWN) == {key for key, effect in EFFECTS.items() if effect.family != SEALED}


@pytest.mark.parametrize("key", KNOWN)
def test_an_effect_does_what_it_did(key):
    effect = EFFECTS[key]
    known, setting = KNOWN[key], setting_for(effect.trucks[-1], key)
    np.testing.assert_allclose(
        figures(what_it_does(effect, setting)), known, rtol=1e-5, atol=1e-6 * max(known[0], 1e-6)
    )
