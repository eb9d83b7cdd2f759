"""The first forms, where each has a way of its own; what holds for all is in test_families.py."""

from types import SimpleNamespace

import numpy as np

from deeptruck_exam.effects import EFFECTS


def test_a_filter_leaves_constant_commands_alone(planted):
    for key in ("command_delay", "command_rate_limit"):
        parts, _ = planted(EFFECTS[key])
        (one,) = parts.filters
        one.reset(3)
        u = np.tile([300.0, 10.0], (3, 1))
        for k in range(200):
            np.testing.assert_allclose(one.filter(u, k * 0.01, 0.01), u)


def test_brakes_fade_on_a_long_descent_and_recover(planted):
    (one,) = planted(EFFECTS["brake_fade"])[0].forces
    one.reset(1)
    view = SimpleNamespace(brake_force=np.array([4e4]), speed=np.array([18.0]))
    early = one.newtons(view, 0.01)
    for _ in range(2400):
        late = one.newtons(view, 0.05)
    assert early[0] < 10.0 and late[0] > 0.15 * 4e4
    idle = SimpleNamespace(brake_force=np.array([0.0]), speed=np.array([18.0]))
    for _ in range(24000):
        one.newtons(idle, 0.05)
    assert one.newtons(view, 0.01)[0] < 0.5 * late[0]


def test_a_stretch_of_rough_road_is_in_the_same_place_in_both_directions(planted):
    (one,) = planted(EFFECTS["road_surface"])[0].forces
    view = SimpleNamespace(speed=np.full(3, 15.0), mass=np.full(3, 2e4))
    there = []
    for metres in range(0, 2000, 10):
        view.distance = np.full(3, float(metres))
        there.append(one.newtons(view, 0.01).copy())
    forwards = np.array(there)[:, 2]
    view.distance = np.array([0.0, 0.0, 0.0])
    one.setting.start_m[1] = 9000.0 + 1990.0
    backwards = []
    for metres in range(0, 2000, 10):
        view.distance = np.full(3, float(metres))
        backwards.append(one.newtons(view, 0.01)[1])
    np.testing.assert_allclose(forwards, backwards[::-1])
    assert len(np.unique(forwards)) > 1
