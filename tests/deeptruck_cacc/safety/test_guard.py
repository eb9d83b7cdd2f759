"""What is no number reaches no memory: a guarded controller drives on when its signals are back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.brakes import Brakes
from deeptruck_cacc.safety.guard import Guard, guard, load_controller
from deeptruck_core.signals import SPEED
from deeptruck_model import trucks

TRUCK = trucks.load("trucksim").interface
STEADY = {"leader_speed": 20.0, "speed": 20.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.0}
NO_NUMBERS = st.sampled_from([float("nan"), float("inf"), float("-inf")])
DAMAGE = st.lists(st.dictionaries(st.sampled_from(OBSERVED), NO_NUMBERS, max_size=5), min_size=1, max_size=40)


def network() -> Guard:
    """A policy with memory and radar filter, behind the guard."""
    features = FeatureMap.default(power=True)
    rng = np.random.default_rng(0)
    layers = [(0.1 * rng.normal(size=(2, len(features.names))), np.zeros(2))]
    return guard(MlpPolicy(layers, features, ActionScale.of(TRUCK), TRUCK))


def commands(driver: Guard, **changed: float) -> np.ndarray:
    return np.stack(driver.act({**STEADY, **changed}))[:, 0]


@pytest.mark.parametrize(
    "make", [network, *(lambda n=n: load_controller(f"baseline:{n}", TRUCK) for n in LAWS)]
)
def test_a_signal_that_is_no_number_for_a_moment_leaves_no_trace(make: object) -> None:
    driver, undisturbed = make(), make()  # type: ignore[operator]
    for _ in range(50):
        commands(driver), commands(undisturbed)
    for name in OBSERVED:
        for value in (np.nan, np.inf, -np.inf):
            np.testing.assert_allclose(commands(driver, **{name: value}), commands(undisturbed), atol=1e-6)
            assert not driver.acted[0] and not driver.fallback_drives[0]


@settings(max_examples=30)
@given(DAMAGE)
def test_whatever_was_no_number_the_policy_drives_again(damage: list[dict[str, float]]) -> None:
    driver = network()
    for wrong in damage:
        assert np.isfinite(commands(driver, **wrong)).all()
    for _ in range(40):
        commands(driver)
    assert not driver.fallback_drives[0] and np.isfinite(driver.policy._memory).all()  # type: ignore[attr-defined]


def test_a_speedometer_that_stays_silent_is_no_reason_to_drive_on() -> None:
    driver, undisturbed = network(), network()
    for _ in range(50):
        commands(driver), commands(undisturbed)
    silent = np.array([commands(driver, speed=np.nan) for _ in range(20)])
    np.testing.assert_allclose(silent[:9], [commands(undisturbed) for _ in range(9)])
    assert driver.shield is not None
    mild = 100.0 * driver.shield.assumed.mild_brake
    np.testing.assert_allclose(silent[12:], np.tile([0.0, mild], (8, 1)))


def test_a_speed_that_no_truck_can_change_to_is_none() -> None:
    driver, undisturbed = network(), network()
    for _ in range(50):
        commands(driver), commands(undisturbed)
    jumped = np.array([commands(driver, speed=0.0) for _ in range(9)])
    np.testing.assert_allclose(jumped, [commands(undisturbed) for _ in range(9)])


@pytest.mark.parametrize("gap", [np.nan, np.inf, 0.0, -1.0])
def test_a_time_gap_that_is_none_stays_as_it_was_asked(gap: float) -> None:
    driver, undisturbed = network(), network()
    for _ in range(20):
        commands(driver), commands(undisturbed)
    np.testing.assert_allclose(commands(driver, target_time_gap=gap), commands(undisturbed))


def test_without_a_time_gap_nobody_drives() -> None:
    driver = network()
    engine, brake = commands(driver, target_time_gap=np.nan)
    assert engine == 0.0 and brake > 0.0


def test_a_leader_without_a_speed_is_not_seen() -> None:
    """Half a reading is none: the shield's leader brakes by what the errors of two readings may hide."""
    driver = load_controller("baseline:cacc", TRUCK)
    assert driver.shield is not None
    p = driver.shield.assumed
    for _ in range(3):
        commands(driver)
    for _ in range(5):
        commands(driver, leader_speed=np.nan)
    assert driver.shield._ahead is not None
    lost = 2 * p.speed_error / p.track_s * 5 * p.dt
    assert driver.shield._ahead.speed[0, 0] == pytest.approx(20.0 - p.speed_error - lost)


