"""A truck of ours as an FMU: valid, and the same truck to the last digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.fmu import export
from deeptruck_model.trucks import driving_cycles


def test_fmpy_finds_it_valid(own_fmu: Path) -> None:
    assert validate_fmu(str(own_fmu)) == []


def test_fmpy_drives_it_as_our_own_step_does(own_fmu: Path) -> None:
    truck = trucks.load("trucksim")
    drive = driving_cycles.drive(truck, seconds=180.0, seed=3)
    names = [*truck.interface.u, *truck.interface.w]
    given = [drive.channels[name] for name in names]
    speed = float(drive.channels["speed"][0])
    rows = [(0.1 * k, *(float(x[k]) for x in given)) for k in range(len(drive))]
    signals = np.array(rows, [("time", float), *((name, float) for name in names)])
    told = simulate_fmu(
        str(own_fmu), start_values={"initial_speed": speed}, input=signals, output=["speed", "fuel_rate"],
        stop_time=0.1 * (len(drive) - 1), step_size=0.1, output_interval=0.1, fmi_type="CoSimulation",
    )  # fmt: skip
    state, y = truck.reset(np.array([[0.0, speed, 0.0]])), np.zeros((len(drive), 3))
    for k in range(len(drive) - 1):
        state, y[k + 1] = truck.step(
            state, *(np.array([[x[k] for x in part]]) for part in (given[:2], given[2:]))
        )
    assert np.abs(told["speed"][1:] - y[1:, 1]).max() < 1e-6
    assert np.abs(told["fuel_rate"][1:] - y[1:, 2]).max() < 1e-6 and y[:, 1].max() > 10.0


def test_a_simulator_of_somebody_elses_is_not_exported(shuttle: Path, own: str) -> None:
    simulators.load(own).save(Path("kept"))
    for text in (own, f"python:{shuttle.stem}:make", "kept"):
        with pytest.raises(InputError, match="is, or corrects, a simulator that others wrote"):
            export.export(text, Path("never.fmu"))
    assert not Path("never.fmu").exists()
