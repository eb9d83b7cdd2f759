from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.deep import coverage, io
from deeptruck_model.recordings import Recording

INTERFACE = TruckInterface("truck", "N m")
N = 300


def cruise(speed: float, engine: float, seconds: float = 30.0) -> Recording:
    n = round(10 * seconds)
    channels = {
        "speed": np.full(n, speed),
        "acceleration": np.zeros(n),
        "fuel_rate": np.ones(n),
        "engine_command": np.full(n, engine),
        "brake_command": np.zeros(n),
        "grade": np.zeros(n),
    }
    return Recording("cruise", 0.1, channels, INTERFACE)


def covered(what: coverage.Driven, speed: float, engine: float, grade: float = 0.0) -> bool:
    return bool(what.covers(np.array([speed]), np.array([[engine, 0.0]]), np.array([[grade]]))[0])


def test_near_what_was_driven_is_known_and_far_is_not() -> None:
    what = coverage.measure_driven([cruise(10.0, 1000.0)])
    assert covered(what, 11.9, 1000.0) and not covered(what, 12.1, 1000.0)
    assert covered(what, 10.0, 1090.0) and not covered(what, 10.0, 1110.0)
    assert covered(what, 10.0, 1000.0, 0.009) and not covered(what, 10.0, 1000.0, 0.011)


def test_a_moment_teaches_nothing() -> None:
    what = coverage.measure_driven([cruise(10.0, 1000.0), cruise(20.0, 1000.0, seconds=1.0)])
    assert covered(what, 10.0, 1000.0) and not covered(what, 20.0, 1000.0)


def test_an_adapted_truck_knows_what_it_drove_before_as_well() -> None:
    before = coverage.measure_driven([cruise(10.0, 1000.0)])
    both = coverage.measure_driven([cruise(20.0, 800.0)], before)
    assert covered(both, 10.0, 1000.0) and covered(both, 20.0, 800.0) and not covered(both, 15.0, 900.0)


def test_samples_without_a_number_teach_nothing() -> None:
    gap = cruise(10.0, 1000.0)
    gap.channels["speed"][:] = np.nan
    what = coverage.measure_driven([gap, cruise(20.0, 1000.0)])
    assert np.isfinite(what.samples).all() and not covered(what, 10.0, 1000.0)


def test_it_is_kept_as_it_is(tmp_path: Path) -> None:
    what = coverage.measure_driven([cruise(10.0, 1000.0)])
    io.save_driven(what, tmp_path)
    back = io.load_driven(tmp_path, 4)
    assert back is not None
    np.testing.assert_array_equal(back.samples, what.samples)
    np.testing.assert_array_equal(back.near, what.near)


def test_damaged_or_of_other_signals_is_said(tmp_path: Path) -> None:
    io.save_driven(coverage.measure_driven([cruise(10.0, 1000.0)]), tmp_path)
    with pytest.raises(InputError, match="of other signals"):
        io.load_driven(tmp_path, 3)
    whole = io.load_driven(tmp_path, 4)
    assert whole is not None
    for name, value in (("samples", np.nan), ("near", np.nan), ("near", 0.0)):
        damaged = getattr(whole, name).copy()
        damaged.flat[-1] = value
        io.save_driven(replace(whole, **{name: damaged}), tmp_path)
        with pytest.raises(InputError, match="values that are not possible"):
            io.load_driven(tmp_path, 4)
    (tmp_path / io.DRIVEN_FILE).write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="damaged"):
        io.load_driven(tmp_path, 4)
