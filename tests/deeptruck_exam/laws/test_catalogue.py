"""Sixty laws and ten sensor faults: declared with a source, acting on drives, and never pushing at rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam.laws import EFFECTS, named, nameless, of_kind
from deeptruck_exam.laws.law import Array
from deeptruck_exam.laws.parameters import each_drive
from deeptruck_model.mismatch import LIBRARY

FORCES = [e.key for e in of_kind("missing_physics") if e.key != "slope_not_recorded"]
SLOW = {"two_mass_fade", "coolant_derate"}  # minutes of heat: test_physics.py has them
NO_FORCE = {"lockup_fails", "network_delay", "sampled_bus", "anti_jerk"}


def test_there_are_sixty_laws_ten_faults_and_a_dozen_without_a_name() -> None:
    assert (len(of_kind("missing_physics")), len(of_kind("measurement_fault")), len(nameless())) == (
        60,
        10,
        12,
    )
    assert max(Counter(e.name for e in named()).values()) <= 3


def test_every_name_is_one_of_the_tool() -> None:
    parameters = {"mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain"}
    faults = {"clock_offset", "speed_scale", "acceleration_bias", "grade_bias"}
    assert {e.name for e in named()} <= set(LIBRARY)
    assert {e.name for e in of_kind("measurement_fault")} == faults
    assert {e.name for e in of_kind("parameter_error")} == parameters
    assert {e.name for e in each_drive()} <= set(LIBRARY)
    known = {*LIBRARY, *parameters, *faults}
    assert all(set(e.accepts) <= known for e in EFFECTS.values())


def test_every_law_has_a_source_and_ranges() -> None:
    for effect in [*EFFECTS.values(), *each_drive()]:
        assert len(effect.source) > 15, effect.key
        assert all(low < high for low, high in effect.ranges.values()), effect.key


@pytest.mark.parametrize("key", [k for k in FORCES if k not in SLOW])
def test_a_law_acts_on_drives_within_reason(key: str, acted: Callable[[str], Array]) -> None:
    force = acted(key)
    assert np.isfinite(force).all()
    assert 0.004 < np.abs(force).max() < 6.0


@pytest.mark.parametrize("name", sorted({EFFECTS[key].name for key in FORCES if key not in NO_FORCE}))
def test_laws_of_a_name_do_not_move_a_truck_that_stands(
    name: str, alone: Callable[..., object], held: Callable[..., Array]
) -> None:
    nothing = ("speed", "acceleration", "traction_force", "engine_torque", "drag_force", "u0")
    for key in FORCES:
        if EFFECTS[key].name == name and key not in NO_FORCE:
            force = held(alone(key), 0.5, **dict.fromkeys(nothing, 0.0))
            assert np.all(np.abs(force) <= 1e-6), key


@pytest.mark.parametrize("fault", of_kind("measurement_fault"), ids=lambda e: e.key)
def test_a_fault_spoils_what_its_name_says_alone(fault: object) -> None:
    t = np.arange(3000) * 0.1
    channels = {
        "speed": 15.0 + 5.0 * np.sin(t / 20.0),
        "acceleration": 0.25 * np.cos(t / 20.0),
        "grade": 0.02 * np.sin(t / 50.0),
        "fuel_rate": 3.0 + np.sin(t / 20.0),
        "engine_command": 500.0 + 100.0 * np.sin(t / 20.0),
    }
    spoilt = {name: values.copy() for name, values in channels.items()}
    sizes = SimpleNamespace(**fault.draw(np.random.default_rng(1)))  # type: ignore[attr-defined]
    (spoil,) = fault.build(None, sizes).faults  # type: ignore[attr-defined]
    spoil(spoilt, 0.1, np.random.default_rng(2))
    changed = {name for name in channels if not np.array_equal(channels[name], spoilt[name])}
    of_name = {
        "acceleration_bias": {"acceleration"},
        "speed_scale": {"speed"},
        "grade_bias": {"grade"},
        "clock_offset": {"acceleration", "speed", "fuel_rate"},
    }[fault.name]  # type: ignore[attr-defined]
    assert changed and changed <= of_name
