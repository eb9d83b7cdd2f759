"""Laws against values that a textbook gives, or that a hand can work out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from deeptruck_exam.laws.law import GRAVITY, Array

Make, Hold = Callable[..., Any], Callable[..., Array]


def test_the_stuttgart_formula(alone: Make, held: Hold) -> None:
    law = alone("stuttgart_formula", at_100mph=0.02, power=2.5)
    assert held(law, 0.1, speed=44.7)[0] == pytest.approx(-0.02 * 2e4 * GRAVITY)
    assert held(law, 0.1, speed=22.35)[0] == pytest.approx(-0.02 * 2e4 * GRAVITY / 2**2.5)


def test_a_chamber_fills_after_its_dead_time(alone: Make, held: Hold) -> None:
    law = alone("chamber_filling", dead_time_s=0.2, fill_rate=1.0)
    assert held(law, 0.15, brake_force=4e4)[0] == pytest.approx(4e4)
    # choked flow from half of the difference: sqrt(d) falls linearly, done after 2 sqrt(0.2) s at rate 1
    assert held(law, 1.0, brake_force=4e4)[0] < 1.0


def test_a_brake_fades_as_it_heats(alone: Make, held: Hold) -> None:
    law = alone("two_mass_fade")
    cold, hot = held(law, 1.0, brake_force=4e4)[0], held(law, 150.0, brake_force=4e4)[0]
    assert cold < 0.02 * 4e4 and 0.1 * 4e4 < hot < 0.45 * 4e4


def test_torque_is_lost_in_the_backlash(alone: Make, held: Hold) -> None:
    law = alone("dead_zone", gap_s=0.3)
    held(law, 5.0, traction_force=8000.0)
    assert held(law, 0.1, traction_force=-4000.0)[0] == pytest.approx(4000.0)
    assert abs(held(law, 6.0, traction_force=-4000.0)[0]) < 1.0


def test_mesh_losses_are_a_share_of_what_is_carried(alone: Make, held: Hold) -> None:
    law = alone("mesh_and_churning", mesh=0.1, churning_n=400.0)
    assert held(law, 0.1, speed=20.0, traction_force=-5000.0)[0] == pytest.approx(-(500.0 + 400.0))


def test_a_heavy_flywheel_adds_mass_by_the_ratio_squared(alone: Make, held: Hold) -> None:
    law = alone("heavy_flywheel", engine_kgm2=5.0, wheels_kgm2=100.0)
    expected = -(5.0 * 6.0**2 + 100.0) / law.truck.wheel_radius**2 * 0.5
    assert held(law, 0.1, acceleration=0.5)[0] == pytest.approx(expected)


def test_a_soft_limit_holds_the_torque(alone: Make, held: Hold) -> None:
    law = alone("soft_torque_limit", share_of_peak=0.6, knee_nm=20.0)
    torque = 0.9 * law.truck.peak_torque
    lost = held(law, 0.1, engine_torque=torque)[0] * law.truck.wheel_radius / 6.0
    assert lost == pytest.approx(-0.3 * law.truck.peak_torque, rel=0.01)


def test_a_turbo_gives_way_to_full_torque(alone: Make, held: Hold) -> None:
    law = alone("turbo_shaft")
    first = held(law, 0.1, engine_torque=law.truck.peak_torque)[0]
    assert first < 0.0 and held(law, 15.0, engine_torque=law.truck.peak_torque)[0] > 0.05 * first


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


def test_cold_oil_costs_less_as_it_warms(alone: Make, held: Hold) -> None:
    law = alone("cold_oil")
    first = held(law, 0.1)[0]
    assert first < -100.0 and held(law, 600.0)[0] > 0.5 * first


def test_a_delay_gives_what_was_asked_before(alone: Make) -> None:
    law = alone("network_delay", delay_s=0.5, wander_s=0.0)
    law.filter(np.zeros((2, 2)), 0.0, 0.01)
    asked = np.full((2, 2), 100.0)
    given = [law.filter(asked, 0.01 * k, 0.01)[0, 0] for k in range(100)]
    assert given[40] == 0.0 and given[60] == 100.0


def test_anti_jerk_control_limits_the_rate(alone: Make) -> None:
    law = alone("anti_jerk", up_per_s=0.2, down_ratio=2.0)
    full = law.full
    law.filter(np.zeros((2, 2)), 0.0, 0.01)
    asked = np.array([[full, 0.0]] * 2)
    given = [law.filter(asked, 0.01 * k, 0.01)[0, 0] for k in range(200)]
    assert given[99] == pytest.approx(0.2 * full, rel=0.02) and given[199] == pytest.approx(
        0.4 * full, rel=0.02
    )
