"""The accelerometer of a simulated truck reads the derivative of speed and the slope of the road."""

import numpy as np

from deeptruck_model.trucks.accelerometer import Accelerometer


def test_it_feels_slope_and_pitch_beside_its_bias() -> None:
    means = {}
    for a, slope in ((0.0, 0.0), (0.0, 0.05), (1.0, 0.0)):
        one = Accelerometer(seed=3)
        means[a, slope] = np.mean([one.reads(a, slope) for _ in range(20_000)])
    level = means[0.0, 0.0]
    assert abs(level) < 4 * Accelerometer.BIAS
    np.testing.assert_allclose(means[0.0, 0.05] - level, 9.80665 * 0.05 / np.hypot(1.0, 0.05), atol=1e-9)
    np.testing.assert_allclose(means[1.0, 0.0] - level, 1.0 + Accelerometer.PITCH, atol=1e-9)
