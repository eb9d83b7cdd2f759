"""Speed and accelerometer against each other: estimates that hold and faults of known size."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch.prepare.prepared import derivative, noise_of, observed_acceleration
from deeptruck_model.mismatch.prepare.sensors import compare

DT, N = 0.1, 6000


def drive(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Speed, and acceleration as its mean over each step."""
    rng = np.random.default_rng(seed)
    a = gaussian_filter1d(rng.normal(0.0, 1.0, N), 15.0) * 3.0
    return 20.0 + np.cumsum(a - a.mean()) * DT, a - a.mean()


def test_noise_is_measured_beneath_a_moving_signal() -> None:
    speed, _ = drive()
    noisy = speed + np.random.default_rng(1).normal(0.0, 0.02, N)
    assert noise_of(noisy) == pytest.approx(0.02, rel=0.1)
    assert noise_of(speed) < 0.002
    assert noise_of(np.ones(4)) == 0.0


def test_derivative_is_the_mean_over_the_step_before() -> None:
    speed, a = drive()
    assert derivative(speed, DT)[1:] == pytest.approx(a[1:])
    assert len(derivative(np.zeros(0), DT)) == 0


def test_both_sensors_together_are_better_than_speed_alone_and_ignore_an_offset() -> None:
    speed, a = drive()
    rng = np.random.default_rng(2)
    noisy, sensor = speed + rng.normal(0.0, 0.02, N), a + 0.3 + rng.normal(0.0, 0.02, N)
    sensor[1000:1040] = np.nan
    both = observed_acceleration(noisy, sensor, DT)
    alone = observed_acceleration(noisy, None, DT)
    inner = np.r_[100:900, 1200:5900]
    assert np.std((both - a)[inner]) < 0.3 * np.std((alone - a)[inner])
    assert abs((both - a)[inner].mean()) < 0.01
    assert np.isfinite(both).all()


def test_the_ends_are_as_good_as_what_is_between() -> None:
    """The last difference of a noisy speed was held for seconds, and called a burst of something unknown."""
    speed, a = drive()
    rng = np.random.default_rng(2)
    sensor = a + rng.normal(0.0, 0.02, N)
    ends = np.r_[1:40, N - 40 : N]
    errors = [observed_acceleration(speed + rng.normal(0.0, 0.03, N), sensor, DT) - a for _ in range(30)]
    assert np.sqrt(np.mean(np.square(errors)[:, ends])) < 1.5 * np.sqrt(np.mean(np.square(errors)[:, 40:-40]))


def test_a_true_acceleration_passes_unchanged() -> None:
    speed, a = drive()
    assert observed_acceleration(speed, a, DT)[99:-99] == pytest.approx(a[99:-99], abs=1e-6)


@pytest.mark.parametrize(
    ("slope", "offset", "lag"), [(1.0, 0.0, 0), (1.0, 0.2, 0), (0.9, 0.0, 0), (1.0, 0.0, 6)]
)
def test_faults_are_measured(slope: float, offset: float, lag: int) -> None:
    speed, a = drive()
    sensor = slope * np.roll(a, lag) + offset + np.random.default_rng(3).normal(0.0, 0.02, N)
    seen = compare(speed, sensor, DT)
    assert seen.slope == pytest.approx(slope, abs=0.03)  # what a lag may pass for
    assert seen.offset == pytest.approx(offset, abs=max(4 * seen.offset_se, 0.005))
    assert seen.lag_s == pytest.approx(lag * DT, abs=max(4 * seen.lag_se, 0.08))


def test_without_an_accelerometer_or_without_motion_nothing_is_claimed() -> None:
    speed, a = drive()
    assert np.isnan(compare(speed, None, DT).slope)
    assert np.isnan(compare(np.full(N, 20.0), a, DT).slope)


@pytest.mark.parametrize("lag_s", [0.8, -0.8, 1.5])
def test_a_long_lag_leaves_the_scale_as_it_is(lag_s: float) -> None:
    speed, a = drive()
    late = np.interp(np.arange(N) - lag_s / DT, np.arange(N), a)
    found = compare(speed, late, DT)
    assert found.lag_s == pytest.approx(lag_s, abs=0.03)
    assert found.slope == pytest.approx(1.0, abs=0.02)


def test_an_accelerometer_that_has_nothing_to_do_with_the_speed_is_compared_all_the_same() -> None:
    for seed in range(60):
        rng = np.random.default_rng(seed)
        speed = 15.0 + np.cumsum(rng.normal(0.0, 0.05, 1200))
        steps, swing = np.repeat(rng.normal(0.0, 0.5, 12), 100), np.sin(np.arange(1200) * DT / 5.0)
        for a in (rng.normal(0.0, 0.3, 1200), steps, swing):
            assert np.isfinite(compare(speed, a, DT).lag_s)
