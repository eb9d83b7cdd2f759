"""Sixty laws and ten sensor faults: declared with a source, acting on drives, and never pushing at rest."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_exam.laws import EFFECTS, named, of_kind
from deeptruck_exam.laws.law import GRAVITY, Array
from deeptruck_exam.laws.parameters import each_drive
from deeptruck_model.mismatch import LIBRARY

FORCES = [e.key for e in of_kind("missing_physics") if e.key != "slope_not_recorded"]
SLOW = {"two_mass_fade", "coolant_derate"}  # minutes of heat: test_physics.py has them
NO_FORCE = {"lockup_fails", "network_delay", "sampled_bus", "anti_jerk"}


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


# Laws against values that a textbook gives, or that a hand can work out


Make, Hold = Callable[..., Any], Callable[..., Array]


def test_the_stuttgart_formula(alone: Make, held: Hold) -> None:
    law = alone("stuttgart_formula", at_100mph=0.02, power=2.5)
    assert held(law, 0.1, speed=44.7)[0] == pytest.approx(-0.02 * 2e4 * GRAVITY)
    assert held(law, 0.1, speed=22.35)[0] == pytest.approx(-0.02 * 2e4 * GRAVITY / 2**2.5)


def test_a_brake_fades_as_it_heats(alone: Make, held: Hold) -> None:
    law = alone("two_mass_fade")
    cold, hot = held(law, 1.0, brake_force=4e4)[0], held(law, 150.0, brake_force=4e4)[0]
    assert cold < 0.02 * 4e4 and 0.1 * 4e4 < hot < 0.45 * 4e4


def test_mesh_losses_are_a_share_of_what_is_carried(alone: Make, held: Hold) -> None:
    law = alone("mesh_and_churning", mesh=0.1, churning_n=400.0)
    assert held(law, 0.1, speed=20.0, traction_force=-5000.0)[0] == pytest.approx(-(500.0 + 400.0))


def test_a_heavy_flywheel_adds_mass_by_the_ratio_squared(alone: Make, held: Hold) -> None:
    law = alone("heavy_flywheel", engine_kgm2=5.0, wheels_kgm2=100.0)
    expected = -(5.0 * 6.0**2 + 100.0) / law.truck.wheel_radius**2 * 0.5
    assert held(law, 0.1, acceleration=0.5)[0] == pytest.approx(expected)


def test_a_hot_coolant_takes_torque(alone: Make, held: Hold) -> None:
    law = alone("coolant_derate")
    torque = 0.8 * law.truck.peak_torque
    cold, hot = (held(law, s, engine_torque=torque, engine_speed=170.0, speed=8.0)[0] for s in (1.0, 300.0))
    lost = -hot * law.truck.wheel_radius / 6.0 / torque
    assert cold == 0.0 and 0.2 < lost < 0.46


def test_an_eddy_retarder_is_strongest_at_its_critical_speed(alone: Make, held: Hold) -> None:
    law = alone("eddy_retarder", force_n=2000.0, critical_mps=5.0, below_mps=30.0)
    forces = [held(law, 0.1, speed=v)[0] for v in (2.0, 5.0, 12.5)]
    assert forces[1] == pytest.approx(-2000.0) and forces[0] == pytest.approx(forces[2])


def test_other_payload_weighs_on_slopes_and_at_starts(alone: Make, held: Hold) -> None:
    law = alone("other_payload", share=0.3, sign=1.0)
    loaded = held(law, 0.1, grade=0.05, acceleration=0.4) - held(law, 0.1)
    assert np.abs(loaded).max() == pytest.approx(0.3 * 2e4 * (0.4 + 0.05 * GRAVITY))


def test_anti_jerk_control_limits_the_rate(alone: Make) -> None:
    law = alone("anti_jerk", up_per_s=0.2, down_ratio=2.0)
    full = law.full
    law.filter(np.zeros((2, 2)), 0.0, 0.01)
    asked = np.array([[full, 0.0]] * 2)
    given = [law.filter(asked, 0.01 * k, 0.01)[0, 0] for k in range(200)]
    assert given[99] == pytest.approx(0.2 * full, rel=0.02) and given[199] == pytest.approx(
        0.4 * full, rel=0.02
    )