@pytest.mark.parametrize("speed", [8.0, 25.0])
def test_on_a_truck_that_was_never_measured_the_engine_is_not_switched_on_and_off(speed: float) -> None:
    """Its cautious assumptions need more than 2 s: policy and shield must not drive against each other."""
    truck = trucks.load("trucksim")
    driver = guard(baseline("acc", truck.interface), Assumptions())
    rng, gap = np.random.default_rng(3), 2.0 * speed
    y = np.zeros((1, len(truck.interface.y)))
    y[0, SPEED] = speed
    state = truck.reset(y)
    engines: list[float] = []
    for _ in range(600):
        own, noise = y[0, SPEED], rng.normal(size=2)
        seen = {**STEADY, "gap": gap + 0.1 * noise[0], "leader_speed": speed + 0.05 * noise[1], "speed": own}
        engine, brake = driver.act(seen)
        state, y = truck.step(state, np.column_stack([engine, brake]), np.zeros((1, 1)))
        gap += truck.dt * (speed - (own + y[0, SPEED]) / 2)
        engines.append(engine[0] / 2000.0)
    assert np.abs(np.diff(engines[10:])).max() < 0.3 and gap / speed > 2.05


@pytest.mark.parametrize(("factor", "speed"), [(-0.03, 20.6), (0.03, 20.0)])
def test_of_the_measured_speed_and_that_of_the_true_wheels_the_higher_one_counts(
    factor: float, speed: float
) -> None:
    driver = load_controller("baseline:cacc", TRUCK)
    commands(driver)
    driver._tracker.own_speed_factor = np.array([factor])
    commands(driver, gap=np.nan)
    assert driver.shield is not None
    assert driver.shield._truck.speed[0] == pytest.approx(speed + driver.shield.assumed.speed_error)


def test_outside_its_coverage_the_fallback_drives() -> None:
    driver = load_controller("baseline:cacc", TRUCK)
    driver.coverage = {"grade": (-0.01, 0.01)}
    seen = {"leader_speed": 20.0, "speed": 20.0, "gap": 60.0, "target_time_gap": 3.0, "grade": 0.0}
    driver.act(seen)
    assert not driver.fallback_drives[0]
    driver.act({**seen, "grade": 0.05})
    assert driver.fallback_drives[0]
    driver.act(seen)
    assert driver.fallback_drives[0]  # for three seconds more
    for _ in range(30):
        driver.act(seen)
    assert not driver.fallback_drives[0]


@pytest.mark.parametrize(("truck", "known"), [("trucksim", True), ("freightliner", False)])
def test_a_truck_without_a_grade_sensor_has_no_slope(
    truck: str, known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The zero that stands in for it would let a descent pass for brakes that fail."""
    driver, seen, plain = load_controller("baseline:acc", trucks.load(truck).interface), [], Brakes.see

    def see(self: Brakes, speed: np.ndarray, grade: np.ndarray, heat: np.ndarray) -> None:
        seen.append(bool(np.isfinite(grade[0])))
        plain(self, speed, grade, heat)

    monkeypatch.setattr(Brakes, "see", see)
    commands(driver)
    assert seen == [known]


def test_a_bridge_that_lets_brakes_rise_slowly_is_a_longer_response() -> None:
    policy = baseline("acc", TRUCK)
    plain, slow = guard(policy), guard(policy, brake_limit=90.0, brake_rate=300.0)
    assert plain.shield is not None and slow.shield is not None
    assert slow.shield.assumed.response_s == pytest.approx(plain.shield.assumed.response_s + 0.15)
    assert slow.shield.assumed.limit_share == 0.9
