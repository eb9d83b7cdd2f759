"""Hidden effects: the whole list is there, each is drawn within its ranges, acts, and does not move a
standing truck."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_model import trucks as pool
from deeptruck_model.mismatch.proof import trucks
from deeptruck_model.mismatch.proof.effects import EFFECTS, named, of_kind, unknown
from deeptruck_model.mismatch.proof.hidden import Setting

NAMES = [
    "brake_fade",
    "brake_lag",
    "dragging_brake",
    "headwind",
    "drafting",
    "drag_area",
    "road_grade",
    "rolling_resistance_speed",
    "rolling_resistance_warmup",
    "road_surface",
    "payload_change",
    "turbo_lag",
    "torque_derate",
    "torque_limit",
    "engine_brake",
    "engine_friction",
    "accessory_load",
    "driveline_loss",
    "shift_interruption",
    "torque_converter_slip",
    "wheel_slip",
    "rotating_inertia",
    "load_slosh",
    "command_delay",
    "command_rate_limit",
    "driveline_backlash",
]
BATCH = 3


def setting(name):
    truck = pool.load(name)
    return Setting(
        trucks.namespace(truck),
        BATCH,
        60.0,
        0.1,
        5,
        np.full(BATCH, 9000.0),
        np.array([1.0, -1.0, 1.0]),
        np.array([0, 1, 1]),
        np.linspace(25.0, 25.0 + 15.0 * 60.0, 600)[None, :].repeat(BATCH, axis=0),
    )


def planted(effect, name=None):
    kind = name or effect.trucks[-1]
    values = effect.draw(np.random.default_rng(1), scale=4.0)
    return effect.build(setting(kind), SimpleNamespace(**values)), pool.load(kind).with_grade_input()


def test_every_name_of_the_table_has_an_effect():
    assert {e.name for e in named()} == set(NAMES)
    assert {e.name for e in of_kind("measurement_fault")} == {
        "clock_offset",
        "speed_scale",
        "acceleration_bias",
        "grade_bias",
    }
    assert {e.name for e in of_kind("parameter_error")} == set(trucks.TUNABLE)
    assert len(unknown()) >= 10


@pytest.mark.parametrize("key", EFFECTS)
def test_source_and_ranges_are_stated(key):
    effect = EFFECTS[key]
    assert len(effect.source) > 40
    assert all(low < high for low, high in effect.ranges.values())
    drawn = [effect.draw(np.random.default_rng(k)) for k in range(20)]
    for name, (low, high) in effect.ranges.items():
        values = [d[name] for d in drawn]
        assert low <= min(values) < max(values) <= high


@pytest.mark.parametrize("key", [e.key for e in EFFECTS.values() if e.gateable])
def test_a_force_is_finite_leaves_a_standing_truck_alone_and_copies_apart(key):
    parts, truck = planted(EFFECTS[key])
    truck = truck.with_forces(parts.forces)
    state = truck.reset(np.zeros((BATCH, 3)))
    brake = 1.0 if truck.interface.brake_unit == "m/s^2" else 30.0
    u, w = np.tile([0.0, brake], (BATCH, 1)), np.zeros((BATCH, 1))
    for _ in range(10):
        state, y = truck.step(state, u, w)
        assert np.all(y[:, 1] == 0.0)
    state = truck.force(state, np.tile([0.0, 14.0, 1.0], (BATCH, 1)))
    twin = copy.deepcopy(state)
    first, y = truck.step(state, u * [[1.0, 0.0]], w)
    assert np.isfinite(y).all()
    for _ in range(5):
        first, _ = truck.step(first, u * 0.5, w)
    _, z = truck.step(twin, u * [[1.0, 0.0]], w)
    np.testing.assert_array_equal(y, z)


def test_a_filter_leaves_constant_commands_alone():
    for key in ("command_delay", "command_rate_limit"):
        parts, _ = planted(EFFECTS[key])
        (one,) = parts.filters
        one.reset(BATCH)
        u = np.tile([300.0, 10.0], (BATCH, 1))
        for k in range(200):
            np.testing.assert_allclose(one.filter(u, k * 0.01, 0.01), u)


def test_brakes_fade_on_a_long_descent_and_recover():
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


def test_a_stretch_of_rough_road_is_in_the_same_place_in_both_directions():
    (one,) = planted(EFFECTS["road_surface"])[0].forces
    view = SimpleNamespace(speed=np.full(BATCH, 15.0), mass=np.full(BATCH, 2e4))
    there = []
    for metres in range(0, 2000, 10):
        view.distance = np.full(BATCH, float(metres))
        there.append(one.newtons(view, 0.01).copy())
    forwards = np.array(there)[:, 2]
    view.distance = np.array([0.0, 0.0, 0.0])
    one.setting.start_m[1] = 9000.0 + 1990.0
    backwards = []
    for metres in range(0, 2000, 10):
        view.distance = np.full(BATCH, float(metres))
        backwards.append(one.newtons(view, 0.01)[1])
    np.testing.assert_allclose(forwards, backwards[::-1])
    assert len(np.unique(forwards)) > 1
