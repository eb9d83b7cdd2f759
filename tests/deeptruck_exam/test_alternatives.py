"""The second forms, where each has a way of its own; what holds for all is in test_families.py."""

import numpy as np
import pytest


def test_an_inertia_resists_change_and_a_late_brake_lets_run_on(driven, along):
    built = driven("damped_flywheel")
    force, acceleration = along(built)[9::10], built.drives.y[:, 1:, 0].T
    assert np.corrcoef(force.ravel(), acceleration.ravel())[0, 1] < -0.4
    built = driven("relay_valve_sticks")
    force = along(built)[9::10]
    pressed = np.diff(built.drives.u[:, :, 1], axis=1).T
    assert force[pressed > 0.0].mean() > 0.0 > force[pressed < 0.0].mean()


def test_fade_needs_heat_and_pressure_together(driven):
    (one,) = driven("stroke_runs_out", minutes=0.5).oracle.forces
    one.reset(1)
    full = one.truck.brake_capacity

    class View:
        speed, brake_force = np.array([15.0]), np.array([0.3 * full])

    cold = one.newtons(View, 0.01)[0]
    one.s.drum[:] = 320.0
    hot = one.newtons(View, 0.01)[0]
    View.brake_force = np.array([0.02 * full])
    gentle = one.newtons(View, 0.01)[0] / 0.02
    assert cold < 0.02 * full and 0.1 < hot / (0.3 * full) < 0.9 and gentle < hot / 0.3


@pytest.mark.parametrize("key", ["standing_water", "grade_from_a_coarse_map"])
def test_what_lies_on_the_road_lies_there_for_both_directions(key, driven):
    built = driven(key, minutes=0.5)
    (one,) = built.oracle.forces
    road = one.road[one.setting.route[0]]
    assert (road != 0.0).mean() > 0.1 and np.abs(road).max() < 1.01
    if key == "grade_from_a_coarse_map":
        assert abs(road.sum() * 5.0) < 1.0 and built.faults.conceal == ("elevation",)
